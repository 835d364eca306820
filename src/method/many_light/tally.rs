//! What a frame's sampling came to, whichever device has made it.

/// Counts of a frame.
pub struct Tally {
    /// Pixels at which light was gathered.
    pub points: u32,
    /// The least, the most and the sum of the nodes that were visited for them.
    pub nodes: [u64; 3],
    /// Pixels whose lobes rays follow.
    pub mirrors: u32,
}

impl Tally {
    /// Names and numbers, as `timings.json` has them.
    pub fn listed(&self) -> Vec<(&'static str, f64)> {
        let [least, most, sum] = self.nodes.map(|n| n as f64);
        vec![
            ("shading points", self.points.into()),
            ("least nodes", least),
            ("most nodes", most),
            ("mean nodes", sum / f64::from(self.points.max(1))),
            ("mirror pixels", self.mirrors.into()),
        ]
    }
}
