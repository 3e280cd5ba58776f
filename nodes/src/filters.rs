//! Linear filters, applied to each component separately.

pub mod classical;
pub(crate) mod crossover;
pub(crate) mod section;

use haptograph_engine::frame::{Linear, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Fallback, Input, Io, Latency, LiveId, NodeKind, Optional, Output, Processor,
    Tick, next_change,
};
use haptograph_signal::filter::{DesignError, Prototype, Sections, SectionsState};

/// Largest number of frequencies of a design.
const MOST: usize = 2;

/// The signal before and behind a filter.
type Through<K> = (Input<K, Linear>, Output<K, Linear>);

/// A kind of node whose processor is a [`LaneFilter`].
pub(crate) trait FilterKind: NodeKind {
    /// Its frequencies in the order of the design's; none where the filter is fixed.
    const FREQUENCIES: &[Frequency<Self>] = &[];
    const PORTS: Through<Self>;
}

/// A cascade of second-order sections on each component of a linear signal.
#[derive(Debug, Clone)]
pub(crate) struct LaneFilter {
    lanes: Box<[SectionsState]>,
    /// Buffer for one component of the longest block.
    scratch: Box<[f64]>,
    latency: Latency,
    tuning: Option<Tuning>,
}

/// A frequency of a tunable filter: a live setting, and the input that replaces it, if there is one.
#[derive(Debug)]
pub(crate) struct Frequency<K: NodeKind> {
    setting: LiveId<K::Settings>,
    input: Option<Input<K, Scalar, Optional>>,
}

impl<K: NodeKind> Frequency<K> {
    /// This live setting.
    pub(crate) const fn of(setting: LiveId<K::Settings>) -> Self {
        Self { setting, input: None }
    }

    /// The setting of a fallback, and its input.
    pub(crate) const fn or_input(fallback: Fallback<K>) -> Self {
        Self { setting: fallback.setting, input: Some(fallback.input) }
    }
}

/// The frequencies of a tunable filter.
#[derive(Debug, Clone)]
struct Tuning {
    prototype: Prototype,
    rate_hz: f64,
    settings: [f64; MOST],
    /// The frequencies last requested. The sections keep their old ones where these give no filter.
    asked: [f64; MOST],
    /// True if one of the frequencies is a signal.
    follows: bool,
}

impl LaneFilter {
    /// A filter with fixed frequencies and zero state; its group delay is stated for `passband_hz`.
    pub(crate) fn fixed<K: FilterKind>(filter: &Sections, cx: &BuildContext, passband_hz: f64) -> Self {
        let width = cx.width(K::PORTS.0);
        let scratch = if width > 1 { cx.max_frames } else { 0 };
        Self {
            lanes: vec![SectionsState::new(filter); width].into(),
            scratch: vec![0.0; scratch].into(),
            latency: Latency::of_group(filter.group_delay_s(passband_hz, cx.rate.hz())),
            tuning: None,
        }
    }

    /// A tunable filter. Its group delay is unknown if a frequency is a signal.
    fn tuned<K: FilterKind>(
        prototype: Prototype,
        frequencies: [f64; MOST],
        cx: &BuildContext,
        passband_hz: f64,
    ) -> Result<Self, DesignError> {
        let rate_hz = cx.rate.hz();
        let sections = prototype.at(frequencies, rate_hz)?.into();
        let mut filter = Self::fixed::<K>(&sections, cx, passband_hz);
        let mut inputs = K::FREQUENCIES.iter().filter_map(|frequency| frequency.input);
        let follows = inputs.any(|input| cx.is_connected(input));
        if follows {
            filter.latency = Latency::default();
        }
        filter.tuning =
            Some(Tuning { prototype, rate_hz, settings: frequencies, asked: frequencies, follows });
        Ok(filter)
    }

    /// Tunes the sections to other frequencies if these give a filter.
    fn turn(&mut self, asked: [f64; MOST]) {
        let Some(tuning) = self.tuning.as_mut().filter(|tuning| tuning.asked != asked) else {
            return;
        };
        tuning.asked = asked;
        let rate_hz = tuning.rate_hz;
        let sections = match tuning.prototype.at(asked, rate_hz) {
            // Tune to the nearest frequencies that the coefficients can represent.
            Err(DesignError::Extreme { lowest_hz, .. }) => {
                let least_hz = lowest_hz * (1.0 + 1e-9);
                let nearest = asked.map(|hz| hz.clamp(least_hz, 0.5 * rate_hz - least_hz));
                tuning.prototype.at(nearest, rate_hz)
            }
            designed => designed,
        };
        if let Ok(sections) = sections {
            self.lanes.iter_mut().for_each(|lane| lane.turn(&sections));
        }
    }

    /// Filters component by component.
    fn filter(&mut self, x: &[f64], y: &mut [f64]) {
        if let [only] = &mut *self.lanes {
            only.process(x, y);
            return;
        }
        let width = self.lanes.len();
        for (lane, filter) in self.lanes.iter_mut().enumerate() {
            let scratch = &mut self.scratch[..x.len() / width];
            for (s, x) in scratch.iter_mut().zip(x.chunks_exact(width)) {
                *s = x[lane];
            }
            filter.process_in_place(scratch);
            for (s, y) in scratch.iter().zip(y.chunks_exact_mut(width)) {
                y[lane] = *s;
            }
        }
    }

    /// Filters with frequencies of which some are signals.
    fn follow(&mut self, signals: [Option<&[f64]>; MOST], x: &[f64], y: &mut [f64]) {
        let width = self.lanes.len();
        let (frames, mut from) = (x.len() / width, 0);
        while from < frames {
            let end = next_change(&signals, from, frames);
            if let Some(tuning) = &self.tuning {
                let mut asked = tuning.asked;
                for (i, asked) in asked.iter_mut().enumerate() {
                    *asked = match signals[i].map(|signal| signal[from]) {
                        Some(hz) if hz.is_finite() => within(hz, tuning.rate_hz),
                        Some(_) => *asked,
                        None => tuning.settings[i],
                    };
                }
                self.turn(asked);
            }
            let lanes = from * width..end * width;
            self.filter(&x[lanes.clone()], &mut y[lanes]);
            from = end;
        }
    }
}

/// Clamps a frequency signal: from a millionth of the rate to well below half of it, so that the states, which alternate from
/// sample to sample there, are not large when the frequency falls.
fn within(hz: f64, rate_hz: f64) -> f64 {
    hz.clamp(1e-6 * rate_hz, 0.45 * rate_hz)
}

impl<K: FilterKind> Processor<K> for LaneFilter {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, K>) {
        let x = io.read(K::PORTS.0);
        if !self.tuning.as_ref().is_some_and(|tuning| tuning.follows) {
            return self.filter(x, io.write(K::PORTS.1));
        }
        let signals = std::array::from_fn(|i| io.read(K::FREQUENCIES.get(i)?.input?));
        self.follow(signals, x, io.write(K::PORTS.1));
    }

    fn set(&mut self, setting: LiveId<K::Settings>, value: f64) {
        let Some(tuning) = self.tuning.as_mut().filter(|_| value.is_finite()) else {
            return;
        };
        for (known, frequency) in tuning.settings.iter_mut().zip(K::FREQUENCIES) {
            if frequency.setting == setting {
                *known = value;
            }
        }
        // A frequency signal is applied when it is read.
        if !tuning.follows {
            let settings = tuning.settings;
            self.turn(settings);
        }
    }

    fn cascade(&mut self) -> Option<&mut SectionsState> {
        match (&mut *self.lanes, &self.tuning) {
            (_, Some(tuning)) if tuning.follows => None,
            ([only], _) => Some(only),
            _ => None,
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        let (Some(old_tuning), Some(tuning)) = (&self.tuning, &mut new.tuning) else {
            for (new, old) in new.lanes.iter_mut().zip(&self.lanes) {
                new.copy_state_from(old);
            }
            return;
        };
        if tuning.prototype != old_tuning.prototype {
            return;
        }
        if tuning.rate_hz != old_tuning.rate_hz {
            // At another rate these sections have other frequencies.
            for (new, old) in new.lanes.iter_mut().zip(&self.lanes) {
                new.copy_state_from(old);
            }
            return;
        }
        // The new filter takes over the state and then tunes to its own frequencies.
        tuning.asked = old_tuning.asked;
        let (settings, follows) = (tuning.settings, tuning.follows);
        for (new, old) in new.lanes.iter_mut().zip(&self.lanes) {
            new.take_over(old);
        }
        if !follows {
            new.turn(settings);
        }
    }

    fn latency(&self) -> Latency {
        self.latency
    }
}

/// The error of an impossible design, at the setting that has to change.
pub(crate) fn design_error(cutoff_field: &'static str) -> impl Fn(DesignError) -> BuildError {
    move |error| match &error {
        DesignError::Order { .. } => BuildError::at("order", error.to_string()),
        DesignError::EmptyBand { .. } => BuildError::at("low_hz", error.to_string()).help("swap the edges"),
        DesignError::NarrowBand { .. } => BuildError::at("low_hz", error.to_string()),
        DesignError::Extreme { frequency_hz, rate_hz, .. } if frequency_hz / rate_hz < 0.25 => {
            BuildError::at(cutoff_field, error.to_string())
                .help("raise it, or run the node on a slower clock")
        }
        DesignError::Cutoff { .. } | DesignError::Rate { .. } | DesignError::Extreme { .. } => {
            BuildError::at(cutoff_field, error.to_string())
                .help("lower it, or run the node on a faster clock")
        }
    }
}
