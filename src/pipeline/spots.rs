//! Centres of the ball in pixels, and the spots in the calibrated plane that the flight is made of.

use super::camera::CalibratedCamera;
use crate::calibration::{Optics, View};
use crate::detect::Sighting;
use crate::detect::centre::Centre;
use crate::detect::registration::Registration;
use crate::flight::clock::FrameTimes;
use crate::flight::linking::Spot;
use crate::frames::Coded;
use crate::geometry::PixelPoint;
use crate::impact::error_budget::{LEAST_CENTRE_STD_PX, OVAL_CENTRE_STD_RADII, SWING_PART, SWING_STD_PX};

/// Less than this part of an outline on one circle is no outline.
const WHOLE_OUTLINE: f64 = 0.6;

/// A centre of what is, or may be, the ball. It says nothing of pixels but where they lie, so that it may as well come from
/// elsewhere.
#[derive(Debug, Clone, Copy)]
pub struct BallCentre {
    /// Index of the sighting, or of the centre given: the [`Spot`]'s id. Lists of centres are in its order.
    pub id: usize,
    /// The frame in presentation order.
    pub frame: usize,
    /// How that is stored.
    pub coded: Coded,
    /// How it lies against the reference picture.
    pub registration: Registration,
    /// The centre in that frame.
    pub centre: Centre,
    /// Whether a person says that it is the ball.
    pub is_chosen: bool,
}

impl BallCentre {
    /// A `centre` in the pixels of the sighting with index `id`.
    pub fn new(id: usize, sighting: &Sighting, centre: Centre) -> Self {
        Self {
            id,
            frame: sighting.frame,
            coded: sighting.coded,
            registration: sighting.registration,
            centre,
            is_chosen: false,
        }
    }

    /// The same in the reference picture.
    pub fn in_reference(&self) -> PixelPoint {
        self.registration.reference_from_frame(self.centre.disc.centre)
    }

    /// Standard deviation of each coordinate in a picture that swings, px: how well its edges tell by how much, which the codec
    /// draws anew, and a part of the swing for what turns or smears in it.
    fn swing_std_px(&self, stands_still: bool) -> f64 {
        if stands_still && !self.registration.is_still() {
            SWING_STD_PX.hypot(SWING_PART * self.registration.shift_px())
        } else {
            0.0
        }
    }

    /// Its spot in the plane, at the time when its row was exposed, at the ball's centre: that is not the centre of its outline where the camera is near.
    pub fn spot(
        &self,
        camera: &CalibratedCamera<'_>,
        optics: Option<Optics>,
        times_s: &[f64],
    ) -> Option<Spot> {
        let seen = self.in_reference();
        let disc = &self.centre.disc;
        let of_outline = camera.map.plane_from_pixel(seen)?;
        let unit = camera.map.jacobian(seen)?.determinant().abs().sqrt();
        let std_px = self.centre.std_px().max(LEAST_CENTRE_STD_PX);
        Some(Spot {
            id: self.id,
            frame: self.frame,
            time_s: times_s[self.frame] + camera.readout.delay_s(disc.centre),
            place: camera
                .silhouettes(optics)
                .centre_of_outline(seen, disc.radius_px)
                .unwrap_or(of_outline),
            std: unit * std_px.hypot(self.swing_std_px(camera.stands_still)),
            coded: self.coded,
            radius: unit * disc.radius_px,
            contrast_grey: self.centre.contrast_grey,
        })
    }

    /// The spot of a first centre. The middle of an oval may be that of a ball with its shadow: what bends a path seen from
    /// above, and makes the ball larger, has to tell those from others.
    fn first_spot(
        &self,
        camera: &CalibratedCamera<'_>,
        optics: Option<Optics>,
        times_s: &[f64],
    ) -> Option<Spot> {
        let spot = self.spot(camera, optics, times_s)?;
        let near = camera.calibration.view == View::Top && camera.calibration.distance_m.is_some();
        let std = if near && self.centre.outline_used < WHOLE_OUTLINE {
            OVAL_CENTRE_STD_RADII * spot.radius
        } else {
            spot.std
        };
        Some(Spot { std, ..spot })
    }
}

/// The centres of everything round, as they were first seen.
pub fn first_centres(sightings: &[Sighting]) -> Vec<BallCentre> {
    let all = sightings.iter().enumerate();
    all.filter_map(|(i, s)| Some(BallCentre::new(i, s, s.centre?)))
        .collect()
}

/// The `first` centres, with the `better` ones of the same sightings in their places.
pub fn with_better(first: &[BallCentre], better: &[BallCentre]) -> Vec<BallCentre> {
    let of = |c: &BallCentre| {
        let centre = with_id(better, c.id).map_or(c.centre, |better| better.centre);
        BallCentre { centre, ..*c }
    };
    first.iter().map(of).collect()
}

/// The one of `centres` with this id.
pub fn with_id(centres: &[BallCentre], id: usize) -> Option<&BallCentre> {
    let i = centres.binary_search_by_key(&id, |c| c.id).ok()?;
    Some(&centres[i])
}

/// Spots of everything round, by the first centres, duplicate frames left out.
pub fn first_spots(
    camera: &CalibratedCamera<'_>,
    centres: &[BallCentre],
    frames: FrameTimes<'_>,
    optics: Option<Optics>,
) -> Vec<Spot> {
    let shown = centres.iter().filter(|c| !frames.duplicates[c.frame]);
    shown
        .filter_map(|c| c.first_spot(camera, optics, frames.times_s))
        .collect()
}
