//! Histograms of durations.

use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// Counts of durations in buckets of 1/16 octave: quantiles are right to 4.4 per cent.
#[derive(Debug, Clone)]
pub struct Histogram {
    counts: Vec<u64>,
    total: u64,
    max_ns: u64,
}

const PER_OCTAVE: u32 = 16;
const BUCKETS: usize = 64 * PER_OCTAVE as usize;

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: vec![0; BUCKETS], total: 0, max_ns: 0 }
    }
}

impl Histogram {
    /// Counts a duration.
    pub(crate) fn record(&mut self, ns: u64) {
        self.counts[bucket(ns)] += 1;
        self.total += 1;
        self.max_ns = self.max_ns.max(ns);
    }

    /// Number of durations counted.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// The largest duration, exactly, ns.
    pub fn max_ns(&self) -> u64 {
        self.max_ns
    }

    /// Number of durations beyond this one, to within a bucket.
    pub fn count_beyond(&self, ns: u64) -> u64 {
        self.counts[bucket(ns) + 1..].iter().sum()
    }

    /// Adds the counts of another histogram.
    pub fn add(&mut self, other: &Self) {
        for (count, more) in self.counts.iter_mut().zip(&other.counts) {
            *count += more;
        }
        self.total += other.total;
        self.max_ns = self.max_ns.max(other.max_ns);
    }

    /// The duration that this fraction of all durations does not exceed, ns; 0 if nothing was counted.
    pub fn quantile_ns(&self, fraction: f64) -> u64 {
        let wanted = (fraction * self.total as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        for (bucket, count) in self.counts.iter().enumerate() {
            seen += count;
            if seen >= wanted && *count > 0 {
                return upper_edge(bucket).min(self.max_ns);
            }
        }
        self.max_ns
    }
}

/// A histogram that several threads may count into and read without waiting.
#[derive(Debug)]
pub struct SharedHistogram {
    counts: Box<[AtomicU64]>,
    max_ns: AtomicU64,
}

impl Default for SharedHistogram {
    fn default() -> Self {
        Self { counts: (0..BUCKETS).map(|_| AtomicU64::new(0)).collect(), max_ns: AtomicU64::new(0) }
    }
}

impl SharedHistogram {
    /// Counts a duration.
    pub fn record(&self, ns: u64) {
        self.counts[bucket(ns)].fetch_add(1, Relaxed);
        self.max_ns.fetch_max(ns, Relaxed);
    }

    /// The counts so far.
    pub fn read(&self) -> Histogram {
        let counts: Vec<u64> = self.counts.iter().map(|count| count.load(Relaxed)).collect();
        Histogram { total: counts.iter().sum(), counts, max_ns: self.max_ns.load(Relaxed) }
    }
}

/// Age of external data when it is read. One thread updates it, another reads it.
#[derive(Debug)]
pub struct AgeMeter {
    since: Instant,
    newest_ns: AtomicU64,
    ages: SharedHistogram,
}

impl Default for AgeMeter {
    fn default() -> Self {
        Self { since: Instant::now(), newest_ns: AtomicU64::new(0), ages: SharedHistogram::default() }
    }
}

impl AgeMeter {
    /// Records that the newest data are of this moment. To be called once they can be read, so that no age is
    /// underestimated.
    pub fn news(&self, of: Instant) {
        self.newest_ns.store(self.ns_at(of), Relaxed);
    }

    /// Records that data were read at this moment that are `older_s` older than the newest.
    pub fn read(&self, now: Instant, older_s: f64) {
        let newest_ns = self.newest_ns.load(Relaxed);
        let older_ns = (1e9 * older_s).max(0.0) as u64;
        self.ages.record(self.ns_at(now).saturating_sub(newest_ns) + older_ns);
    }

    /// Age of the newest data at this moment.
    pub fn newest(&self, now: Instant) -> Duration {
        let newest_ns = self.newest_ns.load(Relaxed);
        Duration::from_nanos(self.ns_at(now).saturating_sub(newest_ns))
    }

    /// The ages of the data read so far.
    pub fn ages(&self) -> Histogram {
        self.ages.read()
    }

    fn ns_at(&self, at: Instant) -> u64 {
        at.saturating_duration_since(self.since).as_nanos() as u64
    }
}

fn bucket(ns: u64) -> usize {
    if ns < u64::from(PER_OCTAVE) {
        return ns as usize;
    }
    let octave = ns.ilog2() - PER_OCTAVE.ilog2();
    let within = (ns >> octave) - u64::from(PER_OCTAVE);
    ((octave + 1) * PER_OCTAVE) as usize + within as usize
}

fn upper_edge(bucket: usize) -> u64 {
    let (octave, within) = (bucket as u32 / PER_OCTAVE, bucket as u64 % u64::from(PER_OCTAVE));
    match octave {
        0 => within,
        _ => ((u64::from(PER_OCTAVE) + within + 1) << (octave - 1)) - 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_duration_lies_in_its_bucket() {
        let mut ns = 1;
        while ns < u64::MAX / 3 {
            for ns in [ns - 1, ns, ns + 1] {
                let b = bucket(ns);
                assert!(upper_edge(b) >= ns && (b == 0 || upper_edge(b - 1) < ns), "{ns}");
            }
            ns *= 2;
        }
    }

    #[test]
    fn durations_beyond_a_bound_are_counted() {
        let mut histogram = Histogram::default();
        [5, 90, 200, 3000].iter().for_each(|ns| histogram.record(*ns));
        assert_eq!([4, 100, 5000].map(|ns| histogram.count_beyond(ns)), [4, 2, 0]);
    }

    #[test]
    fn ages_are_counted_from_the_newest() {
        let meter = AgeMeter::default();
        let begun = Instant::now();
        let after = |ms| begun + std::time::Duration::from_millis(ms);
        meter.news(after(10));
        meter.read(after(15), 0.002);
        meter.news(after(20));
        // Read before it came, as far as the clock tells.
        meter.read(after(19), 0.0);
        let ages = meter.ages();
        assert_eq!((ages.total(), ages.quantile_ns(0.5), ages.max_ns()), (2, 0, 7_000_000));
    }

    #[test]
    fn quantiles_are_right_to_a_bucket() {
        let mut histogram = Histogram::default();
        (1..=1000).for_each(|ns| histogram.record(ns * 1000));
        for (fraction, exact) in [(0.5, 500e3), (0.99, 990e3), (0.999, 999e3)] {
            let got = histogram.quantile_ns(fraction) as f64;
            assert!((got / exact - 1.0).abs() < 0.07, "{fraction}: {got}");
        }
        assert_eq!(histogram.max_ns(), 1_000_000);
    }

    #[test]
    fn a_histogram_that_several_threads_count_into_forgets_none() {
        let shared = SharedHistogram::default();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| (1..=1000).for_each(|ns| shared.record(ns * 1000)));
            }
        });
        let mut alone = Histogram::default();
        (1..=1000).for_each(|ns| alone.record(ns * 1000));
        let all = shared.read();
        assert_eq!((all.total(), all.max_ns()), (4000, 1_000_000));
        assert_eq!(all.quantile_ns(0.5), alone.quantile_ns(0.5));
    }
}
