//! Executes a frame on a GPU through wgpu.
