//! A crossover: one signal into bands that add up to it.

use haptograph_engine::frame::Linear;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Family, Io, Latency, NodeKind, Port, Processor, Tick,
};
use haptograph_signal::filter::{Biquad, Sections, SectionsState, butterworth_highpass, butterworth_lowpass};

use super::design_error;

haptograph_engine::settings! {
    /// Settings of [`Crossover`].
    pub struct CrossoverSettings {
        /// Frequencies at which one band passes into the next (-6 dB), ascending, below half the rate.
        at_hz: Vec<f64>;
        /// Names of the bands, from the lowest on: one more than frequencies.
        names: Vec<String>;
    }
}

haptograph_engine::node! {
    /// Splits a signal into bands, such as those of an actuator and of a loudspeaker. The slopes have 24 dB per octave. The
    /// sum of all bands is the input through an all-pass: every frequency has its magnitude, and neighbouring bands are in
    /// phase. `names` names the outputs: `"bands.low"`. The stated group delay is that of the sum at low frequencies.
    pub struct Crossover(CrossoverSettings) in "filters";
    source: "Linkwitz and Riley, \"Active crossover networks for noncoincident drivers\", JAES 24(1), 1976; bilinear \
                 transform, prewarped";
    example: r#""bands": Crossover(input: "texture.acceleration", at_hz: [60.0, 250.0], names: ["low", "middle", "high"])"#;
    in INPUT: Linear = Port::any("The signal.");
    out BANDS: Linear, Family =
        Port::like("input", "The part of the signal within a band.").named_by("names");
}

impl NodeKind for Crossover {
    fn members(settings: &CrossoverSettings) -> Result<Vec<String>, BuildError> {
        let (frequencies, names) = (settings.at_hz.len(), settings.names.len());
        if names != frequencies + 1 {
            let message = format!("the number of bands is {}, that of names {names}", frequencies + 1);
            let help = "n frequencies make n + 1 bands: give a name for each";
            return Err(BuildError::at("names", message).help(help));
        }
        Ok(settings.names.clone())
    }

    fn build(settings: CrossoverSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        refuse_disorder(&settings.at_hz)?;
        let crossings = settings.at_hz.iter().map(|at_hz| Crossing::at(*at_hz, cx.rate.hz()));
        let crossings: Vec<Crossing> = crossings.collect::<Result<_, _>>()?;
        let width = cx.width(Crossover::INPUT);
        let all_pass = aligned(&crossings);
        let lowest_hz = settings.at_hz.first().copied().unwrap_or(0.0);
        Ok(Built::new(Bands {
            lanes: vec![Lane::of(&crossings); width].into(),
            rest: vec![0.0; cx.max_frames].into(),
            band: vec![0.0; if width > 1 { cx.max_frames } else { 0 }].into(),
            latency: Latency::of_group(all_pass.group_delay_s(0.01 * lowest_hz, cx.rate.hz())),
        }))
    }

    fn memory_bytes(settings: &CrossoverSettings, cx: &BuildContext) -> u64 {
        let crossings = settings.at_hz.len() as u64;
        let sections = 4 * crossings + crossings * crossings.saturating_sub(1) / 2;
        let section_bytes = (size_of::<Biquad>() + size_of::<[f64; 2]>()) as u64;
        sections * section_bytes * cx.width(Crossover::INPUT) as u64
    }
}

/// Refuses frequencies that do not ascend from above zero.
fn refuse_disorder(at_hz: &[f64]) -> Result<(), BuildError> {
    let mut below = 0.0;
    for frequency_hz in at_hz {
        if *frequency_hz <= below {
            let message = format!("{frequency_hz} Hz is not above {below} Hz");
            return Err(BuildError::at("at_hz", message).help("give the frequencies in ascending order"));
        }
        below = *frequency_hz;
    }
    Ok(())
}

/// What separates two neighbouring bands. `LP² + HP²` of second-order Butterworth sections is an all-pass:
/// `(1 + s⁴) / D(s)² = D(-s) / D(s)` with `D(s) = s² + √2 s + 1`.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    low: Biquad,
    high: Biquad,
    all_pass: Biquad,
}

impl Crossing {
    fn at(at_hz: f64, rate_hz: f64) -> Result<Self, BuildError> {
        let low = butterworth_lowpass(2, at_hz, rate_hz).map_err(design_error("at_hz"))?;
        let high = butterworth_highpass(2, at_hz, rate_hz).map_err(design_error("at_hz"))?;
        let ([low], [high]) = (&*low.sections, &*high.sections) else {
            return Err(BuildError::at("at_hz", format!("no crossover can be made at {at_hz} Hz")));
        };
        let [a1, a2] = low.a;
        Ok(Self { low: *low, high: *high, all_pass: Biquad { b: [a2, a1, 1.0], a: low.a } })
    }
}

/// The all-passes of crossings, which a band below all of them needs to stay in phase with those above.
fn aligned(crossings: &[Crossing]) -> Sections {
    Sections { sections: crossings.iter().map(|crossing| crossing.all_pass).collect() }
}

/// The filters of one component.
#[derive(Debug, Clone)]
struct Lane {
    /// For each crossing what makes the band below it of the signal that is left, and what makes the rest above it.
    splits: Box<[(SectionsState, SectionsState)]>,
}

impl Lane {
    fn of(crossings: &[Crossing]) -> Self {
        let split = |(place, crossing): (usize, &Crossing)| {
            let mut band = aligned(&crossings[place + 1..]);
            band.sections.splice(..0, [crossing.low; 2]);
            let rest = Sections { sections: vec![crossing.high; 2] };
            (SectionsState::new(&band), SectionsState::new(&rest))
        };
        Self { splits: crossings.iter().enumerate().map(split).collect() }
    }
}

/// Takes one band after the other from the signal that is left.
#[derive(Debug, Clone)]
struct Bands {
    lanes: Box<[Lane]>,
    /// What is left of one component above the bands so far.
    rest: Box<[f64]>,
    /// A band of one component of several.
    band: Box<[f64]>,
    latency: Latency,
}

impl Processor<Crossover> for Bands {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Crossover>) {
        let (x, width) = (io.read(Crossover::INPUT), self.lanes.len());
        let rest = &mut self.rest[..tick.frames];
        for (component, lane) in self.lanes.iter_mut().enumerate() {
            let component_of = x.iter().skip(component).step_by(width);
            rest.iter_mut().zip(component_of).for_each(|(rest, x)| *rest = *x);
            for (member, (low, high)) in lane.splits.iter_mut().enumerate() {
                let y = io.write_member(Crossover::BANDS, member);
                match width {
                    1 => low.process(rest, y),
                    _ => {
                        let band = &mut self.band[..tick.frames];
                        low.process(rest, band);
                        put(band, y, component, width);
                    }
                }
                high.process_in_place(rest);
            }
            put(rest, io.write_member(Crossover::BANDS, lane.splits.len()), component, width);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        // Filters of other bands have other states.
        if self.lanes.first().map(|lane| lane.splits.len()) != new.lanes.first().map(|lane| lane.splits.len())
        {
            return;
        }
        let lanes = new.lanes.iter_mut().zip(&self.lanes);
        let splits = lanes.flat_map(|(new, old)| new.splits.iter_mut().zip(&old.splits));
        for ((new_low, new_high), (low, high)) in splits {
            new_low.copy_state_from(low);
            new_high.copy_state_from(high);
        }
    }

    fn latency(&self) -> Latency {
        self.latency
    }
}

/// Puts one component of several into frames.
fn put(component_of: &[f64], frames: &mut [f64], component: usize, width: usize) {
    let places = frames.iter_mut().skip(component).step_by(width);
    places.zip(component_of).for_each(|(y, x)| *y = *x);
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;
    use haptograph_signal::Complex64;
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 4000.0;

    fn settings(at_hz: &[f64]) -> CrossoverSettings {
        CrossoverSettings {
            at_hz: at_hz.to_vec(),
            names: (0..=at_hz.len()).map(|band| format!("band{band}")).collect(),
        }
    }

    /// The impulse response of each band, long enough to have decayed.
    fn impulses(at_hz: &[f64]) -> Vec<Vec<f64>> {
        let mut x = vec![0.0; 20_000];
        x[0] = 1.0;
        let mut bench = Bench::new::<Crossover>(settings(at_hz), RATE_HZ, &[Kind::SCALAR]).unwrap();
        bench.run_in_blocks(&[&x], &[1, 7, 300])
    }

    /// Its Fourier transform at a frequency.
    fn gain(impulse: &[f64], frequency_hz: f64) -> Complex64 {
        let each = impulse.iter().enumerate();
        each.map(|(k, y)| Complex64::from_polar(*y, -TAU * frequency_hz * k as f64 / RATE_HZ)).sum()
    }

    fn db(gain: Complex64) -> f64 {
        20.0 * gain.norm().log10()
    }

    /// Linkwitz and Riley's analogue responses at the frequency that the bilinear transform puts in its place.
    fn linkwitz_riley(at_hz: f64, frequency_hz: f64) -> [f64; 2] {
        let warped = |hz: f64| (0.5 * TAU * hz / RATE_HZ).tan();
        let ratio = (warped(frequency_hz) / warped(at_hz)).powi(4);
        [1.0 / (1.0 + ratio), ratio / (1.0 + ratio)]
    }

    #[test]
    fn the_bands_add_up_to_a_flat_magnitude() {
        for at_hz in [&[100.0][..], &[60.0, 250.0], &[40.0, 45.0, 200.0, 1900.0]] {
            let bands = impulses(at_hz);
            assert_eq!(bands.len(), at_hz.len() + 1);
            for step in 0..200 {
                let frequency_hz = 5.0 + 9.97 * f64::from(step);
                let sum: Complex64 = bands.iter().map(|band| gain(band, frequency_hz)).sum();
                assert!(db(sum).abs() < 1e-6, "{at_hz:?} at {frequency_hz} Hz: {} dB", db(sum));
            }
        }
    }

    #[test]
    fn each_band_has_its_slopes_and_6_db_less_at_its_ends() {
        let two = impulses(&[100.0]);
        for band in &two {
            assert!((db(gain(band, 100.0)) + 20.0 * 2.0_f64.log10()).abs() < 1e-6);
        }
        for frequency_hz in [20.0, 50.0, 90.0, 100.0, 300.0, 1500.0] {
            let wanted = linkwitz_riley(100.0, frequency_hz);
            for (band, wanted) in two.iter().zip(wanted) {
                assert!((gain(band, frequency_hz).norm() - wanted).abs() < 1e-9);
            }
        }
        let three = impulses(&[60.0, 250.0]);
        for frequency_hz in [10.0, 60.0, 120.0, 250.0, 1000.0] {
            let [low, above] = linkwitz_riley(60.0, frequency_hz);
            let [below, high] = linkwitz_riley(250.0, frequency_hz);
            // The all-pass of the crossing above changes no magnitude of the lowest band.
            for (band, wanted) in three.iter().zip([low, above * below, above * high]) {
                assert!((gain(band, frequency_hz).norm() - wanted).abs() < 1e-9, "{frequency_hz}");
            }
        }
    }

    #[test]
    fn neighbouring_bands_are_in_phase() {
        let bands = impulses(&[60.0, 250.0]);
        for frequency_hz in [30.0, 60.0, 120.0] {
            let turn = (gain(&bands[0], frequency_hz) / gain(&bands[1], frequency_hz)).arg();
            // The band between has the slopes of two crossings, whose all-pass the lowest has too.
            assert!(turn.abs() < 1e-6, "{turn} at {frequency_hz} Hz");
        }
    }

    #[test]
    fn components_do_not_mix_and_a_single_band_is_the_signal() {
        let x: Vec<f64> = (0..900).map(|k| (0.1 * f64::from(k * k)).sin()).collect();
        let mut vector = Bench::new::<Crossover>(settings(&[80.0, 300.0]), RATE_HZ, &[Kind::VECTOR]).unwrap();
        let bands = vector.run_in_blocks(&[&x], &[5, 64]);
        for component in 0..3 {
            let of = |all: &[f64]| -> Vec<f64> { all.iter().skip(component).step_by(3).copied().collect() };
            let mut scalar =
                Bench::new::<Crossover>(settings(&[80.0, 300.0]), RATE_HZ, &[Kind::SCALAR]).unwrap();
            let wanted = scalar.run(&[&of(&x)]);
            assert_eq!(bands.iter().map(|band| of(band)).collect::<Vec<_>>(), wanted);
        }
        let mut one = Bench::new::<Crossover>(settings(&[]), RATE_HZ, &[Kind::VECTOR]).unwrap();
        assert_eq!(one.run(&[&x]), [x]);
    }

    #[test]
    fn the_stated_delay_is_that_of_the_sum_at_low_frequencies() {
        let bench = Bench::new::<Crossover>(settings(&[60.0, 250.0]), RATE_HZ, &[Kind::SCALAR]).unwrap();
        let sum = |frequency_hz: f64| -> Complex64 {
            let bands = impulses(&[60.0, 250.0]);
            bands.iter().map(|band| gain(band, frequency_hz)).sum()
        };
        let (below, above) = (sum(0.55), sum(0.65));
        let delay_s = (below / above).arg() / (TAU * 0.1);
        let stated_s = bench.latency().group_delay_s;
        assert!((stated_s - delay_s).abs() < 1e-6, "{stated_s} s is stated, {delay_s} s found");
        // 2 √2 / ω of each all-pass, of the frequencies as the bilinear transform has them.
        let of_each = |at_hz: f64| 2.0_f64.sqrt() / (RATE_HZ * (0.5 * TAU * at_hz / RATE_HZ).tan());
        let wanted_s = of_each(60.0) + of_each(250.0);
        assert!((stated_s - wanted_s).abs() < 1e-3 * wanted_s, "{stated_s} s, not {wanted_s} s");
    }

    #[test]
    fn the_state_goes_to_filters_of_as_many_bands() {
        let x: Vec<f64> = (0..400).map(|k| (0.3 * f64::from(k * k)).sin()).collect();
        let bench =
            |at_hz: &[f64]| Bench::new::<Crossover>(settings(at_hz), RATE_HZ, &[Kind::SCALAR]).unwrap();
        let (mut old, mut new, mut other) = (bench(&[90.0]), bench(&[90.0]), bench(&[90.0, 200.0]));
        old.run(&[&x]);
        old.copy_state_into(&mut new);
        old.copy_state_into(&mut other);
        for bench in [&mut new, &mut other] {
            bench.skip_to(&old);
        }
        assert_eq!(new.run(&[&x]), old.run(&[&x]));
        let fresh = bench(&[90.0, 200.0]).run(&[&x]);
        assert_eq!(other.run(&[&x]), fresh);
    }

    #[test]
    fn what_makes_no_bands_is_refused_at_its_field() {
        let refused = |at_hz: &[f64], names: usize| {
            let settings = CrossoverSettings {
                names: (0..names).map(|band| format!("band{band}")).collect(),
                ..settings(at_hz)
            };
            Bench::new::<Crossover>(settings, RATE_HZ, &[Kind::SCALAR]).err().and_then(|error| error.field)
        };
        assert_eq!(refused(&[100.0], 2), None);
        assert_eq!(refused(&[100.0], 1), Some("names"));
        assert_eq!(refused(&[], 0), Some("names"));
        for at_hz in
            [[200.0, 100.0], [100.0, 100.0], [-1.0, 100.0], [0.0, 1.0], [100.0, 2000.0], [1.0, 1e300]]
        {
            assert_eq!(refused(&at_hz, 3), Some("at_hz"), "{at_hz:?}");
        }
    }
}
