use super::*;
use crate::noise::Gaussian;
use crate::prediction::reflection_to_ar;

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
    (0..order)
        .map(|k| std::array::from_fn(|lane| models[lane][k]))
        .collect()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn a_group_that_is_set_at_once_has_the_bits_of_its_voices_set_one_by_one() {
    let (mut at_once, mut one_by_one) = (WarpedBank::new(GROUP + 3), WarpedBank::new(GROUP + 3));
    for (turn, order) in [20, 20, 7, 32, 1, 17].into_iter().enumerate() {
        let (models, warping) = (models(order, turn), [0.85, 0.85, 0.6, 0.0][turn % 4]);
        let gain = std::array::from_fn(|lane| 0.5 + lane as f64);
        at_once.set_group(0, &rows(&models), warping, &gain).unwrap();
        for (lane, model) in models.iter().enumerate() {
            one_by_one
                .set_coefficients(lane, model, warping, gain[lane])
                .unwrap();
        }
        let mut e = vec![0.0; (GROUP + 3) * 100];
        Gaussian::new(turn as u64).fill(&mut e);
        let (mut a, mut b) = (e.clone(), e.clone());
        at_once.process(&e, &mut a);
        one_by_one.process(&e, &mut b);
        assert_eq!(bits(&a), bits(&b), "turn {turn}");
    }
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
