use track::calibration::Calibration;
use track::measure::measure;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let c = Calibration::read(a[2].as_ref()).unwrap();
    let m = measure(a[1].as_ref(), &c, "c", &mut |_| {}).unwrap();
    let t: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&a[3]).unwrap()).unwrap();
    for b in &m.bounces {
        println!("az {:?}", b.azimuth_rad.map(|q| q.scaled(57.29578)));
    }
    println!("radius {:?} {:?}", m.track.radius_px, m.outcome);
    for p in &m.track.points {
        let c = &t["centres"][p.frame];
        println!(
            "{} {:.4} {:.4} {:?} {:?}",
            p.frame,
            p.pixel.u_px - c["u_px"].as_f64().unwrap(),
            p.pixel.v_px - c["v_px"].as_f64().unwrap(),
            p.std_px,
            p.use_
        );
    }
}
