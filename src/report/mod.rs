//! The only place that knows the shapes of output files.
