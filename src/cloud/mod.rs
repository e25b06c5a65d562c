//! The point cloud and the formats in which it leaves.

mod point_cloud;

pub use point_cloud::PointCloud;
