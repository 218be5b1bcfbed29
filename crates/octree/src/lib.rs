//! The octree over a voxel pyramid: selection filters, cuts, visibility order.
