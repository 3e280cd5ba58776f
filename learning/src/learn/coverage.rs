//! Coverage of the force-speed plane by the segments of a texture.

use super::texture::{Fate, SegmentReport};
use haptograph_surfaces::coverage::Coverage;

/// The coverage of segments of recordings at `rate_hz`.
pub fn coverage(segments: &[SegmentReport], rate_hz: f64) -> Coverage {
    let mut coverage = Coverage::default();
    for segment in segments.iter().filter(|segment| segment.fate == Fate::Kept) {
        let length_s = segment.samples.len() as f64 / rate_hz;
        coverage.add(segment.speed_m_s, segment.force_n, length_s);
    }
    coverage
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::law::{LawSettings, learn_law};
    use crate::recording::tests::synthetic::drag;

    fn covered(steps: &[(f64, f64, f64)]) -> Coverage {
        let recording = drag(steps, 0.3, 1, |_, _| (vec![-0.5], 1.0));
        let (_, report) = learn_law(&[recording], &LawSettings::default(), &|_| ()).expect("a texture");
        coverage(&report.segments, 10_000.0)
    }

    #[test]
    fn cells_that_were_not_visited_are_to_be_recorded_next() {
        let one = covered(&[(1.0, 0.1, 1.0)]);
        assert!(one.is_short());
        assert_eq!(one.missing().len(), 8);
        assert!(!one.missing().contains(&(1, 1)));
        let everywhere: Vec<_> = [0.04, 0.1, 0.25]
            .iter()
            .flat_map(|speed| [0.4, 1.0, 2.0].map(|force| (0.6, *speed, force)))
            .collect();
        let all = covered(&everywhere);
        assert_eq!((all.missing(), all.is_short()), (vec![], false));
        assert_eq!(all.next_to_record(), None);
        let next = one.next_to_record().expect("eight are missing");
        assert!(
            next.starts_with("20 to 60 mm/s at 0.2 to 0.7 N, ") && next.ends_with(", and 5 more"),
            "{next}"
        );
    }
}
