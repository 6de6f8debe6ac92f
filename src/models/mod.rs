//! The relations of Domenech 2005 (see `physics`): pure functions.
