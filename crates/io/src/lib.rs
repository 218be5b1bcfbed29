//! Files in, files out: volumes, images, scene files, transfer functions.
