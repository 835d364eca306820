//! The constants of the shaders and their twins. One that is a shader's own says so behind its declaration: `// Own.`

use crate::base::math;
use crate::gpu::scene;
use crate::gpu::scene::materials::Kind;
use crate::gpu::scene::{lights, materials, textures};
use crate::lightmap::{fill, receivers};
use crate::material::bsdf::{Distribution, Lobes, albedo, microfacet, principled, roughplastic};
use crate::material::surface;
use crate::method::glossy_probes::gpu::{footprint as gpu_footprint, gather as gpu_gather};
use crate::method::glossy_probes::{coverage, filter, footprint, gather_params, perturb, previous, shown};
use crate::method::light_field_probes::{ambient, gpu as gpu_light_field, march, octree, probe, shade, trace};
use crate::method::many_light::{
    adaptive, bounce, descend, disc, emit, follow, gather as many_lights_gather, params as many_light_params,
    shade as many_lights_shade,
};
use crate::method::radiance_probes::{gpu as gpu_radiance_probes, light, seen, shade as shade_of_radiance_probes, volume};
use crate::method::{image_space_gather, ulr};
use crate::probe::{neighbors, parameter_map as qhmap};
use crate::transport::{bvh, light_tree, path, places, sampler, shares};
use crate::view::{denoise, direct, mirror, mirror_light};
use std::f32::consts;
use wgpu::naga::{Expression, Handle, Literal, Module};

/// A number with its type.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Number {
    U32(u32),
    F32(f32),
}

impl From<u32> for Number {
    fn from(n: u32) -> Self {
        Self::U32(n)
    }
}

impl From<usize> for Number {
    fn from(n: usize) -> Self {
        Self::U32(n as u32)
    }
}

impl From<u16> for Number {
    fn from(n: u16) -> Self {
        Self::U32(n.into())
    }
}

impl From<f32> for Number {
    fn from(n: f32) -> Self {
        Self::F32(n)
    }
}

/// Names and values; several numbers are a vector.
macro_rules! twins {
    ($($name:ident = $($value:expr),+;)+) => { vec![$((stringify!($name).to_owned(), vec![$(Number::from($value)),+])),+] };
}

type Twins = Vec<(String, Vec<Number>)>;

/// The twins of a file's constants.
fn twins(file: &str) -> Twins {
    match file {
        "glossy_probes/cover.wgsl" => twins! {
            MIN_NORMAL_COS = shown::MIN_NORMAL_COS;
            DEPTH_TOLERANCE = shown::DEPTH_TOLERANCE;
            SHARP_ALPHA = shown::SHARP_ALPHA;
            REFLECTED_TOLERANCE = shown::REFLECTED_TOLERANCE;
            PERFECT_RAYS = mirror_light::PERFECT.rays;
            GOLDEN_RATIO = coverage::GOLDEN_RATIO;
        },
        "glossy_probes/fill.wgsl" => twins! { DEPTH_TOLERANCE = previous::DEPTH_TOLERANCE; },
        "glossy_probes/footprint.wgsl" => twins! {
            FORESHORTENING_NONE = gpu_footprint::NONE;
            FORESHORTENING_PAPER = gpu_footprint::PAPER;
            FORESHORTENING_DERIVED = gpu_footprint::DERIVED;
            FORESHORTENING_CURVED = gpu_footprint::CURVED;
            BINS = footprint::BINS;
            MAX_ALPHA = footprint::MAX_ALPHA;
            DISTANCES = footprint::DISTANCES[0], footprint::DISTANCES[1];
            MIN_SLANT = footprint::MIN_SLANT;
            MIN_FOCUS = footprint::MIN_FOCUS;
        },
        "glossy_probes/perturb.wgsl" => twins! {
            ORDER_PLANE = gpu_gather::PLANE;
            ORDER_FIRST = gpu_gather::FIRST;
            ORDER_SECOND = gpu_gather::SECOND;
            MIN_COS = perturb::MIN_COS;
            MAX_STEP = perturb::MAX_STEP;
            MIN_DISTANCE = perturb::MIN_DISTANCE;
        },
        "glossy_probes/search.wgsl" => twins! {
            TILE = gather_params::TILE;
            ANCHOR_TOLERANCE = gather_params::ANCHOR_TOLERANCE.0, gather_params::ANCHOR_TOLERANCE.1;
            DERIVATIVE_MIN = qhmap::DERIVATIVE_MIN;
        },
        "glossy_probes/gather.wgsl" => twins! {
            NEAREST = gpu_gather::NEAREST;
            SAME_REFLECTOR = gpu_gather::SAME_REFLECTOR;
        },
        "image_space_gather/gather_image.wgsl" => twins! {
            LOBE_SIGMA = image_space_gather::LOBE_SIGMA;
            REACH = image_space_gather::REACH;
        },
        "light_field_probes/lit_diffuse.wgsl" => twins! {
            LEAST_FACING = ambient::LEAST_FACING;
            LEAST_SEEN = ambient::LEAST_SEEN;
            AMBIENT_WORDS = gpu_light_field::field::AMBIENT_WORDS;
        },
        "light_field_probes/lobe_rays.wgsl" => twins! { LOBE_BRANCH = shade::BRANCHES[2]; },
        "light_field_probes/march.wgsl" => twins! {
            COARSE = march::COARSE;
            SECOND_TOP = march::SECOND_TOP;
            LEAST_COS = probe::LEAST_COS;
            TWO_SCALE = march::Search::TwoScale as u32;
            HI_Z = march::Search::HiZ as u32;
        },
        "light_field_probes/params.wgsl" => twins! {
            DIFFUSE_LIGHT = gpu_light_field::DIFFUSE_LIGHT;
            GLOSSY_LIGHT = gpu_light_field::GLOSSY_LIGHT;
            RAYS = gpu_light_field::RAYS;
        },
        "light_field_probes/places.wgsl" => twins! {
            NO_PROBE = octree::NO_PROBE;
            LEAF = octree::LEAF;
            LEAST_NEAR = ambient::LEAST_NEAR;
            COUNT = neighbors::COUNT;
        },
        "light_field_probes/trace_rays.wgsl" => twins! {
            MOST_PROBES = trace::MOST_PROBES;
            LEAST_LIGHT = probe::LEAST_LIGHT;
        },
        "many_light/bounce.wgsl" => twins! { BOUNCE = bounce::BOUNCE; },
        "many_light/choose_pixels.wgsl" => twins! {
            NORMAL_POWER = adaptive::NORMAL_POWER as f32;
            PLANE = adaptive::PLANE;
            LEAST_WEIGHT = adaptive::LEAST_WEIGHT;
        },
        "many_light/expose.wgsl" => twins! { MIDDLE_GREY = adaptive::MIDDLE_GREY; },
        "many_light/follow_lobes.wgsl" => twins! { RAY = follow::RAY; STRAIGHT = follow::STRAIGHT; },
        "many_light/gather.wgsl" => twins! {
            MOST_SHADOW_RAYS = many_light_params::MOST_SHADOW_RAYS;
            CONE = many_lights_gather::CONE;
            SMALL = many_lights_gather::SMALL;
            DISC_SIZE = disc::SIZE;
            DISC_FAR = disc::FAR;
        },
        "many_light/light_pixels.wgsl" => twins! { PIXEL = many_lights_shade::PIXEL; },
        "many_light/receive.wgsl" => twins! { LOBE_END = descend::LOBE_END; },
        "many_light/reflected.wgsl" => twins! { VIEWS = emit::VIEWS; },
        "path_trace/add_guides.wgsl" => twins! { ENVIRONMENT_DEPTH = denoise::FAR; },
        "path_trace/denoise.wgsl" => twins! { MIN_ALBEDO = denoise::MIN_ALBEDO; },
        "radiance_probes/blockers.wgsl" => twins! { BLOCKER = light::BLOCKER; },
        "radiance_probes/fill_ring.wgsl" => twins! { CORNER = fill::CORNER; },
        "radiance_probes/first_order.wgsl" => twins! {
            DIRECTIONS = shade_of_radiance_probes::DIRECTIONS;
        },
        "radiance_probes/probe_relight.wgsl" => twins! { NO_RECEIVER = seen::NO_RECEIVER; },
        "radiance_probes/receiver_light.wgsl" => twins! {
            POINTS = receivers::POINTS;
            RECEIVER_WORDS = gpu_radiance_probes::RECEIVER_WORDS;
            BACK_BIT = receivers::BACK_BIT;
        },
        "radiance_probes/taps.wgsl" => twins! { VOLUME_NUMBERS = volume::NUMBERS; },
        "radiance_probes/volume.wgsl" => twins! { VOLUME_DIRECTIONS = volume::DIRECTIONS; },
        "shared/albedo.wgsl" => twins! {
            ALBEDO_COSINES = albedo::COSINES;
            ALBEDO_ALPHAS = albedo::ALPHAS;
        },
        "shared/glossy_direct.wgsl" => twins! { GLOSSY_BRANCH = direct::GLOSSY_BRANCH; },
        "shared/outlook.wgsl" => twins! {
            SIDE = shares::SIDE;
            SIDES = places::SIDES;
            BOTH = places::BOTH;
            WHOLE = shares::WHOLE;
            HEADER = lights::OUTLOOK_HEADER;
            SHARES = shares::SHARE_WORDS;
        },
        "shared/light_tree.wgsl" => twins! {
            BACK = light_tree::BACK;
            EVEN = light_tree::EVEN;
            WIDTH = light_tree::WIDTH;
            LEAF = light_tree::LEAF;
        },
        "shared/math.wgsl" => twins! {
            PI = consts::PI;
            TAU = consts::TAU;
            FRAC_1_PI = consts::FRAC_1_PI;
            FAR = f32::MAX;
            EPSILON = 0.5 * f32::EPSILON;
            MIN_POSITIVE = f32::MIN_POSITIVE;
        },
        "shared/microfacet.wgsl" => twins! {
            ALPHA_MIN = microfacet::ALPHA_MIN;
            BECKMANN = materials::family(Distribution::Beckmann);
            GGX = materials::family(Distribution::Ggx);
            FRAC_1_SQRT_PI = microfacet::FRAC_1_SQRT_PI;
        },
        "shared/models.wgsl" => twins! {
            DIFFUSE_MODEL = Kind::Diffuse as u32;
            PLASTIC = Kind::Plastic as u32;
            ROUGH_PLASTIC = Kind::RoughPlastic as u32;
            CONDUCTOR = Kind::Conductor as u32;
            ROUGH_CONDUCTOR = Kind::RoughConductor as u32;
            DIELECTRIC = Kind::Dielectric as u32;
            THIN_DIELECTRIC = Kind::ThinDielectric as u32;
            ROUGH_DIELECTRIC = Kind::RoughDielectric as u32;
            PRINCIPLED = Kind::Principled as u32;
            TWO_SIDED = Kind::TwoSided as u32;
            BUMP_MAP = Kind::BumpMap as u32;
            NORMAL_MAP = Kind::NormalMap as u32;
            BLEND = Kind::Blend as u32;
            PLASTIC_COSINES = roughplastic::COSINES;
            DIFFUSE = u32::from(Lobes::DIFFUSE.bits());
            NON_DIFFUSE = u32::from(Lobes::NON_DIFFUSE.bits());
            ALL_LOBES = u32::from(Lobes::ALL.bits());
        },
        "shared/path.wgsl" => twins! {
            ROULETTE_CAP = path::ROULETTE_CAP;
            ROULETTE_MERCY = path::ROULETTE_MERCY;
        },
        "shared/principled.wgsl" => twins! {
            SPECULAR_ALPHA_MIN = principled::SPECULAR_ALPHA_MIN;
            CLEARCOAT_STRENGTH = principled::CLEARCOAT_STRENGTH;
            CLEARCOAT_SHADOWING_ALPHA = principled::CLEARCOAT_SHADOWING_ALPHA;
            CLEARCOAT_F0 = principled::CLEARCOAT_F0;
        },
        "shared/random.wgsl" => twins! {
            GOLDEN = math::GOLDEN as u32, (math::GOLDEN >> 32) as u32;
            SOBOL_SETS = sampler::SOBOL_SETS;
        },
        "shared/scene.wgsl" => of_the_scene(),
        "shared/surface.wgsl" => twins! {
            NO_TRIANGLE = crate::gpu::rays::NO_TRIANGLE;
            OFFSET_ULPS = surface::OFFSET_ULPS.0, surface::OFFSET_ULPS.1;
            SHADOW_GAP = surface::SHADOW_GAP;
        },
        "shared/traverse.wgsl" => twins! {
            STACK = scene::STACK;
            SHEET = bvh::SHEET;
        },
        "shared/view.wgsl" => twins! {
            NOT_GLOSSY = filter::NOT_GLOSSY;
            SKY = mirror::SKY;
            NOTHING = mirror::NOTHING;
        },
        "ulr/ulr.wgsl" => twins! { MIN_PENALTY = ulr::MIN_PENALTY; },
        "ulr/ulr_look.wgsl" => twins! { MAX_SPREAD = ulr::MAX_SPREAD; },
        _ => Vec::new(),
    }
}

/// The scene's numbers of kinds, and the places of its records' members, from the Rust types.
fn of_the_scene() -> Twins {
    let mut list = twins! {
        NONE = scene::NONE;
        CONSTANT = textures::CONSTANT;
        BITMAP = textures::BITMAP;
        CHECKERBOARD = textures::CHECKERBOARD;
        CHECKERED = textures::CHECKERED;
        REPEAT = textures::REPEAT;
        MIRROR = textures::MIRROR;
        CLAMP = textures::CLAMP;
        TRANSMISSIVE = materials::TRANSMISSIVE;
        TWO_SIDED_FLAG = materials::TWO_SIDED_FLAG;
        AREA = lights::AREA;
        POINT = lights::POINT;
        SPOT = lights::SPOT;
        DIRECTIONAL = lights::DIRECTIONAL;
        AT_INFINITY = lights::AT_INFINITY;
    };
    for record in scene::RECORDS {
        let named = |member: &str| format!("{}_{}", record.name, member.to_uppercase());
        list.push((named("rows"), vec![record.size.div_ceil(16).into()]));
        list.extend(record.fields.iter().map(|(member, offset)| (named(member), vec![(offset / 4).into()])));
    }
    list
}

/// The numbers of a constant expression.
fn numbers(module: &Module, expression: Handle<Expression>) -> Option<Vec<Number>> {
    match &module.global_expressions[expression] {
        Expression::Literal(Literal::F32(n)) => Some(vec![Number::F32(*n)]),
        Expression::Literal(Literal::U32(n)) => Some(vec![Number::U32(*n)]),
        Expression::Compose { components, .. } => {
            components.iter().map(|part| numbers(module, *part)).collect::<Option<Vec<_>>>().map(|list| list.concat())
        }
        _ => None,
    }
}

/// Constants of a file that are not their twins, or have none without saying so; and twins without a constant.
pub(crate) fn check_constants(file: &str, text: &str, module: &Module) -> Vec<String> {
    let mut left = twins(file);
    let mut found = Vec::new();
    for line in text.lines().filter(|line| line.starts_with("const ")) {
        let name: String = line["const ".len()..].chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let is_own = line.ends_with("// Own.");
        let twin = left.iter().position(|(twin, _)| *twin == name).map(|i| left.swap_remove(i).1);
        match (twin, is_own) {
            (Some(_), true) => found.push(format!("{file}: {name} has a twin, but says that it has none")),
            (None, false) => found.push(format!("{file}: {name} has no twin in constants.rs, nor \"// Own.\" behind it")),
            (None, true) => {}
            (Some(twin), false) => {
                let constant = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name.as_str()));
                let value = constant.and_then(|(_, c)| numbers(module, c.init));
                if value.as_ref() != Some(&twin) {
                    found.push(format!("{file}: {name} is {value:?}, in Rust {twin:?}"));
                }
            }
        }
    }
    found.extend(left.iter().map(|(name, _)| format!("{file}: no constant {name}, which constants.rs has")));
    found
}
