//! What pictures and plots are made of: arcs as polylines, the ball cut out of its frames, the words for unused
//! points.

use super::decode::Decoded;
use super::in_metres::WorldFrame;
use super::measurement::{
    ArcMotion, ArcSample, ArcSpin, ArcTrace, PointUse, Strobe, StrobeBall, UnusedReason,
};
use super::spots::{BallCentre, with_id};
use crate::calibration::Rectification;
use crate::detect::crop::Crop;
use crate::flight::{Flight, FlightPoint, SpotUse};
use crate::frames::{Luma, LumaRange};
use crate::geometry::{PlanePoint, WorldPoint};
use std::sync::Arc;

/// Points of a drawn arc.
const ARC_POINTS: usize = 48;

/// The arcs as polylines, each up to the impacts at its ends.
pub fn arcs(
    flight: &Flight,
    map: &Rectification,
    frame: &WorldFrame,
    spins: &[Option<ArcSpin>],
) -> Vec<ArcTrace> {
    (0..flight.fit.arcs())
        .map(|k| {
            let before = k.checked_sub(1).and_then(|i| flight.impacts[i]);
            let after = flight.impacts.get(k).copied().flatten();
            let (from, to) = (
                before.unwrap_or(flight.spans[k].0),
                after.unwrap_or(flight.spans[k].1),
            );
            let samples = (0..=ARC_POINTS)
                .filter_map(|i| {
                    let time_s = from + (to - from) * i as f64 / ARC_POINTS as f64;
                    let m = flight.fit.motion(k, time_s);
                    let seen = PlanePoint::new(m.r, m.h);
                    let pixel = map.pixel_from_plane(seen)?;
                    let place = flight.fit.place_in_plane(seen, k, time_s);
                    Some(ArcSample {
                        time_s,
                        pixel,
                        world: Some(frame.world(place.right, place.up)),
                    })
                })
                .collect();
            let time_s = flight.fit.times[k];
            let m = flight.fit.in_plane(flight.fit.parameters.as_slice(), k, time_s);
            let (vx_m_s, up_m_s) = frame.velocity_m_s(m.vr, m.vh);
            let motion = ArcMotion {
                time_s,
                place: frame.world(m.r, m.h),
                vx_m_s,
                up_m_s,
            };
            ArcTrace {
                samples,
                motion,
                spin: spins.get(k).cloned().flatten(),
            }
        })
        .collect()
}

/// Residual of a point to its arc (or the arc nearest in time, for a point that was set aside), m.
pub fn residual(flight: &Flight, p: &FlightPoint, frame: &WorldFrame) -> Option<WorldPoint> {
    let k = match p.use_ {
        SpotUse::Used(k) => k,
        SpotUse::Outlier(_) | SpotUse::Contact => flight.arc_at(p.spot.time_s),
        SpotUse::NotFree => return None,
    };
    let t = p.spot.time_s;
    let m = flight.fit.motion(k, t);
    let world = |seen: PlanePoint| {
        let place = flight.fit.place_in_plane(seen, k, t);
        frame.world(place.right, place.up)
    };
    let (here, there) = (world(p.spot.place), world(PlanePoint::new(m.r, m.h)));
    Some(WorldPoint {
        x_m: here.x_m - there.x_m,
        up_m: here.up_m - there.up_m,
    })
}

/// The use of a point, in metres.
pub fn use_of(p: &FlightPoint, frame: &WorldFrame) -> PointUse {
    match p.use_ {
        SpotUse::Used(k) => PointUse::Used(k),
        SpotUse::NotFree => PointUse::Unused(UnusedReason::NotFree),
        SpotUse::Contact => PointUse::Unused(UnusedReason::Contact),
        SpotUse::Outlier(units) => PointUse::Unused(UnusedReason::OffArc {
            by_m: units * frame.metres_per_unit,
        }),
    }
}

/// The empty `strobe` with the ball of every used point.
pub fn strobe(mut strobe: Strobe, seen: &Decoded, found: &[BallCentre], flight: &Flight) -> Strobe {
    for p in flight.used_points() {
        let Some(f) = with_id(found, p.spot.id) else {
            continue;
        };
        let s = &seen.sightings[f.id];
        let disc = f.centre.disc;
        let reach = disc.radius_px + 0.5 * disc.swept_px[0].hypot(disc.swept_px[1]) + 3.0;
        let crop = &s.blob.crop;
        let (us, vs) = (
            span(disc.centre.u_px, reach, crop.u, crop.luma.width),
            span(disc.centre.v_px, reach, crop.v, crop.luma.height),
        );
        if us.is_empty() || vs.is_empty() {
            continue;
        }
        let own_luma = s.colours.as_ref().and_then(|c| c.luma.as_ref());
        let part = Crop::of(own_luma.unwrap_or(&crop.luma), us.clone(), vs.clone());
        let chroma = s.colours.as_ref().filter(|_| strobe.chroma.is_some()).map(|cut| {
            let shown = cut.chroma.stretched(seen.info.luma_range);
            let (columns, rows) = (
                crop.u + us.start..crop.u + us.end,
                crop.v + vs.start..crop.v + vs.end,
            );
            let at = |u: usize, v: usize| {
                shown.at(
                    u.saturating_sub(2 * cut.first.0),
                    v.saturating_sub(2 * cut.first.1),
                )
            };
            rows.flat_map(|v| columns.clone().map(move |u| (u, v)))
                .map(|(u, v)| at(u, v))
                .collect()
        });
        let centre = s.registration.reference_from_frame(disc.centre);
        // To the nearest pixel of the reference picture; the outline is drawn at the centre, which is exact.
        let moved = |x: f64| x.round() as i64;
        strobe.balls.push(StrobeBall {
            frame: s.frame,
            corner_px: (
                (crop.u + us.start) as i64 + moved(centre.u_px - disc.centre.u_px),
                (crop.v + vs.start) as i64 + moved(centre.v_px - disc.centre.v_px),
            ),
            luma: stretch(&part.luma, seen.info.luma_range),
            chroma,
            centre,
            radius_px: disc.radius_px,
        });
    }
    strobe
}

/// Columns (or rows) of a crop within `reach` of `centre`, counted from the crop's corner.
fn span(centre: f64, reach: f64, corner: usize, size: usize) -> std::ops::Range<usize> {
    let from = (centre - reach - corner as f64).floor().max(0.0) as usize;
    let to = ((centre + reach - corner as f64).ceil() + 1.0).clamp(0.0, size as f64) as usize;
    from..to.max(from)
}

/// The empty scene alone.
pub fn empty_strobe(seen: &Decoded) -> Strobe {
    let colours = seen.scene_colours.as_ref();
    let luma = colours
        .and_then(|c| c.luma.as_ref())
        .unwrap_or(&seen.detector.background.luma);
    let chroma = colours.map(|c| Arc::new(c.chroma.stretched(seen.info.luma_range)));
    Strobe {
        background: Arc::new(stretch(luma, seen.info.luma_range)),
        chroma,
        luma_shares: seen.info.luma_shares,
        balls: Vec::new(),
    }
}

fn stretch(luma: &Luma, range: LumaRange) -> Luma {
    let data = luma.data.iter().map(|&p| stretched(p, range)).collect();
    Luma {
        width: luma.width,
        height: luma.height,
        data,
    }
}

/// A code value stretched from black..white to 0..255.
fn stretched(value: u8, range: LumaRange) -> u8 {
    let (black, white) = (f64::from(range.black), f64::from(range.white));
    ((f64::from(value) - black) * 255.0 / (white - black))
        .round()
        .clamp(0.0, 255.0) as u8
}
