use super::*;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

const LIMIT: Limit = Limit { peak: 0.5, continuous: 0.25, window_s: 0.05, slew_per_s: Some(300.0) };
const RATE_HZ: f64 = 10_000.0;

/// An independent account of what an actuator was given.
struct Judge {
    limit: Limit,
    rate_hz: f64,
    mean_square: f64,
    previous: f64,
}

impl Judge {
    fn new(limit: Limit, rate_hz: f64) -> Self {
        Self { limit, rate_hz, mean_square: 0.0, previous: 0.0 }
    }

    fn watch(&mut self, request: f64, output: f64) {
        assert!(output.abs() <= self.limit.peak, "peak: {output}");
        let keep = (-1.0 / (self.limit.window_s * self.rate_hz)).exp();
        self.mean_square = keep * self.mean_square + (1.0 - keep) * output * output;
        assert!(self.mean_square.sqrt() <= self.limit.continuous, "heat: {}", self.mean_square.sqrt());
        if !request.is_finite() {
            let (before, now) = (self.previous.abs(), output.abs());
            assert!(now < before || output == 0.0, "{now} is asked for by nothing");
        }
        if let Some(slew_per_s) = self.limit.slew_per_s {
            let most = slew_per_s / self.rate_hz;
            let change = (output - self.previous).abs();
            assert!(change <= most + 1e-15 * self.limit.peak, "slew: {change} of {most}");
        }
        self.previous = output;
    }
}

#[test]
fn no_limit_is_ever_exceeded() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let limits = [
        LIMIT,
        Limit { slew_per_s: None, ..LIMIT },
        Limit { slew_per_s: Some(8.0), ..LIMIT },
        Limit { continuous: 0.5, ..LIMIT },
        Limit { window_s: 10.0, ..LIMIT },
        Limit { peak: 3.3, continuous: 0.88, window_s: 1.0, slew_per_s: Some(1e9) },
    ];
    for limit in limits {
        let mut limiter = Limiter::<1>::new(&limit, RATE_HZ).unwrap();
        let mut judge = Judge::new(limit, RATE_HZ);
        let mut held = 0.0;
        for _ in 0..170_000 {
            let request = match rng.random_range(0..40) {
                0 => f64::NAN,
                1 => f64::INFINITY,
                2 => f64::NEG_INFINITY,
                3 => f64::MAX,
                4 => f64::MIN_POSITIVE / 8.0,
                5 => 0.0,
                6..=15 => rng.random_range(-2.0..2.0) * limit.peak,
                16 => {
                    held = rng.random_range(-2.0..2.0) * limit.peak;
                    held
                }
                _ => held,
            };
            let [output] = limiter.apply([request]);
            judge.watch(request, output);
        }
    }
}

#[test]
fn no_limit_is_ever_exceeded_in_space() {
    let limit = Limit { peak: 3.3, continuous: 1.0, window_s: 0.1, slew_per_s: Some(200.0) };
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
    let mut limiter = Limiter::<3>::new(&limit, 1000.0).unwrap();
    let (mut mean_square, mut previous) = (0.0, [0.0; 3]);
    let keep = (-1.0_f64 / 100.0).exp();
    let mut request = [0.0; 3];
    for tick in 0..300_000 {
        if rng.random_range(0..30) == 0 {
            let size = if tick % 1000 == 0 { f64::MAX } else { 8.0 };
            request = std::array::from_fn(|_| rng.random_range(-1.0..1.0) * size);
        }
        let output = limiter.apply(request);
        mean_square = keep * mean_square + (1.0 - keep) * dot(output, output);
        assert!(norm(output) <= 3.3 && mean_square.sqrt() <= 1.0);
        assert!(norm(sub(output, previous)) <= 0.2 * (1.0 + 1e-12));
        previous = output;
    }
    assert!(limiter.counts().continuous > 1000 && limiter.counts().slew > 1000, "{:?}", limiter.counts());
}

proptest! {
    #[test]
    fn any_limit_is_kept(
        peak in 1e-3..1e3_f64, fraction in 0.01..1.0_f64, window_s in 1e-3..100.0_f64, slew in 10.0..1e5_f64,
        requests in prop::collection::vec(prop_oneof![any::<f64>(), -3.0..3.0_f64], 1..400),
    ) {
        let limit = Limit { peak, continuous: fraction * peak, window_s, slew_per_s: Some(slew * peak) };
        let mut limiter = Limiter::<1>::new(&limit, 1000.0).unwrap();
        let mut judge = Judge::new(limit, 1000.0);
        for request in requests {
            let request = request * peak;
            let [output] = limiter.apply([request]);
            judge.watch(request, output);
        }
    }
}

#[test]
fn what_is_within_the_limits_passes_bit_for_bit() {
    let mut limiter = Limiter::<1>::new(&LIMIT, RATE_HZ).unwrap();
    for k in 0..50_000 {
        let request = 0.249 * (f64::from(k) * 0.05).sin();
        assert_eq!(limiter.apply([request]), [request]);
    }
    let counts = limiter.counts();
    assert_eq!(counts, ClipCounts { ticks: 50_000, ..ClipCounts::default() });
}

#[test]
fn the_largest_finite_request_is_kept_and_continued() {
    let mut limiter = Limiter::<2>::new(&LIMIT, RATE_HZ).unwrap();
    for request in [[0.1, 0.0], [0.6, -0.8], [f64::INFINITY, 0.0], [f64::NAN, 9.0], [0.3, 0.3]] {
        limiter.apply(request);
    }
    assert_eq!(limiter.largest_request(), 1.0);
    let mut next = Limiter::<2>::new(&LIMIT, RATE_HZ).unwrap();
    next.count_on_from(limiter.counts(), limiter.largest_request());
    next.apply([0.2, 0.0]);
    assert_eq!((next.largest_request(), next.counts().ticks), (1.0, 6));
    next.apply([0.0, -1e200]);
    assert_eq!(next.largest_request(), 1e200);
}

#[test]
fn a_short_overload_passes_and_a_long_one_falls_to_continuous() {
    let limit = Limit { peak: 5.0, continuous: 3.3, window_s: 0.2, slew_per_s: None };
    let mut limiter = Limiter::<1>::new(&limit, 1000.0).unwrap();
    let outputs: Vec<f64> = (0..2000).map(|_| limiter.apply([5.0])[0]).collect();
    assert!(outputs[..100].iter().all(|&y| y == 5.0), "the tap of 0.1 s is whole");
    assert!((outputs[1999] - 3.3).abs() < 1e-6);
    let heat = limiter.mean_square() / (3.3 * 3.3);
    assert!(heat > 0.999 && heat <= 1.0);
}

#[test]
fn one_that_goes_on_for_another_heats_its_actuator_no_further() {
    let limit = |continuous| Limit { peak: 5.0, continuous, window_s: 0.2, slew_per_s: None };
    for continuous in [1.0, 3.0, 4.5] {
        let mut before = Limiter::<1>::new(&limit(4.0), 1000.0).unwrap();
        (0..2000).for_each(|_| {
            before.apply([5.0]);
        });
        let mut after = Limiter::<1>::new(&limit(continuous), 1000.0).unwrap();
        after.continue_from(&before);
        // The actuator itself knows nothing of who drives it.
        let (weight, mut mean_square) = (1.0 - f64::exp(-1.0 / 200.0), before.mean_square());
        let most = f64::max(mean_square, continuous * continuous);
        for _ in 0..2000 {
            let given = after.apply([5.0])[0];
            mean_square += weight * (given * given - mean_square);
            assert!(mean_square <= most * (1.0 + 1e-9), "{mean_square} of {most}");
        }
        assert!((mean_square.sqrt() - continuous).abs() < 1e-3);
    }
}

/// Between edits the drive is whatever it is; at an edit it is zero, as the swap of plans makes it.
#[test]
fn no_sequence_of_limits_allows_more_than_the_one_in_force() {
    const RATE_HZ: f64 = 1000.0;
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
    let (mut edits, mut warm, mut in_debt) = (0, 0, 0);
    for _ in 0..40 {
        let mut given: Vec<f64> = Vec::new();
        let mut before: Option<Limiter<1>> = None;
        for _ in 0..12 {
            let limit = Limit {
                peak: [0.3, 0.5, 2.0][rng.random_range(0..3)],
                continuous: [0.02, 0.1, 0.25][rng.random_range(0..3)],
                window_s: [0.004, 0.05, 0.06, 1.0, 1.3][rng.random_range(0..5)],
                slew_per_s: [None, Some(8.0), Some(300.0)][rng.random_range(0..3)],
            };
            let keep = (-1.0 / (limit.window_s * RATE_HZ)).exp();
            // From its definition: everything that was ever given, whatever the limits were then.
            let mut mean = given.iter().fold(0.0, |m, y| keep * m + (1.0 - keep) * y * y);
            let most = limit.continuous * limit.continuous;
            let mut limiter = Limiter::<1>::new(&limit, RATE_HZ).unwrap();
            if let Some(before) = &before {
                limiter.continue_from(before);
                assert!(limiter.mean_square() >= mean * (1.0 - 1e-9));
                warm += usize::from(mean > 0.5 * most);
                in_debt += usize::from(mean > most);
                edits += 1;
            }
            let size = rng.random_range(0.0..1.2) * limit.peak;
            for _ in 0..rng.random_range(1..1500) {
                let [y] = limiter.apply([size]);
                let excess = (mean - most).max(0.0);
                mean = keep * mean + (1.0 - keep) * y * y;
                assert!(mean - most <= keep * excess, "{limit:?}: {mean} of {most}");
                assert!(y <= limit.peak);
                given.push(y);
            }
            while limiter.output() != [0.0] {
                given.extend(limiter.apply([0.0]));
            }
            before = Some(limiter);
        }
    }
    assert!(edits == 440 && warm > 150 && in_debt > 80, "{edits}, {warm}, {in_debt}");
}

#[test]
fn a_bound_of_any_window_is_close_for_a_steady_drive() {
    let mut limiter = Limiter::<1>::new(&LIMIT, RATE_HZ).unwrap();
    for _ in 0..100_000 {
        limiter.apply([0.2]);
    }
    for window_s in [0.002, 0.003, 0.06, 0.1, 1.4] {
        let mut next = Limiter::<1>::new(&Limit { window_s, ..LIMIT }, RATE_HZ).unwrap();
        next.continue_from(&limiter);
        let known = 0.04 * (1.0 - (-10.0_f64 / window_s).exp());
        let bound = next.mean_square();
        assert!(bound >= known && bound <= 1.15 * known, "{window_s}: {bound}");
    }
}

#[test]
fn no_limit_is_more_than_spent_by_raising_it_where_rest_is_not_known() {
    for raised in [1.0, 3.0] {
        let limit = |continuous| Limit { peak: 5.0, continuous, window_s: 0.2, slew_per_s: None };
        let mut limiter = Limiter::<1>::new(&limit(1.0), 1000.0).unwrap();
        limiter.assume_thermally_saturated();
        assert!(limiter.has_unknown_history());
        limiter.apply([0.0]);
        let mut next = Limiter::<1>::new(&limit(raised), 1000.0).unwrap();
        next.continue_from(&limiter);
        let [first] = next.apply([5.0]);
        // What one tick of rest has cooled may be given within one tick, and no more.
        assert!(first > raised && first <= 2.0_f64.sqrt() * raised, "{first}");
    }
}

#[test]
fn faults_are_zero_at_once_and_counted() {
    let mut limiter = Limiter::<1>::new(&Limit { slew_per_s: None, ..LIMIT }, RATE_HZ).unwrap();
    assert_eq!(limiter.apply([0.2]), [0.2]);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(limiter.apply([bad]), [0.0]);
    }
    assert_eq!(limiter.apply([0.2]), [0.2]);
    assert_eq!(limiter.counts().fault, 3);
}

#[test]
fn faults_go_to_zero_within_the_slew_and_are_counted() {
    // A tenth of a unit in a tick.
    let slewing = Limit { slew_per_s: Some(0.1 * RATE_HZ), ..LIMIT };
    let mut limiter = Limiter::<1>::new(&slewing, RATE_HZ).unwrap();
    let mut given = Vec::new();
    for request in [0.1, 0.2, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.05] {
        given.push(limiter.apply([request])[0]);
    }
    for (given, expected) in given.iter().zip([0.1, 0.2, 0.1, 0.0, 0.0, 0.05]) {
        assert!((given - expected).abs() < 1e-9, "{given:?} for {expected}");
    }
    assert_eq!(limiter.counts().fault, 3);
}

#[test]
fn impossible_limits_are_refused() {
    let refused = |limit: Limit| Limiter::<1>::new(&limit, RATE_HZ).unwrap_err();
    assert!(matches!(refused(Limit { peak: 0.0, ..LIMIT }), LimitError::NotPositive { name: "peak", .. }));
    assert!(matches!(refused(Limit { window_s: f64::NAN, ..LIMIT }), LimitError::NotPositive { .. }));
    assert!(matches!(refused(Limit { continuous: 0.6, ..LIMIT }), LimitError::ContinuousAbovePeak { .. }));
    assert!(matches!(refused(Limit { slew_per_s: Some(1e-6), ..LIMIT }), LimitError::SlewTooSlow { .. }));
}
