//! A scene that renders and measures in a second, for tests of the command line.

/// In a small picture.
pub const SCENE: &str = r#"{"schema": "track.scene/1", "seed": 7,
    "ball": {"radius_m": 0.02, "mass_kg": 0.2, "inertia_factor": 0.4},
    "contact": {"model": "mu_e", "restitution": 0.78, "friction": 0.07},
    "launch": {"drop_height_m": 0.2, "speed_m_s": 1.2},
    "camera": {"image_size_px": [320, 240], "frame_rate_hz": 120, "exposure_s": 0.0005,
               "metres_per_pixel": 0.0025, "origin_px": [20, 220], "noise_grey": 2},
    "stop": {"bounces": 2, "tail_s": 0.1}}"#;
