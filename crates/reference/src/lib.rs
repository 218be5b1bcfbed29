//! The truth in f64, straight from the samples; and image metrics.
