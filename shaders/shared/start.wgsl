// Twin of src/transport/follow.rs: PathStart.
// Where a path begins: a point of a triangle, and the random stream of its samples.
struct PathStart {
    // NO_TRIANGLE: there is no path.
    triangle: u32,
    u: f32,
    v: f32,
    stream: u32,
    // Towards the viewer, world; for light that a light map collects, x says on which side of the normal.
    wo: vec3<f32>,
    // Its samples, from `first` to before `end`.
    first: u32,
    end: u32,
}
