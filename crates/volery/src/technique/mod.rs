//! Techniques: from a scene and its dials to the plain data that a backend executes.

pub mod raycast;
