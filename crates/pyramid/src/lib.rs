//! Voxel pyramids: levels, bricks, and exact statistics of every node.
