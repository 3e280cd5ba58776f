//! Coverage of the force-speed plane by the recordings of a texture, and what to record next.

/// Edges of the bands of exploratory speed, m/s: slow, medium and fast.
pub const SPEED_BANDS_M_S: [(f64, f64); 3] = [(0.02, 0.06), (0.06, 0.15), (0.15, 0.35)];
/// Edges of the bands of exploratory force, N: light, medium and firm.
pub const FORCE_BANDS_N: [(f64, f64); 3] = [(0.2, 0.7), (0.7, 1.5), (1.5, 3.0)];
/// Least duration in a covered cell, s.
const ENOUGH_S: f64 = 0.4;
/// Least total duration, s, and number of segments of a reliable texture.
const SHORTEST_S: f64 = 3.0;
const FEWEST_SEGMENTS: usize = 3;

/// The distribution of a texture's segments over the plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Coverage {
    /// Total duration of the segments used, s.
    pub used_s: f64,
    /// Number of segments used.
    pub segments: usize,
    /// Duration of segments by band of speed, then of force, s.
    pub cells_s: [[f64; 3]; 3],
}

impl Coverage {
    /// Adds a stretch at one speed and force.
    pub fn add(&mut self, speed_m_s: f64, force_n: f64, length_s: f64) {
        let band = |bands: &[(f64, f64); 3], value: f64| {
            bands.iter().position(|(low, high)| (*low..*high).contains(&value))
        };
        self.used_s += length_s;
        self.segments += 1;
        if let (Some(speed), Some(force)) = (band(&SPEED_BANDS_M_S, speed_m_s), band(&FORCE_BANDS_N, force_n))
        {
            self.cells_s[speed][force] += length_s;
        }
    }

    /// True if there is too little data for a reliable texture.
    pub fn is_short(&self) -> bool {
        self.used_s < SHORTEST_S || self.segments < FEWEST_SEGMENTS
    }

    /// Cells with too little data, as indices of the bands of speed and force.
    pub fn missing(&self) -> Vec<(usize, usize)> {
        let all = (0..3).flat_map(|speed| (0..3).map(move |force| (speed, force)));
        all.filter(|&(speed, force)| self.cells_s[speed][force] < ENOUGH_S).collect()
    }

    /// The first few of those as text; `None` if none is missing.
    pub fn next_to_record(&self) -> Option<String> {
        let missing = self.missing();
        let some: Vec<String> = missing.iter().take(MAX_NAMED).map(area).collect();
        let more = match missing.len().saturating_sub(MAX_NAMED) {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        (!missing.is_empty()).then(|| some.join(", ") + &more)
    }
}

/// Most cells in a message.
const MAX_NAMED: usize = 3;

fn area(&(speed, force): &(usize, usize)) -> String {
    let (slow, fast) = SPEED_BANDS_M_S[speed];
    let (light, firm) = FORCE_BANDS_N[force];
    format!("{:.0} to {:.0} mm/s at {light} to {firm} N", slow * 1000.0, fast * 1000.0)
}
