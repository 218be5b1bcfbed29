//! The suite that every backend passes.

volery_frame::conformance_tests!(volery_software::SoftwareBackend::new());
