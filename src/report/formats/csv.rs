//! `<stem>.points.csv`: a row for every frame in which the ball was seen.

use super::{Contents, OutputFormat};
use crate::pipeline::{Measurement, PointUse, TrackPoint, UnusedReason, View};
use std::error::Error;

/// The points, for a spreadsheet.
pub struct Points;

impl OutputFormat for Points {
    fn name(&self) -> &'static str {
        "csv"
    }

    fn suffix(&self) -> &'static str {
        "points.csv"
    }

    fn contents<'a>(
        &self,
        measurement: &'a Measurement,
    ) -> Result<Contents<'a>, Box<dyn Error + Send + Sync>> {
        Ok(Contents::Bytes(points_csv(measurement)?))
    }
}

/// The points as CSV. A cell is empty where there is no value; numbers carry all their digits, as in the JSON.
///
/// In a top view the columns `z_m` and `residual_z_m` are called `y_m` and `residual_y_m`, because that is what is in
/// them. Where the recording holds several launches, the points of all are there, and a column `launch` says which, from 1.
///
/// # Errors
/// Whatever the `csv` crate refuses; into memory it refuses nothing.
fn points_csv(measurement: &Measurement) -> Result<Vec<u8>, ::csv::Error> {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let (second, second_residual) = match measurement.view {
        View::Side => ("z_m", "residual_z_m"),
        View::Top => ("y_m", "residual_y_m"),
    };
    let several = !measurement.launches.is_empty();
    let header = [
        "frame",
        "time_s",
        "u_px",
        "v_px",
        "std_px",
        "x_m",
        second,
        "used",
        "arc",
        "reason",
        "off_arc_m",
        "residual_x_m",
        second_residual,
    ];
    writer.write_record(header.into_iter().chain(several.then_some("launch")))?;
    for (i, launch) in measurement.each_launch().iter().enumerate() {
        for point in &launch.track.points {
            let number = several.then(|| (i + 1).to_string());
            writer.write_record(row(point).into_iter().chain(number))?;
        }
    }
    writer
        .into_inner()
        .map_err(|error| ::csv::Error::from(error.into_error()))
}

fn row(point: &TrackPoint) -> [String; 13] {
    let (arc, reason) = match point.use_ {
        PointUse::Used(arc) => (arc.to_string(), None),
        PointUse::Unused(reason) => (String::new(), Some(reason)),
    };
    [
        point.frame.to_string(),
        number(Some(point.time_s)),
        number(Some(point.pixel.u_px)),
        number(Some(point.pixel.v_px)),
        number(point.std_px),
        number(point.world.map(|world| world.x_m)),
        number(point.world.map(|world| world.up_m)),
        (!arc.is_empty()).to_string(),
        arc,
        reason.map_or("", UnusedReason::code).to_owned(),
        number(reason.and_then(UnusedReason::off_arc_m)),
        number(point.residual_m.map(|residual| residual.x_m)),
        number(point.residual_m.map(|residual| residual.up_m)),
    ]
}

/// The shortest digits that read back as the same number; empty for none and for what is not finite.
fn number(value: Option<f64>) -> String {
    value
        .filter(|value| value.is_finite())
        .map_or_else(String::new, |value| value.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;

    fn parsed(measurement: &Measurement) -> (Vec<String>, Vec<::csv::StringRecord>) {
        let bytes = points_csv(measurement).unwrap();
        let mut reader = ::csv::Reader::from_reader(bytes.as_slice());
        let header = reader.headers().unwrap().iter().map(str::to_owned).collect();
        (header, reader.records().map(Result::unwrap).collect())
    }

    #[test]
    fn a_row_a_point_and_numbers_read_back_exactly() {
        let measurement = test_measurements::two_bounces();
        let (header, rows) = parsed(&measurement);
        assert_eq!(
            header.join(","),
            "frame,time_s,u_px,v_px,std_px,x_m,z_m,used,arc,reason,off_arc_m,residual_x_m,residual_z_m"
        );
        assert_eq!(rows.len(), measurement.track.points.len());
        for (row, point) in rows.iter().zip(&measurement.track.points) {
            assert_eq!(row[2].parse::<f64>().unwrap(), point.pixel.u_px);
            assert_eq!(row[5].parse::<f64>().unwrap(), point.world.unwrap().x_m);
            match &point.use_ {
                PointUse::Used(arc) => {
                    assert_eq!(
                        (&row[7], &row[8], &row[9], &row[10]),
                        ("true", &*arc.to_string(), "", "")
                    )
                }
                PointUse::Unused(why) => {
                    assert_eq!((&row[7], &row[8], &row[9]), ("false", "", why.code()));
                    assert_eq!(row[10].parse().ok(), why.off_arc_m());
                }
            }
        }
    }

    #[test]
    fn each_point_of_several_launches_says_which() {
        let measurement = test_measurements::three_launches();
        let (header, rows) = parsed(&measurement);
        assert_eq!(header.last().unwrap(), "launch");
        assert_eq!(rows.len(), 3 * measurement.track.points.len());
        let launches: Vec<&str> = rows.iter().map(|row| &row[13]).collect();
        assert!(launches.is_sorted() && launches[0] == "1" && launches[rows.len() - 1] == "3");
    }

    #[test]
    fn a_reason_is_a_code_and_its_number_stands_beside_it() {
        let (_, rows) = parsed(&test_measurements::two_bounces());
        let of = |code: &str| {
            rows.iter()
                .find(|row| &row[9] == code)
                .map(|row| row[10].to_owned())
        };
        assert_eq!(of("contact").as_deref(), Some(""));
        assert!(of("off_arc").unwrap().parse::<f64>().unwrap() > 0.0);
        let code = |row: &::csv::StringRecord| row[9].chars().all(|c| c.is_ascii_lowercase() || c == '_');
        assert!(rows.iter().all(code));
    }

    #[test]
    fn without_a_scale_the_metres_are_empty() {
        let (_, rows) = parsed(&test_measurements::no_scale());
        assert!(rows.iter().all(|row| row[5].is_empty() && row[6].is_empty()));
    }

    #[test]
    fn a_top_view_names_its_second_coordinate_y() {
        let (header, _) = parsed(&test_measurements::top_view());
        assert_eq!((header[6].as_str(), header[12].as_str()), ("y_m", "residual_y_m"));
    }
}
