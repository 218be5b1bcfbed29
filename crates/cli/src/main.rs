//! The program `volery`.
fn main() {}
