// Twin of src/view/gbuffer.rs: pixel.
// What a view sees of a surface: its roughness, the light of its diffuse lobe, the albedo of its glossy ones.

// #include "shared/albedo.wgsl"
// #include "shared/lightmap.wgsl"

// Alpha of the glossy lobe that a view has; negative where it has none.
fn view_alpha(s: Surface, is_front: bool) -> f32 {
    if (material_u32(s.material, MATERIAL_LOBES) & NON_DIFFUSE) != 0u && (is_front || (material_u32(s.material, MATERIAL_FLAGS) & TWO_SIDED_FLAG) != 0u) {
        return bsdf_alpha(s);
    }
    return -1.0;
}

// What the view from direction `wi` (local) sees of both lobes.
struct Factors {
    // Radiance of the diffuse lobe, by the light map. Twin: lightmap::LightMap::diffuse_radiance.
    diffuse: vec3<f32>,
    // Directional albedo of the glossy lobes; 0 where the scale of their roughness is negative.
    albedo: vec3<f32>,
}

fn factors_of(s: Surface, wi: vec3<f32>, roughness_scale: f32) -> Factors {
    let root = material_u32(s.material, MATERIAL_MODEL);
    var sum = Factors(vec3(0.0), vec3(0.0));
    var u = 0.0;
    for (var k = 0u; k < model_u32(root, MODEL_LEAVES); k++) {
        let leaf = leaf_at(root, s, wi, k, &u, ALL_LOBES);
        if leaf.share > 0.0 {
            sum.diffuse += leaf.share * leaf_diffuse_out(leaf);
            if roughness_scale >= 0.0 {
                sum.albedo += leaf.share * leaf_glossy_albedo(leaf.model, leaf.wi, Query(NON_DIFFUSE, roughness_scale));
            }
        }
    }
    if scene.light_width > 0u && any(sum.diffuse != vec3(0.0)) {
        sum.diffuse *= lightmap_lookup(s.triangle, s.barycentric, wi.z < 0.0) * FRAC_1_PI;
    } else {
        sum.diffuse = vec3(0.0);
    }
    return sum;
}

