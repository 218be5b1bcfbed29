//! Hard cases, a module per family.

#![allow(clippy::unwrap_used, reason = "what cannot be set up has failed")]

/// Makes tests `NAME::software` and `NAME::wgpu` of each `fn NAME(choice: BackendChoice, test: &str)`.
macro_rules! by_both_backends {
    ($($name:ident)+) => {
        $(mod $name {
            use volery::BackendChoice::{Software, Wgpu};

            #[test]
            fn software() {
                super::$name(Software, concat!(stringify!($name), " by software"));
            }

            #[test]
            fn wgpu() {
                super::$name(Wgpu, concat!(stringify!($name), " by wgpu"));
            }
        })+
    };
}

mod compositing;
mod convergence;
mod fans;
mod files;
mod grid_truth;
mod grids;
mod grids_peers;
mod memory;
mod meshes;
mod opacity;
mod orientation;
mod peers;
mod planes;
mod rays;
mod sections;
mod sessions;
mod stack_files;
mod trees;
