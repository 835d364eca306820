//! Small worlds built by hand.

use glam::{Vec2, Vec3};
use reprobe::base::math::Rgb;
use reprobe::material::bsdf::{Bsdf, TwoSided};
use reprobe::material::{Material, Texture};
use reprobe::scene::{Emitter, Object, Scene};
use reprobe::transport::World;
use std::sync::Arc;

/// A scene under construction.
#[derive(Default)]
pub struct Room {
    scene: Scene,
}

/// Adds a second side to a model.
pub fn two_sided(bsdf: Bsdf) -> Bsdf {
    Bsdf::TwoSided(TwoSided { front: Box::new(bsdf.clone()), back: Box::new(bsdf) })
}

impl Room {
    /// An object of quadrilaterals (centre, half edges x and y; the front is where x × y points). Returns its index.
    fn quads(&mut self, quads: &[[Vec3; 3]], bsdf: Bsdf) -> u32 {
        let g = Arc::make_mut(&mut self.scene.geometry);
        let (index, first_triangle, first_vertex) = (g.objects.len() as u32, g.triangles.len() as u32, g.positions.len() as u32);
        for &[centre, x, y] in quads {
            let base = g.positions.len() as u32;
            g.positions.extend([centre - x - y, centre + x - y, centre + x + y, centre - x + y]);
            g.normals.extend([x.cross(y).normalize(); 4]);
            g.uvs.extend([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
            g.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
            g.triangle_object.extend([index; 2]);
        }
        g.objects.push(Object {
            name: format!("object {index}"),
            triangles: first_triangle..g.triangles.len() as u32,
            vertices: first_vertex..g.positions.len() as u32,
            material: self.scene.materials.len() as u32,
            emitter: None,
            face_normals: false,
            has_uvs: true,
        });
        self.scene.materials.push(Material { name: format!("material {index}"), bsdf, opacity: None });
        index
    }

    /// A rectangle about `centre` with half edges `x` and `y`, whose front is where x × y points. Returns its object.
    pub fn rectangle(&mut self, centre: Vec3, x: Vec3, y: Vec3, bsdf: Bsdf) -> u32 {
        self.quads(&[[centre, x, y]], bsdf)
    }

    /// The inside of a box. Returns its object.
    pub fn inward_box(&mut self, lower: Vec3, upper: Vec3, bsdf: Bsdf) -> u32 {
        let (centre, half) = ((lower + upper) * 0.5, (upper - lower) * 0.5);
        let (x, y, z) = (Vec3::X * half.x, Vec3::Y * half.y, Vec3::Z * half.z);
        // The normal of a face, first × second, points to the centre.
        let faces = [[x, z, y], [-x, y, z], [y, x, z], [-y, z, x], [z, y, x], [-z, x, y]];
        self.quads(&faces.map(|[out, a, b]| [centre + out, a, b]), bsdf)
    }

    /// Makes an object shine.
    pub fn emit(&mut self, object: u32, radiance: Rgb) {
        let emitter = self.scene.emitters.len() as u32;
        self.scene.geometry_mut().objects[object as usize].emitter = Some(emitter);
        self.scene.emitters.push(Emitter::Area { object, radiance: Texture::Constant(radiance) });
    }

    /// Adds any other emitter.
    pub fn light(&mut self, emitter: Emitter) {
        self.scene.emitters.push(emitter);
    }

    /// The finished world.
    pub fn world(self) -> World {
        World::new(self.scene)
    }
}
