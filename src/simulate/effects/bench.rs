//! A bench in the picture: the ball is seen rolling or sliding along it, at constant height and at the launch speed, before
//! it leaves the edge at x = 0.
//!
//! The clip then begins `seen_s` before the launch. Rolling gives the spin R ω_y / u = 1, and R / sqrt(R² − a²/4) on a track
//! of width a, on whose two edges the ball rolls. A ball slower than sqrt(g R) would not fly off but tip round the edge.

use super::{Action, Effect, EffectEstimate, Fixture, Ideal};
use crate::simulate::camera::{PictureEdge, PictureOf};
use crate::simulate::scene::{Scene, View};
use nalgebra::{Vector2, Vector3};

/// Bench.
pub(super) struct Bench;

/// From the bench's top to its underside, m.
const THICKNESS_M: f64 = 0.03;

impl Effect for Bench {
    fn name(&self) -> &'static str {
        "bench"
    }

    fn is_of_the_ideal(&self) -> bool {
        true
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        // Without the bench every frame is that much later in the flight, where the ball is faster than when it rolled.
        let seen_s = scene.launch.bench.map_or(0.0, |bench| bench.seen_s);
        let speed_px_s = if seen_s > 0.0 {
            ideal.top_speed_px_s(scene)
        } else {
            0.0
        };
        EffectEstimate::px(
            speed_px_s * seen_s,
            "v seen_s at the largest speed: how far the ball goes in the time it is seen on the bench",
        )
    }

    fn action(&self, scene: &Scene) -> Action {
        let launch = &scene.launch;
        let Some(bench) = launch.bench else {
            return Action::Nothing;
        };
        let drawn = bench.bench_grey.filter(|_| scene.camera.view == View::Side);
        Action::Bench {
            seen_s: bench.seen_s,
            board: drawn.map(|grey| -> Box<dyn Fixture> {
                Box::new(BenchFixture {
                    grey,
                    top_m: launch.drop_height_m,
                    seen_m: launch.speed_m_s * bench.seen_s,
                })
            }),
        }
    }
}

/// The bench as the picture shows it.
struct BenchFixture {
    grey: f64,
    /// Where the ball's lowest point rolls, above z = 0, m.
    top_m: f64,
    /// How far the ball is seen to roll, m: straight between there and the edge, however the lens bends it.
    seen_m: f64,
}

impl Fixture for BenchFixture {
    fn grey(&self) -> f64 {
        self.grey
    }

    fn sides(&self, picture: &PictureOf) -> Vec<PictureEdge> {
        let at = |x_m: f64, z_m: f64| {
            let centre = picture.outline(&Vector3::new(x_m, 0.0, z_m)).centre;
            Vector2::new(centre.u_px, centre.v_px)
        };
        let (edge, foot) = (at(0.0, self.top_m), at(0.0, self.top_m - THICKNESS_M));
        let (start, start_foot) = (
            at(-self.seen_m, self.top_m),
            at(-self.seen_m, self.top_m - THICKNESS_M),
        );
        let inside = 0.5 * (start + foot);
        [(start, edge), (start_foot, foot), (foot, edge)]
            .into_iter()
            .filter_map(|(from, to)| PictureEdge::through(from, to, inside))
            .collect()
    }
}
