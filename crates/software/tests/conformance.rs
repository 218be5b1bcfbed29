//! The suite that every backend passes.

volery_conformance::conformance_tests!(volery_software::SoftwareBackend::new());
