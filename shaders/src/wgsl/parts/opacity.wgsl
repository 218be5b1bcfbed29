// The share of light that matter takes.

// Nothing is seen through a greater depth.
const OPAQUE_DEPTH: f32 = 100.0;
// Up to this depth, opacity is summed from its series.
const SERIES_DEPTH: f32 = 0.25;

// 1 - exp(-depth). The series ends where its next term is 5e-8 of the sum; beyond, a difference loses 1e-6 at most.
fn opacity_of(depth: f32) -> f32 {
    let d = depth;
    let thin = d * (1.0 - d / 2.0 * (1.0 - d / 3.0 * (1.0 - d / 4.0 * (1.0 - d / 5.0 * (1.0 - d / 6.0)))));
    return select(1.0 - exp(-d), thin, abs(d) < SERIES_DEPTH);
}
