// A cluster and the light that it sends out. Twin: method::many_light::gather::Node.

struct Node {
    p: vec3<f32>,
    // Squared distance below which a traversal goes on to its children; further down, where the receiver's horizon cuts it, and where it is in
    // the receiver's lobe and large.
    reach: f32,
    // Mean normal, as short as they differ.
    n: vec3<f32>,
    // Of all its lights.
    area: f32,
    // Mean diffuse radiance.
    diffuse: vec3<f32>,
    // Where a traversal goes on that takes it as a whole.
    skip: u32,
    // Its lobe.
    direction: vec3<f32>,
    exponent: f32,
    magnitude: vec3<f32>,
    horizon: f32,
    in_lobe: f32,
    // Its lights in the tree's order: the first, and how many.
    first: u32,
    count: u32,
}
