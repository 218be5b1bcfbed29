//! Tests, benches and checks of the workspace.
fn main() {}
