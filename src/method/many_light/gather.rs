//! Light at a point: a traversal of the nodes by solid angle (§2.2), and what each sends there (Eq. 2).
//!
//! *Paper*: a node's solid angle is that of a distant patch with the area of all its lights, and of a disc where it is near. *Ours*: what decides
//! whether to go on to its children leaves out the patch's cosine, which is that of the mean of its normals and bounds nothing; what light is
//! multiplied with has it, by the mean normal as short as it is, so that a far cluster sends what all its lights would.

use super::arrival::{Arrival, Received};
use super::cuts::Forest;
use super::descend::{Descent, Receiver};
use super::disc;
use super::emit::Emission;
use super::lobe::Lobe;
use super::params::{Kernel, MOST_LOBES, MOST_SHADOW_RAYS, ManyLightParams};
use super::tree::Tree;
use crate::base::math::{Basis, Rgb, hash64, unit};
use crate::material::bsdf::warp::direction;
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Directions within a spherical light's cone.
pub(crate) const CONE: u32 = 8;
/// Solid angle below which a spherical light is a point.
pub(crate) const SMALL: f32 = 1e-3;

/// A cluster and the light that it sends out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Mean position.
    pub(super) p: Vec3,
    /// Area of all its lights.
    pub(super) area: f32,
    /// Mean normal, as short as they differ.
    pub(super) n: Vec3,
    /// Where a traversal goes on that takes it as a whole.
    pub(super) skip: u32,
    /// Where a traversal goes on to its children.
    pub(super) descent: Descent,
    /// Mean diffuse radiance.
    pub(super) diffuse: Rgb,
    /// Mean glossy radiance; the first lobe of a mixture.
    pub(super) lobe: Lobe,
    /// Its lights in the tree's order: the first, and how many.
    pub lights: [u32; 2],
}

/// The light of a frame, ready to be gathered.
pub struct Gather {
    pub(super) nodes: Vec<Node>,
    /// Further lobes of each node, those without light last; empty where nodes have one.
    more: Vec<[Lobe; MOST_LOBES - 1]>,
    sphere: f32,
    kernel: Kernel,
    shadow_rays: usize,
}

impl Gather {
    /// Of a tree's lights: means over each node's, by area, and filtered lobes (§2.1).
    pub fn new(tree: &Tree, forest: &Forest, emissions: &[Emission], params: &ManyLightParams) -> Self {
        let mut sums = vec![Emission::default(); tree.clusters.len()];
        for (i, cluster) in tree.clusters.iter().enumerate().rev() {
            sums[i] = if cluster.is_leaf() {
                let Emission { diffuse, lobes } = &emissions[tree.order[cluster.first as usize] as usize];
                Emission { diffuse: *diffuse * cluster.area, lobes: lobes.refiltered(cluster.area) }
            } else {
                let mut sum = sums[i + 1];
                sum.add(&sums[tree.clusters[i + 1].skip as usize], 1.0);
                sum
            };
        }
        let radiance = |i: usize| sums[i].weight() / tree.clusters[i].area.max(f32::MIN_POSITIVE);
        let mean = if sums.is_empty() { 0.0 } else { radiance(0) }.max(f32::MIN_POSITIVE);
        let node = |((&i, &skip), &last): ((&u32, &u32), &bool)| {
            let (cluster, Emission { diffuse, lobes }) = (&tree.clusters[i as usize], &sums[i as usize]);
            let area = cluster.area.max(f32::MIN_POSITIVE);
            let [lobe, more @ ..] = lobes.filtered().map(|lobe| Lobe { magnitude: lobe.magnitude / area, ..lobe });
            let node = Node {
                p: cluster.p,
                area,
                n: cluster.n,
                skip,
                descent: Descent::new(cluster, last, radiance(i as usize) / mean, params),
                diffuse: *diffuse / area,
                lobe,
                lights: [cluster.first, cluster.count],
            };
            (node, more)
        };
        let (nodes, more) = forest.nodes.iter().zip(&forest.skip).zip(&forest.last).map(node).unzip();
        Self {
            nodes,
            more: if params.lobes > 1 { more } else { Vec::new() },
            sphere: params.sphere,
            kernel: params.kernel,
            shadow_rays: params.shadow_rays as usize,
        }
    }

    /// All that arrives at a receiver, and how many nodes were visited; `receive` says what becomes of it, `is_seen` whether something stands
    /// between there and the light of a number in the tree's order. Random numbers, where there are any, are hashes of `stream`.
    pub fn at<R: Received>(
        &self,
        receiver: &Receiver,
        receive: impl Fn(&Arrival) -> R,
        is_seen: impl Fn(u32) -> bool,
        stream: u32,
    ) -> (R, u32) {
        let mut sum = R::default();
        let mut choice = Choice::new(self.shadow_rays, stream);
        let (mut place, mut visited) = (0, 0);
        while let Some(node) = self.nodes.get(place) {
            visited += 1;
            let to = node.p - receiver.p;
            let d2 = to.length_squared();
            if node.descent.goes_on(receiver, to, node.n, node.area) {
                place += 1;
                continue;
            }
            if self.shadow_rays == 0 {
                self.arrivals(place, to, d2, |arrival| sum.add(&receive(arrival), 1.0));
            } else {
                let mut of_node = R::default();
                self.arrivals(place, to, d2, |arrival| of_node.add(&receive(arrival), 1.0));
                choice.offer(of_node, place, node.lights);
            }
            place = node.skip as usize;
        }
        if self.shadow_rays > 0 {
            choice.chosen(self.nodes.len(), |received, light, scale| {
                if is_seen(light) {
                    sum.add(received, scale);
                }
            });
        }
        (sum, visited)
    }

    /// Light that a node sends along `-to`, which ends at the receiver.
    fn arrivals(&self, place: usize, to: Vec3, d2: f32, mut each: impl FnMut(&Arrival)) {
        let node = &self.nodes[place];
        let distance = d2.sqrt();
        if distance <= f32::MIN_POSITIVE {
            return;
        }
        let w = to / distance;
        let radius = (node.area / PI).sqrt();
        if self.sphere > 0.0 {
            let sin = (radius * self.sphere / distance).min(1.0);
            let cone = TAU * (1.0 - (1.0 - sin * sin).sqrt());
            if cone > SMALL {
                return self.sphere_arrivals(place, w, cone, each);
            }
        }
        let cos = -node.n.dot(w);
        if cos <= 0.0 {
            return;
        }
        let solid_angle = if distance < disc::FAR * radius {
            let length = node.n.length();
            length * disc::solid_angle(distance / radius, cos / length)
        } else {
            node.area * cos / d2
        };
        each(&Arrival { direction: w, solid_angle, radiance: self.radiance(place, -w) });
    }

    /// The same from a sphere (Hasan et al. 2009): the flux is spread over the cone that the sphere fills, and directions within it are
    /// evaluated one by one. *Ours*: eight fixed ones.
    fn sphere_arrivals(&self, place: usize, w: Vec3, cone: f32, mut each: impl FnMut(&Arrival)) {
        let node = &self.nodes[place];
        let frame = Basis::from_normal(w);
        // The disc of the sphere's radius has sphere² times the node's area.
        let share = cone / (CONE as f32 * self.sphere * self.sphere);
        for k in 0..CONE {
            let height = 1.0 - cone / TAU * (k as f32 + 0.5) / CONE as f32;
            let w = frame.to_world(direction(height, (k as f32 * 0.618_034).fract()));
            let cos = -node.n.dot(w);
            if cos > 0.0 {
                each(&Arrival { direction: w, solid_angle: share * cos, radiance: self.radiance(place, -w) });
            }
        }
    }

    /// A node's radiance in the unit direction `w`.
    fn radiance(&self, place: usize, w: Vec3) -> Rgb {
        let node = &self.nodes[place];
        let first = node.diffuse + node.lobe.radiance(self.kernel, w);
        let more = self.more.get(place).into_iter().flatten().take_while(|lobe| lobe.magnitude != Rgb::ZERO);
        more.fold(first, |sum, lobe| sum + lobe.radiance(self.kernel, w))
    }
}

/// Nodes drawn in proportion to what they send, one a shadow ray, while they pass by (stochastic lightcuts).
struct Choice<R> {
    held: [(R, f32, [u32; 2]); MOST_SHADOW_RAYS],
    rays: usize,
    total: f32,
    stream: u32,
}

impl<R: Received> Choice<R> {
    fn new(rays: usize, stream: u32) -> Self {
        Self { held: [(R::default(), 0.0, [0; 2]); MOST_SHADOW_RAYS], rays, total: 0.0, stream }
    }

    /// A random number of the node at a place: one that sends next to nothing changes none of the others'.
    fn drawn(&self, place: usize, ray: usize) -> f32 {
        let number = MOST_SHADOW_RAYS * place + ray;
        unit((hash64(u64::from(self.stream) << 32 | number as u64) >> 32) as u32)
    }

    /// Takes the place of what is held with the probability that makes all nodes likely by their weight.
    fn offer(&mut self, received: R, place: usize, lights: [u32; 2]) {
        let weight = received.weight();
        if weight > 0.0 && weight.is_finite() {
            self.total += weight;
            for ray in 0..self.rays {
                if self.drawn(place, ray) * self.total < weight {
                    self.held[ray] = (received, weight, lights);
                }
            }
        }
    }

    /// What is held, a light of each by chance, and the scale that makes the mean the sum of all; `places` is how many there are.
    fn chosen(self, places: usize, mut each: impl FnMut(&R, u32, f32)) {
        for ray in 0..self.rays {
            let (received, weight, [first, count]) = self.held[ray];
            if weight > 0.0 {
                let light = first + ((self.drawn(places, ray) * count as f32) as u32).min(count - 1);
                each(&received, light, self.total / (weight * self.rays as f32));
            }
        }
    }
}
