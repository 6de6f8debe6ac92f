//! Centres on synthetic balls drawn by brute force: 16 × 16 samples a pixel, nothing shared with the model.

use super::blobs::Crop;
use super::centre::edge_band::{Effort, Freedom, refine};
use super::centre::{Disc, Patch, outline};
use crate::frames::Luma;
use crate::geometry::PixelPoint;

/// Normal deviates by Box-Muller on a SplitMix stream.
struct Noise(u64);

impl Noise {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }
}

struct Ball {
    u: f64,
    v: f64,
    radius: f64,
    swept: [f64; 2],
    shading: f64,
    highlight: f64,
}

/// A ball of base level 200 on 60, PSF 0.7 px by jittering samples along a normal grid.
fn draw(ball: &Ball, size: usize, sigma: f64, noise: &mut Noise) -> Crop {
    const N: i32 = 8;
    let mut sharp = vec![0.0; size * size];
    for v in 0..size {
        for u in 0..size {
            let mut sum = 0.0;
            for a in 0..N {
                for b in 0..N {
                    let x = u as f64 + (f64::from(a) + 0.5) / f64::from(N) - 0.5;
                    let y = v as f64 + (f64::from(b) + 0.5) / f64::from(N) - 0.5;
                    let steps = 1 + (2.0 * ball.swept[0].hypot(ball.swept[1])) as i32;
                    for k in 0..steps {
                        let s = (f64::from(k) + 0.5) / f64::from(steps) - 0.5;
                        sum += shade(ball, x - s * ball.swept[0], y - s * ball.swept[1]) / f64::from(steps);
                    }
                }
            }
            sharp[v * size + u] = sum / f64::from(N * N);
        }
    }
    let kernel: Vec<f64> = (-4..=4)
        .map(|i| (-0.5 * (f64::from(i) / 0.7).powi(2)).exp())
        .collect();
    let total: f64 = kernel.iter().sum();
    let blur = |image: &[f64], du: usize, dv: usize| -> Vec<f64> {
        (0..size * size)
            .map(|i| {
                let (u, v) = ((i % size) as i64, (i / size) as i64);
                (-4_i64..=4)
                    .map(|k| {
                        let x = (u + k * du as i64).clamp(0, size as i64 - 1) as usize;
                        let y = (v + k * dv as i64).clamp(0, size as i64 - 1) as usize;
                        kernel[(k + 4) as usize] / total * image[y * size + x]
                    })
                    .sum()
            })
            .collect()
    };
    let image = blur(&blur(&sharp, 1, 0), 0, 1);
    let data = image
        .iter()
        .map(|p| (p + sigma * noise.normal()).round().clamp(0.0, 255.0) as u8)
        .collect();
    Crop {
        u: 0,
        v: 0,
        luma: Luma {
            width: size,
            height: size,
            data,
        },
    }
}

fn shade(ball: &Ball, x: f64, y: f64) -> f64 {
    let (xi, eta) = ((x - ball.u) / ball.radius, (y - ball.v) / ball.radius);
    let rho2 = xi * xi + eta * eta;
    if rho2 > 1.0 {
        return 60.0;
    }
    let n = (1.0 - rho2).sqrt();
    let light = (-0.5 * xi - 0.5 * eta + std::f64::consts::FRAC_1_SQRT_2 * n).max(0.0);
    let spot = ((xi + 0.35).powi(2) + (eta + 0.35).powi(2)) / 0.02;
    200.0 * (1.0 - ball.shading + ball.shading * light) + ball.highlight * (-spot).exp()
}

fn patch(crop: &Crop, noise_grey: f64) -> Patch<'_> {
    Patch {
        crop,
        background: vec![60.0; crop.luma.data.len()],
        noise_grey,
    }
}

const ALL_FREE: Freedom = Freedom {
    radius: true,
    blur_px: None,
    swept: false,
    effort: Effort::Measure,
};

/// Centre errors over sub-pixel phases: (mean u, mean v, scatter, mean stated standard uncertainty).
fn errors(radius: f64, shading: f64, highlight: f64, sigma: f64) -> (f64, f64, f64, f64) {
    let mut noise = Noise(7);
    let size = (2.0 * radius) as usize + 24;
    let (mut du, mut dv, mut stated) = (Vec::new(), Vec::new(), 0.0);
    for i in 0..60 {
        let (a, b) = (noise.unit(), noise.unit());
        let c = size as f64 / 2.0;
        let ball = Ball {
            u: c + a,
            v: c + b,
            radius,
            swept: [0.0; 2],
            shading,
            highlight,
        };
        let crop = draw(&ball, size, sigma, &mut noise);
        let patch = patch(&crop, sigma.max(0.29));
        let start = PixelPoint::new(c + 0.2 * radius, c);
        let found = outline::find(&patch, start, None).unwrap_or_else(|| panic!("outline {i}"));
        let fit = refine(&patch, &found.disc, ALL_FREE).unwrap_or_else(|| panic!("centre {i}"));
        du.push(fit.disc.centre.u_px - ball.u);
        dv.push(fit.disc.centre.v_px - ball.v);
        stated += fit.std_px() / 60.0;
    }
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (mu, mv) = (mean(&du), mean(&dv));
    let var = du
        .iter()
        .map(|d| (d - mu).powi(2))
        .chain(dv.iter().map(|d| (d - mv).powi(2)))
        .sum::<f64>();
    (mu, mv, (var / 118.0).sqrt(), stated)
}

#[test]
fn a_flat_disc_is_found_near_the_cramer_rao_bound() {
    for radius in [6.0, 15.0, 30.0] {
        let (mu, mv, scatter, stated) = errors(radius, 0.0, 0.0, 2.8);
        let bound = 2.8 / 140.0 * (2.0 * 0.757 / (std::f64::consts::PI.sqrt() * radius)).sqrt();
        println!("R {radius}: bias {mu:.4} {mv:.4} scatter {scatter:.4} bound {bound:.4} stated {stated:.4}");
        assert!(mu.abs() < 0.005 && mv.abs() < 0.005);
        // Radius, blur and brightness are free here; what they cost a small disc is the factor.
        assert!(scatter < 2.0 * bound, "R {radius}: {scatter} against {bound}");
        assert!((stated / scatter - 1.0).abs() < 0.3);
    }
}

#[test]
fn shading_and_a_highlight_do_not_pull_the_centre() {
    for radius in [8.0, 15.0, 30.0] {
        let (mu, mv, scatter, stated) = errors(radius, 0.6, 60.0, 2.0);
        println!("R {radius}: bias {mu:.4} {mv:.4} scatter {scatter:.4} stated {stated:.4}");
        // The light's edge crosses this ball, the hardest case: a small one is pulled by a part of a percent of R.
        assert!(mu.hypot(mv) < 0.08, "bias {mu} {mv}");
        assert!(scatter < 0.07, "scatter {scatter}");
    }
}

#[test]
fn a_small_ball_of_three_pixels() {
    let (mu, mv, scatter, _) = errors(3.0, 0.3, 0.0, 2.0);
    println!("R 3: bias {mu:.4} {mv:.4} scatter {scatter:.4}");
    assert!(mu.hypot(mv) < 0.05 && scatter < 0.05);
}

#[test]
fn a_smeared_ball_is_a_capsule_about_mid_exposure() {
    let mut noise = Noise(11);
    for length in [4.0, 12.0, 24.0] {
        let ball = Ball {
            u: 40.3,
            v: 39.8,
            radius: 12.0,
            swept: [0.6 * length, 0.8 * length],
            shading: 0.4,
            highlight: 0.0,
        };
        let crop = draw(&ball, 80, 2.0, &mut noise);
        let start = Disc {
            centre: PixelPoint::new(41.0, 39.0),
            radius_px: 12.5,
            swept_px: [0.5 * length, 0.7 * length],
        };
        let fit = refine(
            &patch(&crop, 2.0),
            &start,
            Freedom {
                swept: true,
                ..ALL_FREE
            },
        )
        .unwrap();
        let error = fit.disc.centre.distance_px(PixelPoint::new(ball.u, ball.v));
        println!(
            "L {length}: error {error:.3} R {:.2} swept {:?}",
            fit.disc.radius_px, fit.disc.swept_px
        );
        assert!(error < 0.15, "L {length}: {error}");
    }
}

#[test]
fn a_shadow_below_is_left_out() {
    let mut noise = Noise(3);
    let ball = Ball {
        u: 40.3,
        v: 39.8,
        radius: 12.0,
        swept: [0.0; 2],
        shading: 0.3,
        highlight: 0.0,
    };
    let mut crop = draw(&ball, 80, 2.0, &mut noise);
    for v in 51..60 {
        for u in 25..60 {
            let p = &mut crop.luma.data[v * 80 + u];
            if f64::hypot(u as f64 - ball.u, v as f64 - ball.v) > 13.0 {
                *p = (f64::from(*p) * 0.5) as u8;
            }
        }
    }
    let patch = patch(&crop, 2.0);
    let found = outline::find(&patch, PixelPoint::new(41.0, 42.0), None).unwrap();
    let fit = refine(&patch, &found.disc, ALL_FREE).unwrap();
    let error = fit.disc.centre.distance_px(PixelPoint::new(ball.u, ball.v));
    println!("shadow: error {error:.3}, used {:.2}", fit.outline_used);
    assert!(error < 0.06, "{error}");
    assert!(fit.outline_used < 0.95);
}
