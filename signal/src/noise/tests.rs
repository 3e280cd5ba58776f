use super::*;
use rand_xoshiro::Xoshiro256PlusPlus;

impl Uniform {
    /// The next sample.
    pub(crate) fn next_sample(&mut self) -> f64 {
        self.source.next_sample()
    }
}

#[test]
fn stream_seeds_keep_their_values() {
    // Computed once by an independent implementation: files depend on them.
    assert_eq!(stream_seed(0, ""), 0x813f0174a2367c13);
    assert_eq!(stream_seed(7, "texture/noise"), 0x73a5333be6a43bd4);
    assert_ne!(stream_seed(7, "a"), stream_seed(8, "a"));
}

#[test]
fn every_lane_is_the_named_generator() {
    let mut lanes = Lanes::new(42);
    let mut words = SplitMix64::seed_from_u64(42);
    let mut single: Vec<_> = (0..LANES)
        .map(|_| {
            let seed: Vec<u8> = (0..4).flat_map(|_| words.next_u64().to_le_bytes()).collect();
            Xoshiro256PlusPlus::from_seed(seed.try_into().unwrap())
        })
        .collect();
    assert_eq!(single[0], Xoshiro256PlusPlus::seed_from_u64(42));
    for _ in 0..1000 {
        let together = lanes.next();
        for lane in 0..LANES {
            assert_eq!(together[lane], single[lane].next_u64());
        }
    }
}

#[test]
fn the_sequence_does_not_depend_on_how_it_is_asked_for() {
    let mut whole = vec![0.0; 3000];
    Gaussian::new(5).fill(&mut whole);
    let mut stream = Gaussian::new(5);
    let mut pieces = Vec::new();
    for length in [1, 63, 64, 65, 0, 7, 200, 128].into_iter().cycle() {
        let mut piece = vec![0.0; length];
        stream.fill(&mut piece);
        pieces.append(&mut piece);
        pieces.push(stream.next_sample());
        if pieces.len() >= whole.len() {
            break;
        }
    }
    assert_eq!(&pieces[..3000], &whole[..]);
    let mut copy = stream.clone();
    assert_eq!(copy.next_sample(), stream.next_sample());
}

#[test]
fn instruction_sets_agree_to_the_bit() {
    let (mut best, mut plain) = (Lanes::new(9), Lanes::new(9));
    let (mut x, mut y) = ([0.0; BATCH], [0.0; BATCH]);
    for _ in 0..200 {
        normal_batch(Arch::new(), &mut best, &mut x);
        normal_batch(Arch::Scalar, &mut plain, &mut y);
        assert_eq!(x, y);
    }
}

#[test]
fn the_transform_is_box_and_mullers() {
    let mut words = Xoshiro256PlusPlus::seed_from_u64(1);
    let edges = [0, u64::MAX, 1, 2, 3, u64::MAX << 26, (1 << 26) - 1];
    let random = (0..100_000).map(|_| words.next_u64()).collect::<Vec<_>>();
    for word in edges.into_iter().chain(random) {
        let (radius, (x, y)) = (length(word), direction(word));
        let (x, y) = (radius * x, radius * y);
        let u = 1.0 - (word >> 26) as f64 / 2_f64.powi(38);
        let t = (word >> 2 & 0xff_ffff) as f64 / 2_f64.powi(23) - 1.0;
        let turn = std::f64::consts::FRAC_PI_4 * t;
        let (cosine, sine) = if word & 1 == 0 { (turn.cos(), turn.sin()) } else { (turn.sin(), turn.cos()) };
        let sign = if word & 2 == 0 { 1.0 } else { -1.0 };
        let length = sign * (-2.0 * u.ln()).sqrt();
        assert!((x - length * cosine).abs() < 1e-10 && (y - length * sine).abs() < 1e-10, "{word:x}");
    }
}

#[test]
fn uniform_samples_fill_the_unit_interval_evenly() {
    let mut stream = Uniform::new(3);
    let mut counts = [0_u32; 100];
    for _ in 0..1_000_000 {
        let sample = stream.next_sample();
        assert!((0.0..1.0).contains(&sample));
        counts[(sample * 100.0) as usize] += 1;
    }
    let chi_square: f64 = counts.iter().map(|&c| (f64::from(c) - 1e4).powi(2) / 1e4).sum();
    // 99 degrees of freedom: five standard deviations are 99 +- 70.
    assert!((29.0..169.0).contains(&chi_square), "{chi_square}");
}

#[test]
fn normal_samples_are_normal() {
    battery(400_000, 400_000, 400_000);
}

#[test]
#[ignore = "a hundred million samples: seconds in release, minutes otherwise"]
fn normal_samples_pass_the_whole_battery() {
    battery(100_000_000, 1_000_000, 20_000_000);
}

/// Moments and correlations on so many samples, Kolmogorov-Smirnov and Anderson-Darling on so many, chi-square on so
/// many. Each may be off by what happens once in a thousand thousand seeds.
fn battery(moments: usize, distribution: usize, bins: usize) {
    let mut stream = Gaussian::new(stream_seed(1, "battery"));
    moments_and_correlations(&mut stream, moments);
    kolmogorov_smirnov_and_anderson_darling(&mut stream, distribution);
    chi_square(&mut stream, bins);
}

fn moments_and_correlations(stream: &mut Gaussian, count: usize) {
    // 1 to 16, and the distances at which pairs of one transform and samples of one generator lie.
    let lags: Vec<usize> = (1..=16).chain([31, 32, 33, 64]).collect();
    let longest = 64;
    let block = 1 << 16;
    let mut x = vec![0.0; longest + block];
    stream.fill(&mut x[..longest]);
    let mut powers = [0.0; 8];
    let (mut products, mut squares) = (vec![0.0; lags.len()], vec![0.0; lags.len()]);
    let blocks = count / block;
    let n = (blocks * block) as f64;
    for _ in 0..blocks {
        stream.fill(&mut x[longest..]);
        let now = &x[longest..];
        for (k, sum) in powers.iter_mut().enumerate() {
            *sum += now.iter().map(|x| x.powi(k as i32 + 1)).sum::<f64>();
        }
        for (i, lag) in lags.iter().enumerate() {
            let then = &x[longest - lag..];
            products[i] += now.iter().zip(then).map(|(a, b)| a * b).sum::<f64>();
            squares[i] += now.iter().zip(then).map(|(a, b)| (a * a - 1.0) * (b * b - 1.0)).sum::<f64>();
        }
        x.copy_within(block.., 0);
    }
    let odd_factorial = |k: usize| (1..=k).step_by(2).map(|i| i as f64).product::<f64>();
    for (i, sum) in powers.iter().enumerate() {
        let k = i + 1;
        let mean = if k % 2 == 0 { odd_factorial(k - 1) } else { 0.0 };
        let variance = odd_factorial(2 * k - 1) - mean * mean;
        let off = (sum / n - mean) / (variance / n).sqrt();
        assert!(off.abs() < 5.0, "moment {k} is {off} standard deviations off");
    }
    for (lag, (product, square)) in lags.iter().zip(products.iter().zip(&squares)) {
        let off = (product / n.sqrt(), square / (2.0 * n.sqrt()));
        assert!(off.0.abs() < 5.0 && off.1.abs() < 5.0, "lag {lag}: {off:?} standard deviations");
    }
}

fn kolmogorov_smirnov_and_anderson_darling(stream: &mut Gaussian, count: usize) {
    let mut x = vec![0.0; count];
    stream.fill(&mut x);
    x.sort_by(f64::total_cmp);
    let n = count as f64;
    let mut distance = 0.0_f64;
    let mut sum = 0.0;
    for (i, x) in x.iter().enumerate() {
        let below = cumulative(*x);
        distance = distance.max((below - i as f64 / n).max((i + 1) as f64 / n - below));
        let i = i as f64;
        sum += (2.0 * i + 1.0) * below.ln() + (2.0 * (n - i) - 1.0) * cumulative(-x).ln();
    }
    // Kolmogorov's tail is 2 exp(-2 t^2); Anderson and Darling's is about 1e-6 at 12.
    assert!(distance * n.sqrt() < 2.7, "Kolmogorov-Smirnov {}", distance * n.sqrt());
    let a_squared = -n - sum / n;
    assert!(a_squared < 12.0, "Anderson-Darling {a_squared}");
}

fn chi_square(stream: &mut Gaussian, count: usize) {
    const BINS: usize = 1000;
    let edges: Vec<f64> = (1..BINS).map(|i| quantile(i as f64 / BINS as f64)).collect();
    let mut counts = [0.0; BINS];
    for _ in 0..count {
        let x = stream.next_sample();
        counts[edges.partition_point(|edge| *edge <= x)] += 1.0;
    }
    let expected = count as f64 / BINS as f64;
    let statistic: f64 = counts.iter().map(|c: &f64| (c - expected).powi(2) / expected).sum();
    let (mean, deviation) = ((BINS - 1) as f64, (2.0 * (BINS - 1) as f64).sqrt());
    assert!((statistic - mean).abs() < 5.0 * deviation, "chi-square {statistic}, 999 degrees of freedom");
}

/// The normal distribution function: its series near 0, its continued fraction in the tails.
fn cumulative(x: f64) -> f64 {
    let density = (-x * x / 2.0).exp() / std::f64::consts::TAU.sqrt();
    if x.abs() > 4.0 {
        let fraction = (1..60).rev().fold(0.0, |tail, k| f64::from(k) / (x.abs() + tail));
        let tail = density / (x.abs() + fraction);
        return if x < 0.0 { tail } else { 1.0 - tail };
    }
    let (mut term, mut sum, mut k) = (x, x, 1.0);
    while term.abs() > 1e-17 {
        k += 2.0;
        term *= x * x / k;
        sum += term;
    }
    0.5 + density * sum
}

/// Where the distribution function reaches `p`, by bisection.
fn quantile(p: f64) -> f64 {
    let (mut low, mut high) = (-9.0, 9.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if cumulative(middle) < p { low = middle } else { high = middle }
    }
    low
}
