//! The reference is what everything else is judged by; here it is judged itself, by closed forms and by
//! marches too slow and too simple to be wrong. Every check prints its error and its threshold
//! (`cargo test -- --nocapture`).

mod against_marching;
mod cells;
mod closed_forms;
mod collapsed;
mod extremes;
mod grids;
mod opacity;
mod planes;
mod requests;
mod slow;
mod surfaces;
