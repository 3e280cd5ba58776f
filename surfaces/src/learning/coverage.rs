//! Coverage of the force-speed plane by the recordings of a texture, and what to record next.

use super::texture::{Fate, SegmentReport};

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
    /// The coverage of segments of recordings at `rate_hz`.
    pub fn of(segments: &[SegmentReport], rate_hz: f64) -> Self {
        let mut coverage = Self::default();
        for segment in segments.iter().filter(|segment| segment.fate == Fate::Kept) {
            let length_s = segment.samples.len() as f64 / rate_hz;
            coverage.add(segment.speed_m_s, segment.force_n, length_s);
        }
        coverage
    }

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::law::{LawSettings, learn_law};
    use crate::recording::synthetic::drag;

    fn coverage(steps: &[(f64, f64, f64)]) -> Coverage {
        let recording = drag(steps, 0.3, 1, |_, _| (vec![-0.5], 1.0));
        let (_, report) = learn_law(&[recording], &LawSettings::default(), &|_| ()).expect("a texture");
        Coverage::of(&report.segments, 10_000.0)
    }

    #[test]
    fn cells_that_were_not_visited_are_to_be_recorded_next() {
        let one = coverage(&[(1.0, 0.1, 1.0)]);
        assert!(one.is_short());
        assert_eq!(one.missing().len(), 8);
        assert!(!one.missing().contains(&(1, 1)));
        let everywhere: Vec<_> = [0.04, 0.1, 0.25]
            .iter()
            .flat_map(|speed| [0.4, 1.0, 2.0].map(|force| (0.6, *speed, force)))
            .collect();
        let all = coverage(&everywhere);
        assert_eq!((all.missing(), all.is_short()), (vec![], false));
        assert_eq!(all.next_to_record(), None);
        let next = one.next_to_record().expect("eight are missing");
        assert!(
            next.starts_with("20 to 60 mm/s at 0.2 to 0.7 N, ") && next.ends_with(", and 5 more"),
            "{next}"
        );
    }
}
