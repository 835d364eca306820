// Which receivers in free space light a surface. Twin: src/method/radiance_probes/volume.rs.

// Numbers that a receiver in free space keeps.
const VOLUME_NUMBERS: u32 = 9u;

struct Taps {
    // Receivers, and their weights; 0 for none.
    points: array<u32, 8>,
    weights: array<f32, 8>,
    // What each of their numbers counts for in E_T.
    factors: array<f32, VOLUME_NUMBERS>,
}
