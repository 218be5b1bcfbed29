//! Executes a frame on the CPU: all cores, SIMD, no driver.
