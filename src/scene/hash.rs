//! What a scene is, in one hash: its triangles, materials and emitters as they were built, whatever file they came from.
//!
//! Names, cameras, films, integrators and light maps' texture coordinates stay out of it: a moved camera spoils no bake. Triangles, materials and emitters are numbered in the
//! order of the file, so their order counts.

use super::Scene;
use crate::{Error, Result};
use blake3::Hasher;
use bytemuck::cast_slice;
use std::io::{BufWriter, Write};

/// blake3, in hex.
///
/// # Errors
/// None that a scene is known to lead to: its parts have a serial form.
pub fn content(scene: &Scene) -> Result<String> {
    let mut hasher = Hasher::new();
    hasher.update(b"reprobe scene 2");
    let g = &scene.geometry;
    let arrays: [&[u8]; 4] = [cast_slice(&g.positions), cast_slice(&g.normals), cast_slice(&g.uvs), cast_slice(&g.triangles)];
    for bytes in arrays {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    }
    let rest = (&g.objects, &g.rounds, &scene.materials, &scene.emitters);
    let written = postcard::to_io(&rest, BufWriter::new(&mut hasher)).map_err(|e| e.to_string());
    let flushed = written.and_then(|mut writer| writer.flush().map_err(|e| e.to_string()));
    flushed.map_err(|e| Error::input(&scene.path, format!("its content cannot be hashed: {e}")))?;
    Ok(hasher.finalize().to_hex().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;
    use crate::material::bsdf::{Bsdf, Diffuse};
    use crate::material::image::Image;
    use crate::material::opacity::Opacity;
    use crate::material::texture::{Bitmap, Wrap};
    use crate::material::{Material, Texture};
    use crate::scene::mesh::append;
    use crate::scene::{Camera, Emitter, primitives};
    use glam::{Affine2, Mat4, Vec2, Vec3};
    use std::sync::Arc;

    fn scene(pixel: f32) -> Scene {
        let mut scene = Scene::default();
        append(scene.geometry_mut(), primitives::cube(), Mat4::IDENTITY, false, false, "cube".into(), 0, None);
        let image = Arc::new(Image::new(1, 2, vec![Rgb::ONE, Rgb::splat(pixel)]));
        let bitmap = Bitmap { image, to_uv: Affine2::IDENTITY, nearest: false, wrap: Wrap::Repeat, scale: 1.0 };
        let bsdf = Bsdf::Diffuse(Diffuse { reflectance: Texture::Bitmap(bitmap) });
        scene.materials.push(Material { name: "paint".into(), bsdf, opacity: None });
        scene.emitters.push(Emitter::Point { position: Vec3::Y, intensity: Rgb::ONE });
        scene
    }

    #[test]
    fn what_is_seen_counts_and_names_and_cameras_do_not() {
        let hash = |change: &dyn Fn(&mut Scene)| {
            let mut scene = scene(0.5);
            change(&mut scene);
            content(&scene).unwrap()
        };
        let same = hash(&|_| ());
        assert_eq!(same.len(), 64);
        for alike in [
            hash(&|s| s.materials[0].name = "other".into()),
            hash(&|s| s.geometry_mut().objects[0].name = "other".into()),
            hash(&|s| s.sensor = Some(Camera::look_at(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0, [4, 4]))),
            hash(&|s| s.path = "elsewhere.xml".into()),
            hash(&|s| s.geometry_mut().set_last_light_uvs(vec![Vec2::ONE; 24])),
        ] {
            assert_eq!(alike, same);
        }
        let others = [
            content(&scene(0.25)).unwrap(),
            hash(&|s| s.geometry_mut().positions[0].x += 1e-6),
            hash(&|s| s.geometry_mut().normals[3] = -s.geometry.normals[3]),
            hash(&|s| s.geometry_mut().uvs[5].y += 0.5),
            hash(&|s| s.geometry_mut().triangles.swap(0, 1)),
            hash(&|s| s.geometry_mut().objects[0].face_normals = true),
            hash(&|s| s.emitters.push(Emitter::Constant { radiance: Rgb::ONE })),
            hash(&|s| s.materials[0].opacity = Some(Opacity::constant(0.5))),
        ];
        for (i, other) in others.iter().enumerate() {
            assert!(*other != same && !others[..i].contains(other), "change {i}");
        }
    }
}
