//! Scenes rendered with known truth: a road to the numbers that shares nothing with `detect`, `flight` or `bounce`.
