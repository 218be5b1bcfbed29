//! What the backend needs of a device, and what it makes use of.

use crate::adapter::OpenError;

/// The features that make pictures better where a device has them: times of parts, 16-bit texels in 16 bits, and cubes
/// and sheets blended in 32 bits. None is needed.
pub const USEFUL_FEATURES: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY
    .union(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM)
    .union(wgpu::Features::FLOAT32_BLENDABLE);

/// The limits that a device must have been opened with, or better ones. More than
/// [`wgpu::Limits::downlevel_defaults`] is needed of storage buffers only; larger textures and buffers hold more bricks.
pub fn needed_limits() -> wgpu::Limits {
    wgpu::Limits { max_storage_buffers_per_shader_stage: 6, ..wgpu::Limits::downlevel_defaults() }
}

/// Whether a device is good enough.
pub(crate) fn check(name: &str, limits: &wgpu::Limits) -> Result<(), OpenError> {
    let mut result = Ok(());
    needed_limits().check_limits_with_fail_fn(limits, true, |limit, expected, found| {
        result = Err(OpenError::Limit { name: name.to_owned(), limit, found, expected });
    });
    result
}

#[cfg(test)]
mod tests {
    use volery_shaders::{
        Binding, BindingKind, Stages, cubes, finish, gather, plane, present, raycast, sheets, surfaces,
    };

    use super::*;

    /// The shaders' reflection knows what is bound.
    #[test]
    fn what_shaders_bind_is_within_what_is_needed() {
        let shaders: [&[Binding]; 8] = [
            raycast::BINDINGS,
            plane::BINDINGS,
            cubes::BINDINGS,
            sheets::BINDINGS,
            surfaces::BINDINGS,
            gather::BINDINGS,
            finish::BINDINGS,
            present::BINDINGS,
        ];
        assert_eq!(shaders.len(), volery_shaders::ALL.len(), "every shader");
        let most = |is_counted: fn(&BindingKind) -> bool| {
            let stages: [fn(Stages) -> bool; 3] = [|s| s.vertex, |s| s.fragment, |s| s.compute];
            let counts = shaders.iter().flat_map(|bindings| {
                stages.map(|stage| {
                    bindings.iter().filter(|b| stage(b.stages) && is_counted(&b.kind)).count() as u32
                })
            });
            counts.max().unwrap_or(0)
        };
        let needed = needed_limits();
        let storage = most(|kind| matches!(kind, BindingKind::Storage { .. }));
        let textures = most(|kind| matches!(kind, BindingKind::Texture { .. }));
        let uniforms = most(|kind| matches!(kind, BindingKind::Uniform { .. }));
        println!("{storage} storage buffers, {textures} textures, {uniforms} uniform buffers in a stage");
        assert_eq!(
            storage, needed.max_storage_buffers_per_shader_stage,
            "no more is asked for than is bound"
        );
        assert!(textures <= needed.max_sampled_textures_per_shader_stage);
        assert!(uniforms <= needed.max_uniform_buffers_per_shader_stage);
        for size in
            [raycast::MAIN_WORKGROUP, plane::MAIN_WORKGROUP, gather::MAIN_WORKGROUP, finish::MAIN_WORKGROUP]
        {
            assert!(size.iter().product::<u32>() <= needed.max_compute_invocations_per_workgroup, "{size:?}");
        }
    }

    #[test]
    fn a_device_with_too_little_is_named() {
        assert_eq!(check("good", &wgpu::Limits::default()), Ok(()));
        let limits = wgpu::Limits { max_storage_buffers_per_shader_stage: 5, ..wgpu::Limits::default() };
        let error = check("weak", &limits).unwrap_err();
        let expected = "device weak: limit max_storage_buffers_per_shader_stage is 5, expected at least 6";
        assert_eq!(error.to_string(), expected);
    }
}
