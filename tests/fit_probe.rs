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
