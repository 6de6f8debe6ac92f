//! `calib.json`, and from a pixel to a metre: the only place where that happens.
