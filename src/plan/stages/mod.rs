//! The stages, a file each: options, checks, reading, the call, writing, and what is told of it.

mod bake_lightfield;
mod bake_lightmap;
mod bake_probes;
mod bake_transport;
mod compare;
mod curvature;
mod export_gltf;
pub mod export_probes;
mod inspect_lightfield;
mod inspect_transport;
mod place_probes;
mod qhmap;
mod relight;
mod render_path;
mod resmap;
mod set;
mod video;
mod view;

pub use bake_lightfield::BakeLightfield;
pub use bake_lightmap::{AO_DISTANCE, BakeLightmap};
pub use bake_probes::BakeProbes;
pub use bake_transport::BakeTransport;
pub use compare::{Compare, frame_names, read_pair, read_second};
pub use curvature::Curvature;
pub use export_gltf::ExportGltf;
pub use export_probes::{ExportProbes, Format};
pub use inspect_lightfield::InspectLightfield;
pub use inspect_transport::InspectTransport;
pub use place_probes::PlaceProbes;
pub use qhmap::Qhmap;
pub use relight::Relight;
pub use render_path::{Aov, RenderPath};
pub use resmap::Resmap;
pub use video::Video;
pub use view::View;
