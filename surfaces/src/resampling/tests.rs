use super::*;
use crate::files::hatt::tests::real_files::{AT_1_KHZ, AT_10_KHZ, hatt_files};
use crate::files::load;
use crate::hull::Hull;
use crate::{Provenance, VertexKind};
use std::f64::consts::TAU;

/// A 10 kHz texture with `resonances` (Hz, radius) that vary a little between models.
fn texture(resonances: &[(f64, f64)]) -> TextureModel {
    let measured = (0..6).map(|k| {
        let mut ar = vec![];
        for &(frequency_hz, radius) in resonances {
            let angle = TAU * frequency_hz * (1.0 + 0.03 * f64::from(k)) / 10_000.0;
            let pair = [1.0, -2.0 * radius * angle.cos(), radius * radius];
            let product: Vec<f64> = (0..ar.len() + 3)
                .map(|n| {
                    (0..3)
                        .map(|j| {
                            pair[j]
                                * match n.checked_sub(j) {
                                    Some(0) => 1.0,
                                    Some(m) => ar.get(m - 1).copied().unwrap_or(0.0),
                                    None => 0.0,
                                }
                        })
                        .sum()
                })
                .collect();
            ar = product[1..].to_vec();
        }
        let model = ArmaModel::from_ar(&ar, 0.5 + f64::from(k)).unwrap();
        let (speed_m_s, force_n) = (0.03 + 0.02 * f64::from(k), 0.4 + 0.3 * f64::from((k * 2) % 5));
        ModelAt { speed_m_s, force_n, model, kind: VertexKind::Measured }
    });
    TextureModel::from_measured(10_000.0, measured.collect(), &Hull::default()).unwrap()
}

fn tame() -> TextureModel {
    texture(&[(180.0, 0.97), (800.0, 0.95), (1850.0, 0.93), (2750.0, 0.92), (3700.0, 0.92), (4600.0, 0.92)])
}

#[test]
fn the_spectral_refit_is_within_a_tenth_of_a_decibel_at_any_rate() {
    for rate_hz in [5000.0, 3333.3, 2000.0, 1000.0] {
        let resampled = resample(&tame(), rate_hz, Method::Spectral).unwrap();
        assert!(resampled.worst.db.abs() < 0.1, "{rate_hz}: {:?}", resampled.worst);
        assert_eq!((resampled.texture.rate_hz(), resampled.texture.ma_order()), (rate_hz, 0));
    }
}

#[test]
fn holding_keeps_the_gain_at_zero_frequency() {
    // A step input is a step with and without hold; the variance scales with the rate.
    let texture = tame();
    let resampled = resample(&texture, 1000.0, Method::Zoh).unwrap().texture;
    for (old, new) in texture.models().iter().zip(resampled.models()) {
        let ratio = new.model.power_gain_at(0.0) / old.model.power_gain_at(0.0);
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
        assert!((new.model.variance() - old.model.variance() / 10.0).abs() < 1e-15);
    }
}

#[test]
fn the_hold_is_the_held_filter() {
    // Both filters process an input that changes every tenth sample. Without reflected zeros the outputs are
    // equal; with them the spectra are equal, as the power of the outputs shows.
    let texture = texture(&[(180.0, 0.97), (310.0, 0.96)]);
    let model = texture.models()[0].model.clone();
    let slow = zoh::resample(&model, 10).unwrap();
    let run = |model: &ArmaModel, input: &mut dyn FnMut(usize) -> f64, length: usize| -> Vec<f64> {
        let (mut out, mut inputs) = (Vec::<f64>::new(), Vec::<f64>::new());
        for n in 0..length {
            inputs.push(input(n));
            let ma = model.ma().iter().zip(inputs[..n].iter().rev()).map(|(b, e)| b * e).sum::<f64>();
            let ar = model.ar().iter().zip(out[..n].iter().rev()).map(|(a, y)| a * y).sum::<f64>();
            out.push(model.gain() * (inputs[n] + ma) - ar);
        }
        out
    };
    let held = run(&model, &mut |n| f64::from(n < 10), 4000);
    let fast_energy: f64 = held.iter().step_by(10).map(|y| y * y).sum();
    let direct = run(&slow, &mut |n| f64::from(n == 0), 400);
    let slow_energy: f64 = direct.iter().map(|y| y * y).sum();
    assert!((slow_energy / fast_energy - 1.0).abs() < 1e-9, "{slow_energy} {fast_energy}");
}

#[test]
fn the_toolkits_way_has_two_zeros_less_than_poles() {
    let wide = texture(&[
        (180.0, 0.97),
        (800.0, 0.95),
        (1300.0, 0.94),
        (1850.0, 0.93),
        (2750.0, 0.92),
        (3700.0, 0.92),
        (4600.0, 0.92),
    ]);
    let resampled = resample(&wide, 1000.0, Method::Hatt).unwrap();
    assert_eq!((resampled.texture.ar_order(), resampled.texture.ma_order()), (14, 12));
    assert!(resampled.worst.db < -2.0, "{:?}", resampled.worst);
}

#[test]
fn sharp_resonances_keep_their_power_when_refit() {
    let resampled = resample(&texture(&[(150.0, 0.9995), (330.0, 0.999)]), 1000.0, Method::Spectral).unwrap();
    assert!(resampled.worst.db.abs() < 0.1, "{:?}", resampled.worst);
}

#[test]
fn what_cannot_be_resampled_is_refused_with_a_way_out() {
    let texture = tame();
    for method in [Method::Zoh, Method::Hatt, Method::Spectral] {
        let error = resample(&texture, 50.0, method).unwrap_err();
        assert_eq!(error, ResampleError::EmptyBand { rate_hz: 50.0 });
    }
    let error = resample(&texture, 3000.0, Method::Zoh).unwrap_err();
    assert_eq!(
        error.to_string(),
        "10000 Hz is not a whole multiple of 3000 Hz, which `zoh` needs; use `spectral`, or a rate such as 2500 or \
         3333.3333333333335 Hz"
    );
    assert!(matches!(resample(&texture, 7000.0, Method::Hatt), Err(ResampleError::NotWhole { .. })));
    assert!(matches!(resample(&texture, 10_000.0, Method::Spectral), Err(ResampleError::NotLower { .. })));
    assert!(matches!(resample(&texture, f64::NAN, Method::Spectral), Err(ResampleError::NotLower { .. })));
    let held = resample(&texture, 1000.0, Method::Zoh).unwrap().texture;
    assert!(matches!(resample(&held, 500.0, Method::Hatt), Err(ResampleError::HasMovingAverage { .. })));
    assert_eq!(resample(&held, 500.0, Method::Zoh).map(|_| ()), Ok(()));
    let empty = Surface::new("", Provenance::new(crate::Origin::Procedural, ""));
    assert!(matches!(resample_surface(&empty, 100.0, Method::Zoh), Err(ResampleError::NoTexture)));
}

#[test]
fn the_provenance_says_how() {
    let mut surface = Surface::new("", Provenance::new(crate::Origin::Procedural, ""));
    surface.texture = Some(tame());
    let (once, _) = resample_surface(&surface, 5000.0, Method::Spectral).unwrap();
    let (twice, _) = resample_surface(&once, 1000.0, Method::Zoh).unwrap();
    let expected = "from 10000 Hz to 5000 Hz by spectral, then from 5000 Hz to 1000 Hz by zoh";
    assert_eq!(twice.provenance.settings["resampled"], expected);
}

#[test]
#[allow(clippy::print_stderr)]
fn the_toolkits_own_1_khz_files_come_out() {
    let (mut ar, mut ma, mut gain, mut variance) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let mut count = 0;
    for (fast, slow) in hatt_files(AT_10_KHZ).iter().zip(hatt_files(AT_1_KHZ)) {
        let made = resample(&load(fast).unwrap().texture.unwrap(), 1000.0, Method::Hatt).unwrap().texture;
        let shipped = load(&slow).unwrap().texture.unwrap();
        assert_eq!(made.ma_order(), shipped.ma_order());
        for (made, shipped) in made.models().iter().zip(shipped.models()) {
            let (made, shipped) = (&made.model, &shipped.model);
            let largest =
                |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            ar = ar.max(largest(made.ar(), shipped.ar()));
            ma = ma.max(largest(made.ma(), shipped.ma()));
            gain = gain.max((made.gain() - shipped.gain()).abs());
            variance = variance.max((made.variance() - shipped.variance()).abs());
            count += 1;
        }
    }
    if count > 0 {
        eprintln!("{count} models: AR {ar:e}, MA {ma:e}, gain {gain:e}, variance {variance:e}");
        assert!(ar < 1e-6 && ma < 1e-6 && gain < 2e-6 && variance < 1e-6);
    }
}

#[test]
#[ignore = "minutes: all models of the toolkit by each method"]
#[allow(clippy::print_stderr)]
fn how_close_each_method_comes_on_the_toolkits_files() {
    for method in [Method::Zoh, Method::Hatt, Method::Spectral] {
        let mut worst: Vec<f64> = hatt_files(AT_10_KHZ)
            .iter()
            .map(|file| resample(&load(file).unwrap().texture.unwrap(), 1000.0, method).unwrap().worst.db)
            .collect();
        worst.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        if let (Some(median), Some(last)) = (worst.get(worst.len() / 2), worst.last()) {
            eprintln!("{}: median of the worst {median:.3} dB, worst {last:.3} dB", method.name());
            assert!(method != Method::Spectral || last.abs() < 0.1);
        }
    }
}
