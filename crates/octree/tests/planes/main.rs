//! Cutting planes: filters, sections, blending, certified cuts; and one plane dragged through a volume.

mod blend;
mod certify;
mod drag;
mod field;
mod filters;
mod seams;
mod section;
#[path = "../world/mod.rs"]
mod world;
