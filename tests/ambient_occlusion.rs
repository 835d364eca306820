//! `bake-lightmap --ao` against a closed form, and what takes such a map.

mod folder;

use folder::Folder;
use glam::{Vec2, Vec3};
use reprobe::exchange::load;
use reprobe::lightmap::LightMap;
use reprobe::scene::Scene;
use std::f32::consts::PI;

/// A floor at y = 0 of which a high wall at x = 0 hides what lies behind it.
const SCENE: &str = r#"<scene version="3.0.0">
<shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-90"/></transform></shape>
<shape type="rectangle"><bsdf type="twosided"><bsdf type="diffuse"/></bsdf><transform name="to_world"><scale value="4"/><rotate y="1" angle="90"/></transform></shape>
</scene>"#;
const REACH: f32 = 1.5;

/// What a map says at a point of the floor.
fn floor_at(scene: &Scene, map: &LightMap, x: f32, z: f32) -> f32 {
    for triangle in scene.geometry.objects[0].triangles.clone() {
        let [a, b, c] = scene.geometry.corners(triangle);
        let (e, f, p) = (b - a, c - a, Vec3::new(x, 0.0, z) - a);
        let area = e.cross(f).dot(Vec3::Y);
        let weights = Vec2::new(p.cross(f).dot(Vec3::Y), e.cross(p).dot(Vec3::Y)) / area;
        if weights.min_element() >= 0.0 && weights.element_sum() <= 1.0 {
            return map.lookup(triangle, weights, false).x;
        }
    }
    panic!("({x}, {z}) is not on the floor");
}

/// The cosine-weighted share of directions in which a wall at `x` is not met within the reach: those of half a cone about the wall's normal.
fn open(x: f32) -> f32 {
    let angle = (x / REACH).min(1.0).acos();
    1.0 - (angle - angle.sin() * angle.cos()) / PI
}

#[test]
fn a_wall_hides_half_a_cone_of_the_floor_s_sky() {
    assert!((open(0.0) - 0.5).abs() < 1e-6 && open(REACH) == 1.0);
    const SAMPLES: usize = 64;
    let f = Folder::with(SCENE, "{}");
    f.success(&format!("bake-lightmap scene.xml --ao={REACH} --texel 0.1 --spp {SAMPLES} -o ao.exr"));
    let scene = load(&f.at("scene.xml"), &Default::default()).unwrap();
    let map = LightMap::load_openness(&f.at("ao.exr"), &scene).unwrap();
    for x in [0.1, 0.2, 0.4, 0.7, 1.0, 1.2, 1.4, 1.6, 3.0] {
        for side in [1.0, -1.0] {
            // A row of texels along the wall, far from its ends.
            let row: Vec<f32> = (-24..24).map(|i| floor_at(&scene, &map, side * x, 0.1 * i as f32)).collect();
            let (found, expected) = (row.iter().sum::<f32>() / row.len() as f32, open(x));
            let noise = (expected * (1.0 - expected) / (row.len() * SAMPLES) as f32).sqrt();
            assert!((found - expected).abs() < 4.0 * noise + 2e-3, "{x}: {found}, expected {expected} within {noise}");
        }
    }
}

#[test]
fn an_occlusion_map_is_exported_and_is_no_light() {
    let f = Folder::with(SCENE, r#"{"fov": 60, "size": [16, 9], "frames": [{"origin": [2, 2, 2], "target": [0, 0, 0]}]}"#);
    f.success("bake-lightmap scene.xml --ao --texels 900 --spp 16 -o ao.exr");
    f.success("bake-lightmap scene.xml --ao --texels 900 --spp 16 -o parts.exr --shard 0/1 --threads 1");
    assert!(std::fs::read(f.at("ao.exr")).unwrap() == std::fs::read(f.at("parts.exr")).unwrap());
    f.success("export-gltf scene.xml --ao ao.exr -o scene.glb");
    let glb = String::from_utf8_lossy(&std::fs::read(f.at("scene.glb")).unwrap()).into_owned();
    assert!(glb.contains("occlusionTexture") && glb.contains("ambient occlusion") && !glb.contains("MX_lightmap"));

    f.success("bake-lightmap scene.xml --texels 300 --spp 4 -o other.exr");
    assert!(f.refusal("export-gltf scene.xml --lightmap other.exr --ao ao.exr -o both.glb").contains("same --texels"));
    assert!(f.refusal("export-gltf scene.xml --ao other.exr -o both.glb").contains("ao"));
    let message = f.refusal("render-path scene.xml --path path.json --method lightmap-rt --lightmap ao.exr -o frames");
    assert!(message.contains("ambient occlusion"), "{message}");
    assert!(f.refusal("bake-lightmap scene.xml --ao=0 -o none.exr").contains("--ao"));
    assert!(f.refusal("bake-lightmap scene.xml --ao --first-spp 4 -o none.exr").contains("--first-spp"));
}
