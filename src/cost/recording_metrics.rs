//! What whole recordings are judged by: the quantities whose errors are compared, and the work that they cost.

use super::study::Metric;

/// What is compared with the truth: of the first bounce, and the distances.
pub const QUANTITIES: [Metric; 6] = [
    Metric {
        name: "restitution",
        words: "rms error of e",
        unit: "",
    },
    Metric {
        name: "friction",
        words: "rms error of μ",
        unit: "",
    },
    Metric {
        name: "incident_angle_deg",
        words: "rms error of the incident angle",
        unit: "°",
    },
    Metric {
        name: "rebound_angle_deg",
        words: "rms error of the rebound angle",
        unit: "°",
    },
    Metric {
        name: "x0_m",
        words: "rms error of x0",
        unit: "m",
    },
    Metric {
        name: "x_m",
        words: "rms error of x",
        unit: "m",
    },
];

/// Time of a whole measurement, decoding included.
pub const SECONDS: Metric = Metric {
    name: "measure_s",
    words: "time a recording",
    unit: "s",
};
/// Time of decoding alone.
pub const DECODING: Metric = Metric {
    name: "decode_s",
    words: "decoding a recording",
    unit: "s",
};
/// Illuminance at the ball.
pub const LIGHT: Metric = Metric {
    name: "light_lx",
    words: "light at f/2, ISO 800",
    unit: "lx",
};
/// Size of the file.
pub const STORAGE: Metric = Metric {
    name: "storage_mb",
    words: "storage a recording",
    unit: "MB",
};
/// Quality of the codec: less is better, and larger. Not a work, but what a lab sets.
pub const CRF: Metric = Metric {
    name: "crf",
    words: "H.264 constant rate factor",
    unit: "",
};
/// Size of the picture.
pub const PICTURE: Metric = Metric {
    name: "picture_px",
    words: "width of the picture",
    unit: "px",
};
