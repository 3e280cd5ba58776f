//! What is made of a measured wrench before anyone feels it: its zero is taken off, and its noise.

use crate::filters::design_error;
use haptograph_engine::node::BuildError;
use haptograph_signal::filter::{SectionsState, butterworth_lowpass};
use haptograph_signal::time::Rate;

/// Force and torque, N and N m.
pub(super) type Wrench = [f64; 6];

/// Takes the mean of the first readings off all that follow, and filters them.
#[derive(Debug, Clone)]
pub(super) struct Conditioner {
    zeroing: Option<Zeroing>,
    zero: Wrench,
    filters: Option<[SectionsState; 6]>,
    group_delay_s: f64,
    wrench: Wrench,
}

/// The mean that is being taken.
#[derive(Debug, Clone)]
struct Zeroing {
    ticks_left: u64,
    ticks: u64,
    sum: Wrench,
}

/// Poles of the low-pass.
const ORDER: usize = 2;

impl Conditioner {
    /// One that averages over so long, and filters from a cut-off on.
    pub fn new(zero_s: f64, cutoff_hz: Option<f64>, rate: Rate) -> Result<Self, BuildError> {
        let ticks = (zero_s * rate.hz()).ceil() as u64;
        let design = |cutoff_hz| butterworth_lowpass(ORDER, cutoff_hz, rate.hz());
        let filter = cutoff_hz
            .map(design)
            .transpose()
            .map_err(design_error("wrench_cutoff_hz"))?;
        let filter = filter.as_ref();
        Ok(Self {
            zeroing: (ticks > 0).then_some(Zeroing {
                ticks_left: ticks,
                ticks,
                sum: [0.0; 6],
            }),
            zero: [0.0; 6],
            group_delay_s: filter.map_or(0.0, |filter| filter.group_delay_s(1.0, rate.hz())),
            filters: filter.map(|filter| std::array::from_fn(|_| SectionsState::new(filter))),
            wrench: [0.0; 6],
        })
    }

    /// A tick passes in which this was measured; nothing is where the device is not heard.
    pub fn advance(&mut self, measured: Wrench, is_heard: bool) {
        if let Some(zeroing) = &mut self.zeroing {
            if is_heard {
                zeroing
                    .sum
                    .iter_mut()
                    .zip(measured)
                    .for_each(|(sum, x)| *sum += x);
                zeroing.ticks_left -= 1;
            }
            if zeroing.ticks_left > 0 {
                return;
            }
            self.zero = zeroing.sum.map(|sum| sum / zeroing.ticks as f64);
            self.zeroing = None;
        }
        for (lane, x) in measured.into_iter().enumerate() {
            let x = x - self.zero[lane];
            self.wrench[lane] = match &mut self.filters {
                Some(filters) => {
                    let mut y = [x];
                    filters[lane].process_in_place(&mut y);
                    y[0]
                }
                None => x,
            };
        }
    }

    /// What is felt of it; zero until the mean is known.
    pub fn wrench(&self) -> &Wrench {
        &self.wrench
    }

    /// Delay of the filter, s.
    pub fn group_delay_s(&self) -> f64 {
        self.group_delay_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn conditioner(zero_s: f64, cutoff_hz: Option<f64>) -> Conditioner {
        Conditioner::new(zero_s, cutoff_hz, Rate::new(1000, 1).unwrap()).unwrap()
    }

    #[test]
    fn the_mean_of_what_is_heard_first_is_taken_off() {
        let mut sensor = conditioner(0.1, None);
        (0..50).for_each(|_| sensor.advance([0.0; 6], false));
        for tick in 0..100 {
            let noise = if tick % 2 == 0 { 0.01 } else { -0.01 };
            sensor.advance([5.0 + noise, 0.0, -8.0, 0.0, 0.2, 0.0], true);
            assert!(tick == 99 || *sensor.wrench() == [0.0; 6]);
        }
        sensor.advance([5.0, 0.0, -9.0, 0.0, 0.2, 0.0], true);
        let [x, _, z, _, torque, _] = *sensor.wrench();
        assert!(x.abs() < 1e-9 && (z + 1.0).abs() < 1e-9 && torque.abs() < 1e-9);
    }

    #[test]
    fn it_is_the_wrench_itself_where_nothing_is_asked_for() {
        let mut sensor = conditioner(0.0, None);
        sensor.advance([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], true);
        assert_eq!(*sensor.wrench(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(sensor.group_delay_s(), 0.0);
    }

    #[test]
    fn noise_is_filtered_and_a_steady_force_stays() {
        let mut sensor = conditioner(0.0, Some(20.0));
        let mut largest: f64 = 0.0;
        for tick in 0..2000 {
            let noise = if tick % 2 == 0 { 0.1 } else { -0.1 };
            sensor.advance([1.0 + noise, 0.0, 0.0, 0.0, 0.0, 0.0], true);
            if tick > 1000 {
                largest = largest.max((sensor.wrench()[0] - 1.0).abs());
            }
        }
        assert!(largest < 1e-3, "{largest}");
        // Of a second-order Butterworth low-pass: sqrt(2) / (2 pi cut-off).
        assert!((sensor.group_delay_s() - 0.0113).abs() < 1e-4);
        assert_eq!(
            Conditioner::new(0.0, Some(600.0), Rate::new(1000, 1).unwrap())
                .unwrap_err()
                .field,
            Some("wrench_cutoff_hz")
        );
    }
}
