//! Values in the form of `calib.json`.

use crate::geometry::PixelPoint;
use nalgebra::Matrix3;
use serde_json::{Map, Value, json};

/// An object of those entries that have a value, in their order.
pub(super) fn object<const N: usize>(entries: [(&str, Option<Value>); N]) -> Value {
    let given = entries
        .into_iter()
        .filter_map(|(key, value)| Some((key.to_owned(), value?)));
    Value::Object(given.collect::<Map<_, _>>())
}

/// [u, v].
pub(super) fn point(p: PixelPoint) -> Value {
    json!([p.u_px, p.v_px])
}

/// A matrix row by row.
pub(super) fn rows(m: &Matrix3<f64>) -> Value {
    let row = |i: usize| [m[(i, 0)], m[(i, 1)], m[(i, 2)]];
    json!([row(0), row(1), row(2)])
}

/// A matrix as messages quote it.
pub(super) fn rows_text(m: &Matrix3<f64>) -> String {
    let row = |i: usize| format!("[{}, {}, {}]", m[(i, 0)], m[(i, 1)], m[(i, 2)]);
    format!("[{}, {}, {}]", row(0), row(1), row(2))
}
