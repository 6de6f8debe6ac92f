// prints first-look sightings of a rendered scene
use track::detect::Detector;
use track::detect::background::Background;
use track::frames::{self, FrameSource};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let t: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&a[2]).unwrap()).unwrap();
    let survey: Vec<_> = frames::open_sparse(a[1].as_ref(), 15)
        .unwrap()
        .into_iter()
        .map(|f| f.luma)
        .collect();
    let mut d = Detector::new(Background::from_survey(&survey).unwrap());
    let mut s = frames::open(a[1].as_ref()).unwrap();
    while let Some(f) = s.next_frame().unwrap() {
        let r = d.look(&f);
        let c = &t["centres"][f.index];
        let (u, v) = (c["u_px"].as_f64().unwrap(), c["v_px"].as_f64().unwrap());
        print!(
            "{} true ({u:.1},{v:.1}) z {:.4}",
            f.index,
            c["z_m"].as_f64().unwrap()
        );
        for x in &r.sightings {
            match x.centre {
                Some(k) => print!(
                    " [{:.2} {:.2} R {:.2} agr {:.2}]",
                    k.disc.centre.u_px - u,
                    k.disc.centre.v_px - v,
                    k.disc.radius_px,
                    k.outline_used
                ),
                None => print!(
                    " [blob {:.1} {:.1} area {:.0}]",
                    x.blob.centroid.u_px - u,
                    x.blob.centroid.v_px - v,
                    x.blob.area_px
                ),
            }
        }
        println!();
    }
}
