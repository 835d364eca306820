//! Where a traversal goes on to a node's children.
//!
//! *Paper*: where the node's solid angle is above a threshold, down to the max cut (§2.2), at which sharp lobes lose details. *Ours*: past the max
//! cut too, though never further than the threshold asks, where a node on it or below would be wrong as a whole: very near the receiver
//! for its brightness ([`ManyLightParams::near`]); near and cut by the receiver's horizon, below which a part of it would count ([`ManyLightParams::horizon`]); or
//! within the receiver's glossy lobe and so large that the lobe would see its middle alone ([`ManyLightParams::fill`]).

use super::params::ManyLightParams;
use super::tree::Cluster;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// Part of a lobe's greatest density that ends it.
pub(crate) const LOBE_END: f32 = 0.1;

/// For whom light is gathered.
pub struct Receiver {
    /// Position.
    pub p: Vec3,
    /// Unit normal.
    pub n: Vec3,
    /// Its glossy lobe, where it is a sharp one.
    pub lobe: Option<Cone>,
}

/// Where a receiver's lobe is: a cone.
pub struct Cone {
    axis: Vec3,
    cos: f32,
    sin: f32,
    /// Solid angle beyond which a node in it has to be taken apart.
    most: f32,
}

impl Cone {
    /// Of a lobe about the unit direction `axis`; `None` where nothing is asked of nodes in it.
    pub fn new(axis: Vec3, exponent: f32, params: &ManyLightParams) -> Option<Self> {
        let cos = LOBE_END.powf(1.0 / exponent.max(1.0));
        let of = |fill: f32| Self { axis, cos, sin: (1.0 - cos * cos).sqrt(), most: fill * TAU / (exponent + 1.0) };
        (params.fill > 0.0).then(|| of(params.fill))
    }

    /// Whether a sphere of `radius` at `to` from the lobe's apex reaches into it.
    fn meets(&self, to: Vec3, distance: f32, radius: f32) -> bool {
        let sin = (radius / distance).min(1.0);
        let cos = (1.0 - sin * sin).sqrt();
        // The cosine of the sum of both half angles.
        self.axis.dot(to) > distance * (self.cos * cos - self.sin * sin)
    }
}

/// Squared distances of a node's middle that decide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Descent {
    /// Below it a traversal goes on.
    pub reach: f32,
    /// Below it, where the horizon cuts the node.
    pub horizon: f32,
    /// Below it, where the node is in the lobe and large.
    pub lobe: f32,
}

impl Descent {
    /// Of a cluster; `last` if it lies on the max cut or below. `brightness` is its radiance in units of the mean: what it sends, and what can be
    /// wrong, goes as its solid angle times that.
    pub fn new(cluster: &Cluster, last: bool, brightness: f32, params: &ManyLightParams) -> Self {
        let wide = cluster.area / params.solid_angle;
        let within = |radii: f32| wide.min(radii * radii * brightness * cluster.area / PI);
        match (cluster.is_leaf(), last) {
            (true, _) => Self { reach: 0.0, horizon: 0.0, lobe: 0.0 },
            (false, false) => Self { reach: wide, horizon: 0.0, lobe: 0.0 },
            (false, true) => Self { reach: within(params.near), horizon: within(params.horizon), lobe: wide },
        }
    }

    /// Whether a traversal goes on; the node's mean position is at `to` from the receiver, its mean normal `n` as short as its normals differ.
    pub fn goes_on(&self, receiver: &Receiver, to: Vec3, n: Vec3, area: f32) -> bool {
        let d2 = to.length_squared();
        if d2 < self.reach {
            return true;
        }
        let r2 = area * FRAC_1_PI;
        // The shorter the mean normal, the rounder is what the node holds.
        let straddles = || to.dot(receiver.n).powi(2) < (1.0 - n.dot(receiver.n).powi(2)) * r2;
        if d2 < self.horizon && straddles() {
            return true;
        }
        let fills = |cone: &Cone| area > cone.most * d2 && cone.meets(to, d2.sqrt(), r2.sqrt());
        d2 < self.lobe && receiver.lobe.as_ref().is_some_and(fills)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cluster(count: u32) -> Cluster {
        Cluster { p: Vec3::ZERO, n: Vec3::ZERO, area: PI, skip: 0, first: 0, count, variance: 0.0 }
    }

    /// A disc of radius 1 about a receiver that looks up and has a lobe along +X with a cone of 17 degrees.
    #[test]
    fn past_the_max_cut_a_traversal_goes_on_where_a_node_would_be_wrong() {
        let params = ManyLightParams { near: 1.0, horizon: 3.0, fill: 0.5, ..ManyLightParams::default() };
        let receiver = Receiver { p: Vec3::ZERO, n: Vec3::Z, lobe: Cone::new(Vec3::X, 49.0, &params) };
        let at = |count, last, to: [f32; 3], n: Vec3| {
            Descent::new(&cluster(count), last, 1.0, &params).goes_on(&receiver, to.into(), n, PI)
        };
        let goes_on = |to, n| at(8, true, to, n);
        assert!(goes_on([0.0, 0.5, 0.5], -Vec3::Y), "very near");
        assert!(goes_on([0.0, 2.0, 0.5], -Vec3::Y) && goes_on([0.0, 2.0, -0.5], -Vec3::Y), "the horizon cuts it");
        assert!(!goes_on([0.0, 2.0, 1.5], -Vec3::Y) && !goes_on([0.0, 2.0, 0.5], Vec3::Z), "all of it is above");
        assert!(!goes_on([0.0, 3.5, 0.5], -Vec3::Y), "far");
        assert!(goes_on([5.0, 0.0, 2.0], -Vec3::X), "in the lobe, and half as large");
        assert!(!goes_on([3.5, 0.0, 3.5], -Vec3::X) && !goes_on([8.0, 0.0, 2.0], -Vec3::X), "beside the lobe, or small in it");
        let diffuse = Receiver { lobe: None, ..receiver };
        assert!(!Descent::new(&cluster(8), true, 1.0, &params).goes_on(&diffuse, Vec3::new(5.0, 0.0, 2.0), -Vec3::X, PI));
        assert!(!at(1, true, [0.0, 0.5, 0.5], -Vec3::Y), "a single light has no parts");
        let bright = |brightness| Descent::new(&cluster(8), true, brightness, &params);
        let goes_on = |brightness| bright(brightness).goes_on(&diffuse, Vec3::new(0.0, 1.3, 1.3), -Vec3::X, PI);
        assert!(goes_on(4.0) && !goes_on(1.0), "twice as far where four times as bright");
        let far = (PI / params.solid_angle).sqrt();
        assert!(at(8, false, [0.0, 0.0, 0.99 * far], -Vec3::Z) && !at(8, false, [0.0, 0.0, 1.01 * far], -Vec3::Z));
        assert!(Cone::new(Vec3::X, 49.0, &ManyLightParams { fill: 0.0, ..params }).is_none());
    }
}
