//! What the camera's distance changes: a ball's centre is not that of its outline, and from above it is not over the point
//! against which it is seen. Also drag, which the same facts of the ball tell.

use super::{Recording, refine};
use crate::calibration::{Optics, ScaleEvidence, Silhouettes, View, Viewpoint};
use crate::detect::centre::Centre;
use crate::flight::drag::Drag;
use crate::flight::fit::Forces;
use crate::flight::linking::Spot;
use crate::flight::overhead::Overhead;
use crate::flight::{Flight, FlightPoint, SpotUse};
use crate::geometry::{PixelPoint, PlanePoint};
use crate::quantity::Quantity;

/// A ball's speed where nothing is seen of it yet, m/s: drag hardly depends on it.
const USUAL_SPEED_M_S: f64 = 2.0;

/// Relative standard uncertainty of a smooth sphere's drag: formulas agree within 4 %, the air's density changes by more with
/// weather and height. Where felt or seams make more of it, the flight shows that.
const SPHERE_DRAG_RELATIVE_STD: f64 = 0.1;

/// How far the optical axis may be from where the calibration has it, as a part of the picture's width: the principal
/// point of a lens that was not calibrated, and a camera that is not quite square to the floor (1 % is half a degree).
const AXIS_PART: f64 = 0.01;

/// Relative standard uncertainty of a distance given without one: where in its lens a camera has its pinhole is not known to better.
const DISTANCE_PART: f64 = 0.01;

/// Less than this part of an outline on one circle is no outline.
const WHOLE_OUTLINE: f64 = 0.6;

/// How well the middle of a region that is no disc tells the ball's centre, in its radii.
const OVAL_CENTRE_STD_RADII: f64 = 0.15;

impl Recording<'_> {
    /// Where the camera stands over the plane, as far as `metres_per_unit` is known.
    pub(super) fn viewpoint(&self, metres_per_unit: f64) -> Option<Viewpoint> {
        let info = &self.seen.info;
        self.calibration
            .viewpoint(metres_per_unit, (info.width_px, info.height_px))
            .ok()
            .flatten()
    }

    /// The camera's angles, as far as `metres_per_unit` tells them.
    pub(super) fn optics_at(&self, metres_per_unit: Option<Quantity>) -> Option<Optics> {
        let info = &self.seen.info;
        let size = (info.width_px, info.height_px);
        self.calibration.optics(metres_per_unit.map(|q| q.value), size)
    }

    /// How the pictures draw the ball, as far as its camera is known.
    pub(super) fn silhouettes(&self) -> Silhouettes<'_> {
        let info = &self.seen.info;
        let middle = |size: usize| 0.5 * (size as f64 - 1.0);
        let middle = PixelPoint::new(middle(info.width_px), middle(info.height_px));
        Silhouettes::new(&self.map, self.optics, middle)
    }

    /// The spot of a centre: the ball's centre, which is not that of its outline where the camera is near.
    pub(super) fn spot(&self, id: usize, centre: &Centre) -> Option<Spot> {
        let s = &self.seen.sightings[id];
        let fixed = self.seen.detector.background.registrar.fixed;
        let spot = refine::spot((&self.map, fixed), s, centre, id, self.base.times_s[s.frame])?;
        let disc = &centre.disc;
        let place = self
            .silhouettes()
            .centre_of_outline(s.registration.reference_from_frame(disc.centre), disc.radius_px)
            .unwrap_or(spot.place);
        Some(Spot { place, ..spot })
    }

    /// The spot of a first centre. The middle of an oval may be that of a ball with its shadow: what bends a path seen from
    /// above, and makes the ball larger, has to tell those from others.
    pub(super) fn first_spot(&self, id: usize, centre: &Centre) -> Option<Spot> {
        let spot = self.spot(id, centre)?;
        let near = self.calibration.view == View::Top && self.calibration.distance_m.is_some();
        let std = if near && centre.outline_used < WHOLE_OUTLINE {
            OVAL_CENTRE_STD_RADII * spot.radius
        } else {
            spot.std
        };
        Some(Spot { std, ..spot })
    }

    /// Drag, where the ball's size and mass tell it. `speed` is that of the flight, plane units a second.
    pub(super) fn drag(&self, metres_per_unit: Option<f64>, speed: f64) -> Option<Drag> {
        let (ball, scale) = (&self.calibration.ball, metres_per_unit?);
        Some(Drag::of_sphere(
            (ball.radius_m?, ball.mass_kg?),
            scale,
            speed,
            SPHERE_DRAG_RELATIVE_STD,
        ))
    }

    /// The camera above the floor, where its distance is known; without `metres_per_unit` as far as other scales tell.
    /// `flight` is what was found of it so far.
    pub(super) fn overhead(&self, metres_per_unit: Option<f64>, flight: Option<&Flight>) -> Option<Overhead> {
        let c = self.calibration;
        let by_calibration = || Some(c.metres_per_unit(&ScaleEvidence::default()).ok()?.value);
        let scale = metres_per_unit.or_else(by_calibration);
        // Foot and height in metres are the same whatever a pixel measures.
        let unit = scale.unwrap_or(1.0);
        let camera = self.viewpoint(unit)?;
        let height_m = camera.height * unit;
        let distance = c.distance_std_m.map_or(DISTANCE_PART, |s| s / height_m);
        let speed = flight.map_or(USUAL_SPEED_M_S / unit, Flight::mean_speed);
        let gravity = c.gravity_std_m_s2.map_or(0.0, |s| s / c.gravity_m_s2);
        Some(Overhead {
            nadir: camera.foot,
            nadir_std: AXIS_PART * self.seen.info.width_px as f64 * self.units_per_px(),
            fall_per_s2: c.gravity_m_s2 / height_m,
            fall_relative_std: distance.hypot(gravity),
            height: scale.map(|_| camera.height),
            contact: c.ball.radius_m.map(|r| r / height_m),
            drag: self.drag(scale, speed),
            inertia_factor: c.ball.inertia_factor,
        })
    }

    /// The image of the ball's centre in its frame, where that is not the centre of its outline.
    pub(super) fn centre_px(&self, p: &FlightPoint) -> Option<PixelPoint> {
        self.optics?;
        let reference = self.map.pixel_from_plane(p.spot.place)?;
        let s = &self.seen.sightings[p.spot.id];
        Some(s.registration.frame_from_reference(reference))
    }
}

/// The point of the calibrated plane that a spot is at; `None` where only a fit would tell and there is none.
pub(super) fn in_plane(flight: &Flight, p: &FlightPoint) -> Option<PlanePoint> {
    let above = matches!(flight.fit.forces, Forces::Overhead(_));
    let t = p.spot.time_s;
    (!above || p.use_ != SpotUse::NotFree).then(|| {
        flight
            .fit
            .place_in_plane(p.spot.place, refine::arc_at(flight, t), t)
    })
}
