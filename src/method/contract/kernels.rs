//! All kernels.

use crate::gpu::spec::KernelSpec;
use crate::gpu::view::{composite, direct, gbuffer, mirror, mirror_light};
use crate::gpu::{follow, rays};
use crate::method::glossy_probes::gpu::{coverage, fill, filter, footprint, gather};
use crate::method::image_space_gather::gpu as image_space_gather;
use crate::method::light_field_probes::gpu as light_field_probes;
use crate::method::lightmap_rt::gpu as lightmap_rt;
use crate::method::many_light::gpu::{lights as many_lights, pixels as many_light_pixels};
use crate::method::path_trace::{denoise_gpu as denoise, gpu as path_trace};
use crate::method::radiance_probes::gpu::{self as radiance_probes, added, clusters, first_order, light_map, operator};
use crate::method::ulr::gpu as ulr;

/// The records of all kernels. A file of shaders/ that none of them needs fails the test.
pub(crate) const KERNELS: &[&KernelSpec] = &[
    &added::ADDED_LIGHT,
    &added::BLOCKERS,
    &added::BLOCKER_RADIANCE,
    &fill::FILL,
    &composite::LAYERS,
    &coverage::COVER,
    &denoise::ADD_GUIDES,
    &denoise::DENOISE_END,
    &denoise::DENOISE_START,
    &denoise::DESPECKLE,
    &denoise::SMOOTH_LEVEL,
    &denoise::WITH_VARIANCE,
    &direct::DIRECT_LIGHT,
    &filter::FILTER_END,
    &filter::FILTER_PASS,
    &filter::FILTER_START,
    &follow::FOLLOW,
    &footprint::FOOTPRINT,
    &gather::FIND_ANCHORS,
    &gather::GATHER,
    &gbuffer::GBUFFER,
    &gbuffer::VIEW_FACTORS,
    &image_space_gather::GATHER_IMAGE,
    &light_field_probes::ADD_GLOSSY,
    &light_field_probes::DIRECT_STARTS,
    &light_field_probes::LIT_DIFFUSE,
    &light_field_probes::LOBE_RAYS,
    &light_field_probes::TRACE_RAYS,
    &lightmap_rt::MEAN_LIGHT,
    &lightmap_rt::VIEW_STARTS,
    &many_light_pixels::CHOOSE_PIXELS,
    &many_light_pixels::EXPOSE,
    &many_light_pixels::FOLLOW_LOBES,
    &many_light_pixels::LIGHT_PIXELS,
    &many_light_pixels::TALLY,
    &many_light_pixels::VIEW_LAYERS,
    &many_lights::ADD_UP,
    &many_lights::BOUNCE,
    &many_lights::FILTER_NODES,
    &many_lights::SAMPLE_LIGHTS,
    &first_order::FIRST_ORDER,
    &light_map::FILL_RING,
    &light_map::MAP_LIGHT,
    &mirror::MIRROR_PASS,
    &mirror_light::MIRROR_LIGHT,
    &clusters::CLUSTER_PROJECTION,
    &clusters::RECONSTRUCT,
    &operator::PROBE_RELIGHT,
    &operator::RECEIVER_RADIANCE,
    &path_trace::ADD_SAMPLES,
    &path_trace::CAMERA_HITS,
    &radiance_probes::RECEIVER_LIGHT,
    &rays::CLOSEST,
    &ulr::ULR_BLEND,
    &ulr::ULR_LOOK,
];
