//! Conditions a measured wrench: subtracts its zero and filters its noise.

use crate::filters::design_error;
use crate::vector::norm;
use haptograph_engine::node::BuildError;
use haptograph_signal::filter::{SectionsState, butterworth_lowpass};
use haptograph_signal::time::Rate;

/// Force and torque, N and N m.
pub(super) type Wrench = [f64; 6];

/// Subtracts a zero from measurements, and filters them.
///
/// The zero is the mean over a time with steady force and torque and a small force: a hand on the sensor would otherwise
/// cause a false contact of the opposite sign for the rest of the run. Until the zero is known the output is zero.
#[derive(Debug, Clone)]
pub(super) struct Conditioner {
    zeroing: Option<Zeroing>,
    zero: Wrench,
    /// Gain of the output; it rises from 0 when the zero is known, so that the output does not jump.
    reach: f64,
    /// True if a measurement has arrived since the conditioner was built.
    was_heard: bool,
    reach_per_tick: f64,
    filters: Option<[SectionsState; 6]>,
    group_delay_s: f64,
    wrench: Wrench,
}

/// Conditions for a mean to be the zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ZeroSettings {
    /// Time of the mean, s; 0: the device subtracts its own zero.
    pub window_s: f64,
    /// Largest force that can be an offset, N.
    pub within_n: f64,
    /// Largest change of a force within the time, N; of a torque, this times [`LEVER_M`].
    pub steady_n: f64,
}

/// Lever that converts a bound on forces to one on torques, m.
const LEVER_M: f64 = 0.05;
/// Smallest number of measurements that shows steadiness.
const LEAST_PACKETS: u64 = 8;
/// Rise time of the output after the zero is known, s.
const RAMP_S: f64 = 0.01;

/// The mean in progress.
#[derive(Debug, Clone)]
struct Zeroing {
    settings: ZeroSettings,
    ticks: u64,
    /// Ticks since its start, and those of them with a new measurement.
    seen: u64,
    packets: u64,
    sum: Wrench,
    least: Wrench,
    most: Wrench,
}

/// Change of the zero in a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ZeroNews {
    /// The zero was taken.
    Taken(Wrench),
    /// Something moved or pressed during the time: the mean restarts.
    Refused,
}

impl Zeroing {
    fn new(settings: ZeroSettings, ticks: u64) -> Self {
        Self {
            settings,
            ticks,
            seen: 0,
            packets: 0,
            sum: [0.0; 6],
            least: [f64::INFINITY; 6],
            most: [f64::NEG_INFINITY; 6],
        }
    }

    fn take(&mut self, measured: Wrench, is_news: bool) -> Option<ZeroNews> {
        self.seen += 1;
        if is_news {
            self.packets += 1;
            for (lane, x) in measured.into_iter().enumerate() {
                self.sum[lane] += x;
                self.least[lane] = self.least[lane].min(x);
                self.most[lane] = self.most[lane].max(x);
            }
        }
        if self.seen < self.ticks || self.packets < LEAST_PACKETS {
            return None;
        }
        let mean = self.sum.map(|sum| sum / self.packets as f64);
        let news = if self.is_steady() && norm([mean[0], mean[1], mean[2]]) <= self.settings.within_n {
            ZeroNews::Taken(mean)
        } else {
            ZeroNews::Refused
        };
        *self = Self::new(self.settings, self.ticks);
        Some(news)
    }

    fn is_steady(&self) -> bool {
        let changes = self.most.iter().zip(&self.least).map(|(most, least)| most - least);
        let bounds = [1.0, 1.0, 1.0, LEVER_M, LEVER_M, LEVER_M].map(|lever| lever * self.settings.steady_n);
        changes.zip(bounds).all(|(change, bound)| change <= bound)
    }
}

/// Poles of the low-pass.
const ORDER: usize = 2;

impl Conditioner {
    /// A conditioner that takes a zero and low-passes at a cut-off.
    pub(super) fn new(zero: ZeroSettings, cutoff_hz: Option<f64>, rate: Rate) -> Result<Self, BuildError> {
        let ticks = (zero.window_s * rate.hz()).ceil() as u64;
        let design = |cutoff_hz| butterworth_lowpass(ORDER, cutoff_hz, rate.hz());
        let filter = cutoff_hz.map(design).transpose().map_err(design_error("wrench_cutoff_hz"))?;
        let filter = filter.as_ref();
        Ok(Self {
            zeroing: (ticks > 0).then(|| Zeroing::new(zero, ticks)),
            zero: [0.0; 6],
            reach: if ticks > 0 { 0.0 } else { 1.0 },
            was_heard: false,
            reach_per_tick: rate.period_s() / RAMP_S,
            group_delay_s: filter.map_or(0.0, |filter| filter.group_delay_s(1.0, rate.hz())),
            filters: filter.map(|filter| std::array::from_fn(|_| SectionsState::new(filter))),
            wrench: [0.0; 6],
        })
    }

    /// Takes a zero that is known already in place of one of its own, if it takes one.
    pub(super) fn start_from(&mut self, known: Wrench) {
        if self.zeroing.take().is_some() {
            self.zero = known;
        }
    }

    /// Advances one tick with a measurement, new or not. `is_heard` is false while the device is silent.
    pub(super) fn advance(&mut self, measured: Wrench, is_heard: bool, is_news: bool) -> Option<ZeroNews> {
        self.was_heard |= is_heard;
        let news = match &mut self.zeroing {
            Some(zeroing) if is_heard => zeroing.take(measured, is_news),
            _ => None,
        };
        if let Some(ZeroNews::Taken(zero)) = news {
            (self.zero, self.zeroing) = (zero, None);
        }
        if self.zeroing.is_some() || !self.was_heard {
            return news;
        }
        self.reach = (self.reach + self.reach_per_tick).min(1.0);
        for (lane, x) in measured.into_iter().enumerate() {
            let x = self.reach * (x - self.zero[lane]);
            self.wrench[lane] = match &mut self.filters {
                Some(filters) => {
                    let mut y = [x];
                    filters[lane].process_in_place(&mut y);
                    y[0]
                }
                None => x,
            };
        }
        news
    }

    /// The conditioned wrench; zero until the zero is known.
    pub(super) fn wrench(&self) -> &Wrench {
        &self.wrench
    }

    /// Delay of the filter, s.
    pub(super) fn group_delay_s(&self) -> f64 {
        self.group_delay_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn conditioner(window_s: f64, cutoff_hz: Option<f64>, known: Option<Wrench>) -> Conditioner {
        let zero = ZeroSettings { window_s, within_n: 10.0, steady_n: 0.2 };
        let mut conditioner = Conditioner::new(zero, cutoff_hz, Rate::new(1000, 1).unwrap()).unwrap();
        known.into_iter().for_each(|zero| conditioner.start_from(zero));
        conditioner
    }

    /// An offset with some noise, and a force along z.
    fn measured(tick: usize, z_n: f64) -> Wrench {
        let noise = if tick.is_multiple_of(2) { 0.01 } else { -0.01 };
        [5.0 + noise, 0.0, z_n - 8.0, 0.0, 0.2, 0.0]
    }

    #[test]
    fn the_mean_of_what_is_heard_first_is_taken_off() {
        let mut sensor = conditioner(0.1, None, None);
        (0..50).for_each(|_| assert_eq!(sensor.advance([0.0; 6], false, false), None));
        for tick in 0..99 {
            assert_eq!(sensor.advance(measured(tick, 0.0), true, true), None);
            assert_eq!(*sensor.wrench(), [0.0; 6]);
        }
        let news = sensor.advance(measured(99, 0.0), true, true);
        let Some(ZeroNews::Taken(zero)) = news else {
            panic!("{news:?}");
        };
        assert!((zero[0] - 5.0).abs() < 1e-9 && (zero[2] + 8.0).abs() < 1e-9);
        (0..20).for_each(|tick| _ = sensor.advance(measured(tick, 0.0), true, true));
        sensor.advance([5.0, 0.0, -9.0, 0.0, 0.2, 0.0], true, true);
        let [x, _, z, _, torque, _] = *sensor.wrench();
        assert!(x.abs() < 1e-9 && (z + 1.0).abs() < 1e-9 && torque.abs() < 1e-9);
    }

    #[test]
    fn a_hand_on_the_sensor_gives_no_zero() {
        let mut sensor = conditioner(0.1, None, None);
        // It presses, wavers, and lets go in the middle of the third time.
        let hand = |tick: usize| match tick {
            0..250 => 1.5 + 0.3 * (0.06 * tick as f64).sin(),
            _ => 0.0,
        };
        let mut news = Vec::new();
        let mut before = 0.0;
        for tick in 0..400 {
            news.extend(sensor.advance(measured(tick, hand(tick)), true, true));
            assert!((sensor.wrench()[2] - before).abs() < 0.05, "no leap at {tick}");
            before = sensor.wrench()[2];
        }
        let [ZeroNews::Refused, ZeroNews::Refused, ZeroNews::Refused, ZeroNews::Taken(zero)] = news[..]
        else {
            panic!("{news:?}");
        };
        assert!((zero[2] + 8.0).abs() < 1e-9, "no phantom contact: {zero:?}");
        // What is as steady as an offset but heavier than one can be is none either.
        let mut sensor = conditioner(0.1, None, None);
        let heavy = (0..100).find_map(|tick| sensor.advance(measured(tick, -3.0), true, true));
        assert_eq!(heavy, Some(ZeroNews::Refused));
    }

    #[test]
    fn a_known_zero_is_taken_at_once_and_not_anew() {
        let mut sensor = conditioner(0.1, None, Some([5.0, 0.0, -8.0, 0.0, 0.2, 0.0]));
        for tick in 0..300 {
            assert_eq!(sensor.advance([5.0, 0.0, -7.0, 0.0, 0.2, 0.0], true, true), None, "{tick}");
            // It rises within the time of the ramp.
            let expected = (0.1 * (tick + 1) as f64).min(1.0);
            assert!((sensor.wrench()[2] - expected).abs() < 1e-9, "{tick}");
        }
    }

    #[test]
    fn nothing_is_felt_of_a_known_zero_before_the_sensor_is_heard() {
        let mut sensor = conditioner(0.1, Some(20.0), Some([0.0, 0.0, -8.0, 0.0, 0.0, 0.0]));
        for _ in 0..500 {
            sensor.advance([0.0; 6], false, false);
            assert_eq!(*sensor.wrench(), [0.0; 6]);
        }
        for _ in 0..200 {
            sensor.advance([0.0, 0.0, -8.0, 0.0, 0.0, 0.0], true, true);
            assert_eq!(*sensor.wrench(), [0.0; 6], "nothing touches");
        }
    }

    #[test]
    fn one_packet_shows_nothing_of_a_steady_sensor() {
        let mut sensor = conditioner(0.1, None, None);
        for tick in 0..1000 {
            assert_eq!(sensor.advance([0.0, 0.0, 3.0, 0.0, 0.0, 0.0], true, tick % 150 == 0), None);
        }
    }

    #[test]
    fn it_is_the_wrench_itself_where_nothing_is_asked_for() {
        let mut sensor = conditioner(0.0, None, Some([1.0; 6]));
        sensor.advance([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], true, true);
        assert_eq!(*sensor.wrench(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(sensor.group_delay_s(), 0.0);
    }

    #[test]
    fn noise_is_filtered_and_a_steady_force_stays() {
        let mut sensor = conditioner(0.0, Some(20.0), None);
        let mut largest: f64 = 0.0;
        for tick in 0..2000 {
            let noise = if tick % 2 == 0 { 0.1 } else { -0.1 };
            sensor.advance([1.0 + noise, 0.0, 0.0, 0.0, 0.0, 0.0], true, true);
            if tick > 1000 {
                largest = largest.max((sensor.wrench()[0] - 1.0).abs());
            }
        }
        assert!(largest < 1e-3, "{largest}");
        // Of a second-order Butterworth low-pass: sqrt(2) / (2 pi cut-off).
        assert!((sensor.group_delay_s() - 0.0113).abs() < 1e-4);
        let zero = ZeroSettings { window_s: 0.0, within_n: 10.0, steady_n: 0.2 };
        let refused = Conditioner::new(zero, Some(600.0), Rate::new(1000, 1).unwrap());
        assert_eq!(refused.unwrap_err().field, Some("wrench_cutoff_hz"));
    }
}
