use super::*;
use haptograph_signal::noise::Gaussian;

const RATE_HZ: f64 = 10_000.0;
const BAND_HZ: [f64; 2] = [8.0, 1000.0];
/// Noise of the accelerometer of the thesis's recording tool.
const NOISE_M_S2: f64 = 0.126;

fn record(actuator: &TwoMass, noise_m_s2: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let current = sweep_current(0.3, BAND_HZ, 10.0, RATE_HZ);
    let (mut machine, mut noise) = (actuator.machine(RATE_HZ), Gaussian::new(seed));
    let acceleration = current
        .iter()
        .map(|&i| {
            machine.advance(i, 0.0);
            machine.read().acceleration_m_s2 + noise_m_s2 * noise.next_sample()
        })
        .collect();
    (current, acceleration)
}

fn fit(actuator: &TwoMass, noise_m_s2: f64, known: Known) -> Result<Identified, IdentifyError> {
    let (current, acceleration) = record(actuator, noise_m_s2, 7);
    let sweep =
        Sweep { current_a: &current, acceleration_m_s2: &acceleration, rate_hz: RATE_HZ, band_hz: BAND_HZ };
    identify(&sweep, known)
}

fn values(p: &TwoMass) -> [f64; 7] {
    [
        p.force_n_per_a,
        p.magnet_kg,
        p.suspension_n_per_m,
        p.suspension_n_s_per_m,
        p.body_kg,
        p.hand_n_per_m,
        p.hand_n_s_per_m,
    ]
}

fn actuators() -> [TwoMass; 3] {
    let p = TwoMass::PLACEHOLDER;
    let light = TwoMass { magnet_kg: 0.009, body_kg: 0.03, hand_n_per_m: 900.0, ..p };
    let stiff = TwoMass { suspension_n_per_m: 5000.0, suspension_n_s_per_m: 1.8, hand_n_s_per_m: 5.0, ..p };
    [p, light, stiff]
}

#[test]
fn a_noisy_sweep_gives_all_parameters_within_5_percent() {
    for truth in actuators() {
        for known in [
            Known::Masses { magnet_kg: truth.magnet_kg, body_kg: truth.body_kg },
            Known::MagnetAndForce { magnet_kg: truth.magnet_kg, force_n_per_a: truth.force_n_per_a },
        ] {
            let found = fit(&truth, NOISE_M_S2, known).unwrap();
            for (x, y) in values(&found.parameters.unwrap()).iter().zip(values(&truth)) {
                assert!((x / y - 1.0).abs() < 0.05, "{found:?} for {truth:?}");
            }
        }
    }
}

#[test]
fn the_buffers_of_a_soundcard_change_nothing_but_the_delay() {
    let truth = TwoMass::PLACEHOLDER;
    let (current, acceleration) = record(&truth, NOISE_M_S2, 7);
    for late in [3, 12, 93, 2011] {
        let delayed: Vec<f64> =
            std::iter::repeat_n(0.0, late).chain(acceleration.iter().copied()).take(current.len()).collect();
        let sweep =
            Sweep { current_a: &current, acceleration_m_s2: &delayed, rate_hz: RATE_HZ, band_hz: BAND_HZ };
        let masses = Known::Masses { magnet_kg: truth.magnet_kg, body_kg: truth.body_kg };
        let found = identify(&sweep, masses).unwrap();
        for (x, y) in values(&found.parameters.unwrap()).iter().zip(values(&truth)) {
            assert!((x / y - 1.0).abs() < 0.05, "{late}: {found:?}");
        }
        assert!((found.delay_s * RATE_HZ - late as f64).abs() < 0.2, "{late}: {}", found.delay_s);
    }
}

#[test]
fn with_nothing_known_resonance_quality_and_gain_remain() {
    for truth in actuators() {
        let found = fit(&truth, NOISE_M_S2, Known::Nothing).unwrap();
        assert_eq!(found.parameters, None);
        assert!((found.response.gain / truth.response().gain - 1.0).abs() < 0.05);
        for (mode, expected) in found.modes.iter().zip(truth.response().modes().unwrap()) {
            assert!((mode.frequency_hz / expected.frequency_hz - 1.0).abs() < 0.05);
            assert!((mode.q / expected.q - 1.0).abs() < 0.05);
        }
        assert!(found.unexplained < 0.01, "{}", found.unexplained);
        assert!(found.delay_s.abs() < 2e-6, "a tick is held and averaged over itself: {}", found.delay_s);
    }
}

#[test]
fn one_known_mass_does_not_tell_two_actuators_apart() {
    // Two actuators on bodies of the same mass, with different magnets, that no current and acceleration can tell
    // apart.
    let first = TwoMass::PLACEHOLDER;
    let known = Known::Masses { magnet_kg: 1.5 * first.magnet_kg, body_kg: first.body_kg };
    let second = parameters(&first.response(), known).unwrap();
    assert!((second.suspension_n_per_m / first.suspension_n_per_m - 1.0).abs() > 0.2);
    for f_hz in [5.0, 20.0, 100.0, 300.0, 1000.0] {
        let (a, b) = (first.response().at(f_hz), second.response().at(f_hz));
        assert!((a - b).norm() < 1e-9 * a.norm());
    }
}

#[test]
fn a_fitted_actuator_is_compensated_within_3_db() {
    use super::super::compensator::{CORNER_HZ, Compensator, MOST_A_PER_M_S2};
    for truth in actuators() {
        let found = fit(&truth, NOISE_M_S2, Known::Nothing).unwrap();
        let compensator = Compensator::design(&found.response, CORNER_HZ, MOST_A_PER_M_S2, RATE_HZ).unwrap();
        let machine = truth.machine(RATE_HZ);
        for f_hz in (40..=500).map(f64::from) {
            let felt = compensator.filter().response(f_hz, RATE_HZ) * machine.response_at(f_hz);
            assert!((20.0 * felt.norm().log10()).abs() < 3.0);
        }
    }
}

#[test]
fn recordings_that_tell_nothing_are_refused() {
    let (current, acceleration) = record(&TwoMass::PLACEHOLDER, 0.0, 1);
    let sweep = |current_a, acceleration_m_s2, band_hz| {
        let sweep = Sweep { current_a, acceleration_m_s2, rate_hz: RATE_HZ, band_hz };
        identify(&sweep, Known::Nothing)
    };
    let silence = vec![0.0; current.len()];
    let mut noise = vec![0.0; current.len()];
    Gaussian::new(3).fill(&mut noise);
    assert!(matches!(sweep(&current, &acceleration[1..], BAND_HZ), Err(IdentifyError::Lengths { .. })));
    for (band_hz, rule) in [
        ([50.0, 5000.0], "below a quarter of that, 2500 Hz"),
        ([500.0, 50.0], "it has to rise"),
        ([0.0, 50.0], "above 0 Hz"),
    ] {
        let refused = sweep(&current, &acceleration, band_hz).unwrap_err();
        assert!(matches!(refused, IdentifyError::Band { .. }));
        assert!(refused.to_string().ends_with(rule), "{refused}");
    }
    assert!(matches!(sweep(&silence, &acceleration, BAND_HZ), Err(IdentifyError::NoSignal)));
    assert!(matches!(sweep(&current, &noise, BAND_HZ), Err(IdentifyError::NoFit { .. })));
    let mut broken = acceleration.clone();
    broken[500] = f64::NAN;
    assert_eq!(sweep(&current, &broken, BAND_HZ).unwrap_err(), IdentifyError::NotFinite { index: 500 });
    // One wrong cell of a table; it once took for ever.
    let wild = [1e300, -1e12].map(|wrong| {
        let mut wild = acceleration.clone();
        wild[500] = wrong;
        wild
    });
    for wild in &wild {
        let refused = sweep(&current, wild, BAND_HZ).unwrap_err();
        assert!(matches!(refused, IdentifyError::OutOfScale { what: "acceleration", .. }), "{refused}");
    }
}
