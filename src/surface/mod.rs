//! What the reprojection knows about a reflector's shape: principal curvatures (§4.3) and the paraboloid they span (§5.1).
//!
//! A [`WeldedMesh`](weld::WeldedMesh) undoes the seams of one object, [`tessellate`] refines it where it is flat and coarse,
//! [`meyer`] estimates curvature at each vertex, [`curvature`] regularises and hands it back to the scene's own vertices.

pub mod curvature;
pub mod curvature_file;
pub mod meyer;
pub mod paraboloid;
pub mod tessellate;
pub mod weld;

pub use curvature::{CurvatureMap, CurvatureParams, curvature};
pub use paraboloid::Curvature;
