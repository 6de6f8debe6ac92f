#![allow(clippy::unwrap_used)]
mod series;
use series::*;
use track::fit::{self, Options, Parameter};

fn show(name: &str, s: &track::fit::Series) {
    let t = std::time::Instant::now();
    let fitted = fit::fit(s, &Options::default());
    println!("== {name}  {:?}", t.elapsed());
    for g in &fitted.groups {
        println!("   preferred {}: {}", g.preferred.name(), g.reason);
        for n in &g.notes { println!("   note {}: {}", n.code, n.message); }
        for a in &g.rows_set_aside { println!("   aside {} {}", a.row, a.reason); }
        for m in &g.models {
            println!("   {} conv {} chi2 {:.4e} dof {} p {:?} aicc {:?} slide {} grip {} scatter {:.3} {:?}", m.name.name(), m.converged, m.chi2, m.degrees_of_freedom, m.p_value, m.aicc, m.sliding, m.gripping, m.scatter, m.impossible);
            for p in Parameter::ALL {
                match m.parameter(p) {
                    fit::Fitted::Determined(e) => println!("      {} = {:.8} ± {:?} [{:?}]", p.name(), e.quantity.value, e.quantity.std_uncertainty, e.interval_95),
                    fit::Fitted::NotDetermined(r) => println!("      {} null: {r}", p.name()),
                }
            }
            match &m.transition.angle_rad {
                fit::Fitted::Determined(e) => println!("      transition {:.4} ± {:?} [{:?}] {:?}", e.quantity.value.to_degrees(), e.quantity.std_uncertainty.map(f64::to_degrees), (e.interval_95.0.map(f64::to_degrees), e.interval_95.1.map(f64::to_degrees)), m.transition.without_jump_rad.map(|q| q.scaled(1f64.to_degrees()))),
                fit::Fitted::NotDetermined(r) => println!("      transition null: {r}"),
            }
        }
    }
}

#[test]
fn probe() {
    let mut n = Noise(1);
    let steel = mu_e(0.78, 0.07, 0.07);
    let golf = mu_e(0.90, 0.12, 0.12);
    let wood = mu_e(0.52, 0.10, 0.15);
    let superball = e_e(0.96, 0.5);
    let gs = grip_slide(0.96, 0.5, 0.25);
    for (kind, make) in [("velocities", velocities as Maker), ("angles", angles), ("distances", distances)] {
        for d in [TRACK, EXACT] {
            let tag = if d.velocity > 0.0 { "noisy" } else { "exact" };
            show(&format!("steel {kind} {tag}"), &series(&steel, &spread(10.0, 60.0, 10), 0.0, make, d, &mut n));
            show(&format!("golf {kind} {tag}"), &series(&golf, &spread(10.0, 60.0, 10), 0.0, make, d, &mut n));
            show(&format!("superball {kind} {tag}"), &series(&superball, &spread(10.0, 60.0, 10), 0.0, make, d, &mut n));
            show(&format!("grip-slide {kind} {tag}"), &series(&gs, &spread(10.0, 60.0, 10), 0.0, make, d, &mut n));
            show(&format!("wood {kind} {tag}"), &series(&wood, &spread(25.0, 60.0, 12), 0.0, make, d, &mut n));
        }
    }
}

#[test]
fn probe2() {
    let mut n = Noise(7);
    let wood = mu_e(0.52, 0.10, 0.15);
    let gs = grip_slide(0.96, 0.5, 0.25);
    for (kind, make) in [("velocities", velocities as Maker), ("angles", angles), ("distances", distances)] {
        for d in [TRACK, EXACT] {
            for _ in 0..3 {
            let a = |s: &track::fit::Series| { let t = std::time::Instant::now(); let f = fit::fit(s, &Options::default()); let g = &f.groups[0];
                println!("{kind} {} aside {:?} notes {:?} {:?}", g.preferred.name(), g.rows_set_aside, g.notes.iter().map(|n| n.code).collect::<Vec<_>>(), t.elapsed()); };
            a(&series(&gs, &spread(10.0, 60.0, 10), 0.0, make, d, &mut n));
            a(&series(&wood, &spread(25.0, 60.0, 12), 0.0, make, d, &mut n));
            }
        }
    }
}

fn covered(f: &fit::Fitted, truth: f64) -> Option<(bool, bool)> {
    let e = f.estimate()?;
    let c = |k: f64| e.quantity.std_uncertainty.map(|s| (e.quantity.value - truth).abs() <= k * s).unwrap_or(false);
    let _ = (); let inside = e.interval_95.0.is_none_or(|l| l <= truth) && e.interval_95.1.is_none_or(|h| h >= truth);
    let _ = c;
    Some((inside, true))
}

#[test]
fn coverage() {
    let runs: usize = std::env::var("RUNS").ok().and_then(|s| s.parse().ok()).unwrap_or(200);
    let only = std::env::var("ONLY").unwrap_or_default();
    let cases: Vec<(&str, Truth, f64, f64, usize, f64, fit::ModelName)> = vec![
        ("steel", mu_e(0.78, 0.07, 0.07), 10.0, 60.0, 8, 0.0, fit::ModelName::MuE),
        ("golf", mu_e(0.90, 0.12, 0.12), 10.0, 60.0, 8, 0.0, fit::ModelName::MuE),
        ("superball", e_e(0.96, 0.5), 10.0, 60.0, 8, 0.0, fit::ModelName::EE),
        ("gripslide", grip_slide(0.96, 0.5, 0.25), 10.0, 70.0, 10, 0.0, fit::ModelName::GripSlide),
        ("wood", mu_e(0.52, 0.10, 0.15), 25.0, 60.0, 12, 0.0, fit::ModelName::MuE),
        ("S1", mu_e(0.78, 0.07, 0.07), 10.0, 60.0, 8, 1.6, fit::ModelName::MuE),
        ("S2", mu_e(0.78, 0.07, 0.07), 10.0, 60.0, 8, 1.09, fit::ModelName::MuE),
        ("Ss", mu_e(0.78, 0.07, 0.07), 10.0, 60.0, 8, -0.21, fit::ModelName::MuE),
        ("So", mu_e(0.78, 0.07, 0.07), 10.0, 60.0, 8, 1.0, fit::ModelName::MuE),
        ("steel60", mu_e(0.78, 0.07, 0.07), 10.0, 60.0, 60, 0.0, fit::ModelName::MuE),
        ("wood60", mu_e(0.52, 0.10, 0.15), 25.0, 60.0, 60, 0.0, fit::ModelName::MuE),
    ];
    for (kind, make) in [("velocities", velocities as Maker), ("angles", angles), ("distances", distances)] {
        for (name, truth, from, to, count, spin, model) in &cases {
            if !format!("{kind}/{name}").contains(&only) { continue; }
            let mut noise = Noise(99);
            let t = std::time::Instant::now();
            let mut stats: std::collections::BTreeMap<&str, (usize, usize)> = Default::default();
            let mut preferred: std::collections::BTreeMap<&str, usize> = Default::default();
            let (mut aside, mut gof, mut stuck) = (0, 0, 0);
            let mut worst: f64 = 0.0;
            for _ in 0..runs {
                let mut a: Vec<f64> = spread(*from, *to, *count);
                for x in &mut a { *x += (noise.uniform() - 0.5) * (to - from) / *count as f64; }
                let s = series(truth, &a, *spin, make, TRACK, &mut noise);
                let f = fit::fit(&s, &Options::default());
                let g = &f.groups[0];
                *preferred.entry(g.preferred.name()).or_default() += 1;
                aside += g.rows_set_aside.len();
                stuck += usize::from(g.notes.iter().any(|n| n.code == "rows_stick_out_together"));
                let m = g.model(*model).unwrap();
                gof += usize::from(m.p_value.unwrap_or(1.0) < 0.01);
                let (e, mu, mu0, ex, tr) = match truth {
                    Truth::MuE(p) => (p.restitution, Some(p.friction), Some(p.static_friction), None, Some(track::models::mu_e::transition_angle_rad(p, *spin, 0.4))),
                    Truth::EE(p) => (p.restitution, None, None, Some(p.tangential_restitution_x), None),
                    Truth::GripSlide(p) => (p.restitution, Some(p.friction), None, Some(p.tangential_restitution_x), Some(track::models::grip_slide::transition_angle_rad(p, *spin, 0.4))),
                };
                let mut put = |n: &'static str, f: &fit::Fitted, t: Option<f64>| {
                    if let (Some(t), Some((c, _))) = (t, covered(f, t.unwrap_or_default())) { let s = stats.entry(n).or_default(); s.0 += usize::from(c); s.1 += 1;
                    }
                };
                put("e", m.parameter(Parameter::Restitution), Some(e));
                put("mu", m.parameter(Parameter::Friction), mu);
                put("mu0", m.parameter(Parameter::StaticFriction), mu0);
                put("ex", m.parameter(Parameter::TangentialRestitution), ex);
                put("tr", &m.transition.angle_rad, tr);
                if let (Some(t), Some(q)) = (tr, m.transition.angle_rad.quantity()) { worst = worst.max((q.value - t).abs().to_degrees()); }
            }
            println!("{kind}/{name}: {preferred:?} aside {aside} stuck {stuck} gof<.01 {gof} cover {:?} worst transition {worst:.3} {:?}/series", stats.iter().map(|(k, v)| format!("{k} {:.1}% of {}", 100.0 * v.0 as f64 / v.1 as f64, v.1)).collect::<Vec<_>>(), t.elapsed() / runs as u32);
        }
    }
}

#[test]
fn zscores() {
    let mut noise = Noise(5);
    let truth = grip_slide(0.96, 0.5, 0.25);
    let (mut n, mut out, mut sum, mut sq) = (0.0, 0, 0.0, 0.0);
    for i in 0..400 {
        let mut a: Vec<f64> = spread(10.0, 70.0, 10);
        for x in &mut a { *x += (noise.uniform() - 0.5) * 6.0; }
        let s = series(&truth, &a, 0.0, angles, TRACK, &mut noise);
        let f = fit::fit(&s, &Options::default());
        let m = f.groups[0].model(fit::ModelName::GripSlide).unwrap();
        let e = m.parameter(Parameter::Restitution).estimate().unwrap();
        let z = (e.quantity.value - 0.96) / e.quantity.std_uncertainty.unwrap();
        n += 1.0; sum += z; sq += z * z;
        if z.abs() > 1.96 { out += 1; 
            let dist: Vec<String> = a.iter().zip(&m.rows).map(|(a, r)| format!("{:.1}{}", a, if r.regime == fit::RowRegime::Sliding { "S" } else { "G" })).collect();
            println!("{i} z {z:.2} e {:.5} std {:.5} chi2 {:.2} {}", e.quantity.value, e.quantity.std_uncertainty.unwrap(), m.chi2, dist.join(" ")); }
    }
    println!("out {out} of {n} mean z {:.3} sd {:.3}", sum / n, (sq / n - (sum / n) * (sum / n)).sqrt());
}

#[test]
fn steel60() {
    let mut noise = Noise(std::env::var("SEED").unwrap().parse().unwrap());
    let truth = mu_e(0.78, 0.07, 0.07);
    let mut d = Vec::new(); let mut zs = Vec::new();
    for i in 0..1000 {
        let mut a: Vec<f64> = spread(10.0, 60.0, 60);
        for x in &mut a { *x += (noise.uniform() - 0.5) * 50.0 / 60.0; }
        let s = series(&truth, &a, 0.0, velocities, TRACK, &mut noise);
        let f = fit::fit(&s, &Options::default());
        let g = &f.groups[0];
        let (m, q) = (g.model(fit::ModelName::MuE).unwrap(), g.model(fit::ModelName::GripSlide).unwrap());
        let ex = q.parameter(Parameter::TangentialRestitution).quantity().unwrap();
        d.push(m.chi2 - q.chi2);
        let z = ex.value / ex.std_uncertainty.unwrap();
        zs.push(z); if m.chi2 - q.chi2 > 400.0 { println!("{i} mu_e {:.2} gs {:.2} diff {:.2} e_x {:.5} z² {:.2} mu {:.5} {:.5} slides {} {}", m.chi2, q.chi2, m.chi2 - q.chi2, ex.value, z*z, m.parameter(Parameter::Friction).quantity().unwrap().value, q.parameter(Parameter::Friction).quantity().unwrap().value, m.sliding, q.sliding); }
    }
    d.sort_by(f64::total_cmp);
    println!("median {:.2} 90% {:.2} 95% {:.2} 99% {:.2} min {:.3}", d[500], d[900], d[950], d[990], d[0]);
    println!("sd diff {:.3} over 6.635: {} over 3.84 {}", (zs.iter().map(|z| z * z).sum::<f64>() / 1000.0).sqrt(), zs.iter().filter(|z| **z * **z > 6.635).count(), zs.iter().filter(|z| **z * **z > 3.84).count());
}

fn many(truth: &Truth, n: usize, make: Maker, noise: &mut Noise) -> track::fit::Series {
    let a: Vec<f64> = (0..n).map(|_| 10.0 + 50.0 * noise.uniform()).collect();
    series(truth, &a, 0.0, make, TRACK, noise)
}

#[test]
fn large() {
    let mut n = Noise(3);
    for (name, truth) in [("steel", mu_e(0.78, 0.07, 0.07)), ("wood", mu_e(0.52, 0.10, 0.15)), ("super", e_e(0.96, 0.5)), ("gs", grip_slide(0.96, 0.5, 0.25))] {
        show(&format!("{name} velocities 100k"), &many(&truth, 100_000, velocities, &mut n));
        show(&format!("{name} angles 100k"), &many(&truth, 100_000, angles, &mut n));
        show(&format!("{name} distances 100k"), &many(&truth, 100_000, distances, &mut n));
    }
}
#[test]
fn big1() {
    let mut n = Noise(3);
    let make: Maker = match std::env::var("KIND").unwrap().as_str() { "v" => velocities, "a" => angles, _ => distances };
    let truth = match std::env::var("TRUTH").unwrap().as_str() { "steel" => mu_e(0.78, 0.07, 0.07), "wood" => mu_e(0.52, 0.10, 0.15), "super" => e_e(0.96, 0.5), _ => grip_slide(0.96, 0.5, 0.25) };
    let s = many(&truth, 100_000, make, &mut n);
    let t = std::time::Instant::now();
    let f = fit::fit(&s, &Options::default()); let g = &f.groups[0]; println!("{} {} aside {} {:?}", g.preferred.name(), g.reason, g.rows_set_aside.len(), g.models[0].transition.angle_rad);
    println!("TOOK {:?}", t.elapsed());
}
