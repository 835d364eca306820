//! What a scene is, in one hash: its tree and the bytes of its files, but not their names, nor how it is written down, nor its
//! cameras, films, integrators and samplers.

use super::assets::{Assets, walk};
use super::params::Ids;
use super::tree::{Kind, Node, Param, Value};
use blake3::Hasher;
use std::collections::BTreeMap;

/// blake3, in hex. XML and JSON of the same scene agree, as do the two dialects of XML; the order of plugins counts,
/// since triangles and materials are numbered by it, the order of properties does not.
pub fn scene(children: &[Param], ids: &Ids, assets: &Assets, unit_scale: f32) -> String {
    let mut numbers = BTreeMap::new();
    walk(children, &mut |node| {
        let number = numbers.len() as u64;
        numbers.insert(node as *const Node, number);
    });
    let tree = Tree { ids, assets, numbers };
    let mut hasher = Hasher::new();
    hasher.update(b"reprobe scene 1");
    hasher.update(&unit_scale.to_bits().to_le_bytes());
    tree.params(&mut hasher, children);
    hasher.finalize().to_hex().to_string()
}

struct Tree<'a> {
    ids: &'a Ids<'a>,
    assets: &'a Assets,
    /// Plugins in file order: a reference counts as the number of what it means.
    numbers: BTreeMap<*const Node, u64>,
}

impl Tree<'_> {
    fn params(&self, hasher: &mut Hasher, params: &[Param]) {
        let is_child = |p: &&Param| matches!(p.value, Value::Plugin(_) | Value::Reference(_));
        let mut properties: Vec<&Param> = params.iter().filter(|p| !is_child(p)).collect();
        properties.sort_by(|a, b| a.name.cmp(&b.name));
        for p in properties {
            text(hasher, &p.name);
            self.property(hasher, &p.value);
        }
        for p in params.iter().filter(is_child) {
            let (node, tag) = match &p.value {
                Value::Plugin(node) => (node, b"plugin"),
                Value::Reference(id) => match self.ids.get(id.as_str()) {
                    Some(node) => (*node, b"shared"),
                    None => continue,
                },
                _ => continue,
            };
            // Where it is seen from and how it is sampled is not the scene: a moved camera spoils no bake.
            if matches!(node.kind, Kind::Sensor | Kind::Film | Kind::Integrator | Kind::Other) {
                continue;
            }
            hasher.update(tag);
            // Only a texture is told by its name; other children by what they are.
            if node.kind == Kind::Texture {
                text(hasher, &p.name);
            }
            if tag == b"shared" {
                hasher.update(&self.numbers.get(&(node as *const Node)).copied().unwrap_or(u64::MAX).to_le_bytes());
            } else {
                text(hasher, &node.plugin);
                self.params(hasher, &node.params);
            }
        }
        hasher.update(b"end");
    }

    fn property(&self, hasher: &mut Hasher, value: &Value) {
        let mut numbers = |tag: u8, list: &[f64]| {
            hasher.update(&[tag, list.len() as u8]);
            list.iter().for_each(|x| {
                // Zero has two signs.
                hasher.update(&(x + 0.0).to_bits().to_le_bytes());
            });
        };
        match value {
            Value::Bool(b) => numbers(0, &[f64::from(u8::from(*b))]),
            Value::Integer(i) => numbers(1, &[*i as f64]),
            Value::Float(x) => numbers(1, &[*x]),
            Value::Uniform(x) => numbers(2, &[*x]),
            Value::Vector(v) => numbers(3, &v.to_array()),
            Value::Color(c) => numbers(4, &c.as_dvec3().to_array()),
            Value::Transform(m) => numbers(5, &m.to_cols_array()),
            Value::Spectrum(pairs) => pairs.iter().for_each(|&(w, v)| numbers(6, &[w, v])),
            Value::Text(t) => text(hasher, t),
            Value::File(f) => {
                hasher.update(self.assets.hash(f).map_or(&[0; 32], |h| h.as_bytes()));
            }
            Value::Plugin(_) | Value::Reference(_) => {}
        }
    }
}

fn text(hasher: &mut Hasher, text: &str) {
    hasher.update(&(text.len() as u64).to_le_bytes());
    hasher.update(text.as_bytes());
}
