use super::*;
use crate::arma::warped::WarpedLattice;
use crate::noise::Gaussian;
use crate::prediction::tests::reflection_to_ar;
use crate::warped::power_gain;

const GROUP: usize = WarpedBank::GROUP;

/// Models of an order, one a lane, another for each `turn`.
fn models(order: usize, turn: usize) -> [Vec<f64>; GROUP] {
    std::array::from_fn(|lane| {
        let reflection = |k: usize| 0.7 * ((3 + lane + 5 * turn) as f64 * (k as f64 + 0.7)).sin();
        reflection_to_ar(&(0..order).map(reflection).collect::<Vec<_>>())
    })
}

fn rows(models: &[Vec<f64>; GROUP]) -> Vec<[f64; GROUP]> {
    let order = models[0].len();
    (0..order).map(|k| std::array::from_fn(|lane| models[lane][k])).collect()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn a_group_that_is_set_at_once_has_the_bits_of_its_voices_set_one_by_one() {
    for form in [Form::Lattice, Form::Direct] {
        let new = || VoiceBank::new(form, GROUP + 3);
        let (mut at_once, mut one_by_one) = (new(), new());
        for (turn, (p, q)) in [(20, 0), (20, 3), (7, 9), (32, 0), (1, 0), (17, 1)].into_iter().enumerate() {
            let (ar, ma) = (models(p, turn), models(q, turn + 1));
            let gain = std::array::from_fn(|lane| 0.5 + lane as f64);
            at_once.set_group(0, &rows(&ar), &rows(&ma), &gain).unwrap();
            for lane in 0..GROUP {
                let set = one_by_one.set_coefficients(lane, &ar[lane], &ma[lane], gain[lane]);
                set.unwrap();
            }
            let mut e = vec![0.0; (GROUP + 3) * 100];
            Gaussian::new(turn as u64).fill(&mut e);
            let (mut a, mut b) = (e.clone(), e.clone());
            at_once.process(&e, &mut a);
            one_by_one.process(&e, &mut b);
            assert_eq!(bits(&a), bits(&b), "{form:?}, turn {turn}");
        }
    }
}

#[test]
fn a_lattice_that_is_refused_leaves_its_group_what_it_has() {
    let mut bank = VoiceBank::new(Form::Lattice, GROUP);
    let (stable, mut broken) = (models(4, 0), models(4, 1));
    bank.set_group(0, &rows(&stable), &[], &[1.0; GROUP]).unwrap();
    let mut kept = bank.clone();
    broken[5] = vec![0.0, 0.0, 0.0, 1.5];
    let (wild, none) = ([[f64::NAN; GROUP]; 2], [[0.0; GROUP]; 0]);
    for (ar, ma, gain, lane) in [
        (&rows(&broken)[..], &none[..], 1.0, 5),
        (&[[0.0; GROUP]; 33], &none, 1.0, 0),
        (&rows(&stable), &wild, 1.0, 0),
        (&rows(&stable), &none, f64::INFINITY, 0),
    ] {
        assert_eq!(bank.set_group(0, ar, ma, &[gain; GROUP]).unwrap_err().0, lane);
    }
    assert_eq!(bank.set_group(1, &rows(&stable), &[], &[1.0; GROUP]), Ok(()));
    let e = vec![1.0; 10 * GROUP];
    let (mut a, mut b) = (e.clone(), e.clone());
    kept.process(&e, &mut a);
    bank.process(&e, &mut b);
    assert_eq!(bits(&a), bits(&b));
}

#[test]
fn a_warped_group_gives_each_voice_what_it_gives_alone() {
    let voices = 2 * GROUP + 3;
    let mut bank = WarpedBank::new(voices);
    let mut alone = vec![WarpedLattice::new(); voices];
    for (turn, frames) in [37, 1, 64, 100, 5, 293].into_iter().enumerate() {
        let mut e = vec![0.0; voices * frames];
        Gaussian::new(turn as u64).fill(&mut e);
        if turn == 4 {
            e[3] = f64::NAN;
        }
        let (mut out, mut wanted) = (e.clone(), e.clone());
        for group in 0..3 {
            let models = models([20, 7, 32, 1, 17][(group + turn) % 5], turn);
            let models =
                models.map(|ar| ar.iter().zip(1..).map(|(a, k)| a * 0.9_f64.powi(k)).collect::<Vec<_>>());
            let warping = [0.8, 0.0, 0.95][(group + turn / 2) % 3];
            let power = std::array::from_fn(|lane| lane as f64);
            bank.set_group(group, &rows(&models), warping, &power).unwrap();
            for (lane, filter) in alone.iter_mut().skip(group * GROUP).take(GROUP).enumerate() {
                filter.set_coefficients(&models[lane], warping, 1.0).unwrap();
                let deviation = (power[lane] / power_gain(&models[lane], warping).unwrap()).sqrt();
                let of_voice = e.iter().skip(group * GROUP + lane).step_by(voices);
                let mine: Vec<f64> = of_voice.map(|e| e * deviation).collect();
                let mut y = vec![0.0; frames];
                filter.process(&mine, &mut y);
                let places = wanted.iter_mut().skip(group * GROUP + lane).step_by(voices);
                places.zip(y).for_each(|(place, y)| *place = y);
            }
        }
        bank.process(&e, &mut out);
        for v in 0..voices {
            let of_voice = |y: &[f64]| y.iter().skip(v).step_by(voices).copied().collect::<Vec<_>>();
            let (got, wanted) = (of_voice(&out), of_voice(&wanted));
            let peak = wanted.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
            // Stage by stage the rounding is another than that of a matrix.
            let same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-10 * peak || a.is_nan() && b.is_nan();
            assert!(got.iter().zip(&wanted).all(same), "{turn}, voice {v}");
        }
    }
}

#[test]
fn blocks_change_no_bit_of_a_warped_bank() {
    let (voices, frames) = (GROUP + 3, 41 * 20);
    let mut e = vec![0.0; voices * frames];
    Gaussian::new(13).fill(&mut e);
    let render = |block: usize| {
        let mut bank = WarpedBank::new(voices);
        let mut y = vec![0.0; e.len()];
        for (turn, (e, y)) in e.chunks(41 * voices).zip(y.chunks_mut(41 * voices)).enumerate() {
            for group in 0..2 {
                let models = rows(&models(20, turn + group));
                bank.set_group(group, &models, 0.8, &[1.0; GROUP]).unwrap();
            }
            for (e, y) in e.chunks(block * voices).zip(y.chunks_mut(block * voices)) {
                bank.process(e, y);
            }
        }
        bits(&y)
    };
    let whole = render(41);
    assert!(render(1) == whole && render(7) == whole);
}

#[test]
fn neighbours_of_one_order_change_no_bit_of_a_voice() {
    let play = |neighbours: usize| {
        let mut bank = WarpedBank::new(GROUP);
        let mut samples = vec![];
        for turn in 0..5 {
            let mut chosen = models(20, turn);
            for (lane, model) in chosen.iter_mut().enumerate().skip(1) {
                model.clone_from(&models(20, turn + neighbours)[(lane * neighbours) % GROUP]);
            }
            bank.set_group(0, &rows(&chosen), 0.8, &[1.0; GROUP]).unwrap();
            let mut frames = vec![[0.0; GROUP]; 60];
            let mut own = [0.0; 60];
            Gaussian::new(turn as u64).fill(&mut own);
            Gaussian::new(neighbours as u64).fill(frames.as_flattened_mut());
            frames.iter_mut().zip(own).for_each(|(frame, e)| frame[0] = e);
            let given = frames.clone();
            bank.process(given.as_flattened(), frames.as_flattened_mut());
            samples.extend(frames.iter().map(|frame| frame[0].to_bits()));
        }
        samples
    };
    assert_eq!(play(1), play(2));
}

#[test]
fn a_group_with_an_unstable_voice_keeps_what_it_has() {
    let mut bank = WarpedBank::new(GROUP);
    let (stable, mut broken) = (models(4, 0), models(4, 1));
    bank.set_group(0, &rows(&stable), 0.8, &[1.0; GROUP]).unwrap();
    broken[5] = vec![0.0, 0.0, 0.0, 1.5];
    let refused = bank.set_group(0, &rows(&broken), 0.8, &[1.0; GROUP]).unwrap_err();
    assert_eq!(refused.0, 5);
    let mut kept = bank.clone();
    for refused in [
        bank.set_group(0, &[], 0.8, &[1.0; GROUP]),
        bank.set_group(0, &[[0.0; GROUP]; 33], 0.8, &[1.0; GROUP]),
        bank.set_group(0, &rows(&stable), 1.0, &[1.0; GROUP]),
        bank.set_group(0, &rows(&stable), 0.8, &[f64::NAN; GROUP]),
    ] {
        assert_eq!(refused.unwrap_err().0, 0);
    }
    assert_eq!(bank.set_group(1, &rows(&stable), 0.8, &[1.0; GROUP]), Ok(()));
    let mut fresh = WarpedBank::new(GROUP);
    fresh.set_group(0, &rows(&stable), 0.8, &[1.0; GROUP]).unwrap();
    let e = vec![1.0; 10 * GROUP];
    let (mut a, mut b) = (e.clone(), e.clone());
    kept.process(&e, &mut a);
    fresh.process(&e, &mut b);
    assert_eq!(bits(&a), bits(&b));
}
