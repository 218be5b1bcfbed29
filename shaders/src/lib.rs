//! WGSL of Volery, validated and reflected by naga when it is built.
