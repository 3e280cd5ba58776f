use super::*;
use rand_xoshiro::Xoshiro256PlusPlus;

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
    let edges = [
        (0, 0),
        (u64::MAX, u64::MAX),
        (0, u64::MAX),
        (u64::MAX, 0),
        (1 << 12, 1 << 11),
    ];
    let random = (0..100_000)
        .map(|_| (words.next_u64(), words.next_u64()))
        .collect::<Vec<_>>();
    for (radius, angle) in edges.into_iter().chain(random) {
        let (x, y) = normal_pair(radius, angle);
        let u = 1.0 - (radius >> 12) as f64 / 2_f64.powi(52);
        let t = (angle >> 12) as f64 / 2_f64.powi(51) - 1.0;
        let turn = std::f64::consts::FRAC_PI_4 * t;
        let (cosine, sine) = if angle & 0x800 == 0 {
            (turn.cos(), turn.sin())
        } else {
            (turn.sin(), turn.cos())
        };
        let length = if angle & 0x400 == 0 { 1.0 } else { -1.0 } * (-2.0 * u.ln()).sqrt();
        assert!(
            (x - length * cosine).abs() < 1e-10 && (y - length * sine).abs() < 1e-10,
            "{radius} {angle}"
        );
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
