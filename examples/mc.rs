use serde_json::{Value, json};
use track::calibration::Calibration;
use track::measure::{Outcome, measure};
use track::simulate::{Recording, Scene, write};
struct R(u64);
impl R {
    fn f(&mut self, a: f64, b: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        a + (b - a) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (from, to): (u64, u64) = (a[1].parse().unwrap(), a[2].parse().unwrap());
    let strip = a.get(3).map(|s| s.as_str()).unwrap_or("");
    (from..to).for_each(|seed| {
        let mut r = R((seed+12345).wrapping_mul(0xD1342543DE82EF95)); for _ in 0..50 { r.0 ^= r.0 >> 29; r.f(0.,1.); }
        let balls = [(0.0125,0.0639,0.4,"steel"),(0.0213,0.0456,0.4,"golf"),(0.0230,0.0464,0.4,"super"),(0.02,0.0027,0.6667,"pp"),(0.033,0.0577,0.55,"tennis")];
        let b = balls[(r.f(0.,5.)) as usize % 5];
        let d = r.f(0.8, 5.0);
        let rpx = r.f(6.0, 20.0);
        let q = b.0 / rpx;
        let (w,h) = (640.0, 360.0);
        // keep within +-35 deg
        let q = q.min(d * 0.6 * 2.0 / w);
        let drop = r.f(0.05, 0.5_f64).min(0.4*d);
        let width_m = w*q; let t1 = (2.0*drop/9.81_f64).sqrt();
        let e = r.f(0.5,0.9);
        let speed = (0.45*width_m / t1).min(3.0) * r.f(0.4,1.0);
        let contact = if r.f(0.,1.)<0.5 { json!({"model":"mu_e","restitution":e,"friction":r.f(0.05,0.4)}) } else { json!({"model":"e_e","restitution":e,"tangential_restitution_x":r.f(-0.3,0.6),"tangential_restitution_y":r.f(-0.3,0.6)}) };
        let scene = json!({
            "schema":"track.scene/1","seed":seed,
            "ball":{"radius_m":b.0,"mass_kg":b.1,"inertia_factor":b.2},
            "contact":contact,
            "launch":{"drop_height_m":drop,"speed_m_s":speed,"spin_ratio":[r.f(-2.,2.),r.f(-0.5,1.),r.f(-0.5,0.5)]},
            "camera":{"view":"top","image_size_px":[640,360],"frame_rate_hz":240,"exposure_s":0.0005,"metres_per_pixel":q,"origin_px":[r.f(30.,90.),r.f(80.,280.)],"distance_m":d,"blur_px":r.f(0.5,0.9),"noise_grey":r.f(0.5,3.0),"codec": if r.f(0.,1.)<0.5 {"lossless"} else {"h264"}},
            "look":{"background_grey":60,"floor_grey":r.f(40.,100.),"ball_grey":r.f(170.,230.),"shading":r.f(0.,0.6),"shadow":r.f(0.,0.4)},
            "stop":{"bounces":2,"tail_s":0.08}});
        let out = std::panic::catch_unwind(|| {
            let dir = tempfile::tempdir().unwrap();
            let rec = match Recording::new(&Scene::from_json(&scene.to_string()).unwrap()) { Ok(r)=>r, Err(e)=> return format!("{seed} scene: {e}") };
            let out = if let Ok(k) = std::env::var("KEEP") { std::path::PathBuf::from(k) } else { dir.path().to_owned() };
            if strip.contains("scene") { println!("{scene}"); }
            let wr = write(&rec, &format!("t{seed}"), &out, |_|{}).unwrap();
            let mut c = Calibration::read(&wr.calib).unwrap();
            if strip.contains("mass") { c.ball.mass_kg=None; }
            if strip.contains("radius") { c.ball.radius_m=None; c.ball.mass_kg=None; }
            if strip.contains("ballscale") { c.scale = track::calibration::Scale::Ball; }
            if strip.contains("dist") { c.distance_m = None; }
            if strip.contains("std") { c.distance_std_m = c.distance_m.map(|d| 0.01*d); }
            let truth: Value = serde_json::from_str(&std::fs::read_to_string(&wr.truth).unwrap()).unwrap();
            let m = measure(&wr.video, &c, "c", &mut |_|{}).unwrap();
            let mut s = format!("{seed} {} D {d:.2} q {:.2} drop {drop:.2} v {speed:.2} R {:.1}px ", b.3, q*1e3, b.0/q);
            if let Outcome::Rejected{reason} = &m.outcome { s += &format!("REJECTED {}", &reason[..60]); }
            for w in &m.warnings { if w.code != "scale_uncertainty_unknown" { s += &format!(" !{}", w.code); if w.code == "distance_mismatch" { s += &w.message[40..90]; } } }
            let tb = truth["bounces"].as_array().unwrap();
            for b in &m.bounces {
                let t = b.time_s.unwrap().value;
                let Some(near) = tb.iter().min_by(|x,y| (x["time_s"].as_f64().unwrap()-t).abs().total_cmp(&(y["time_s"].as_f64().unwrap()-t).abs())) else {continue};
                let Some(az) = b.azimuth_rad else { s += " | none"; continue };
                let az = az.scaled(57.29577951308232);
                // incident azimuth may be turned: truth relative
                let ta = near["azimuth_deg"].as_f64().unwrap_or(f64::NAN);
                let std = az.std_uncertainty.unwrap_or(f64::NAN);
                let (vi, vt) = (b.incident.vx_m_s.unwrap(), near["incident"]["vx_m_s"].as_f64().unwrap().hypot(near["incident"]["vy_m_s"].as_f64().unwrap()));
                s += &format!(" | dt {:.2}ms az {:.2} err {:.3} std {:.3} PULL {:.2} vpull {:.2} tpull {:.2}", (t-near["time_s"].as_f64().unwrap())*1e3, ta, az.value-ta, std, (az.value-ta)/std, (vi.value-vt)/vi.std_uncertainty.unwrap_or(f64::NAN), (t-near["time_s"].as_f64().unwrap())/b.time_s.unwrap().std_uncertainty.unwrap_or(f64::NAN));
            }
            s
        }).unwrap_or_else(|_| format!("{seed} PANIC"));
        println!("{out}");
    });
}
