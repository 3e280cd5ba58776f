//! Velocity and speed from sampled positions: differentiated, then low-passed (3.1.1, A.3.2).

use crate::vector::norm;
use haptograph_signal::filter::{DesignError, Prototype, Sections, SectionsState};

/// The low-pass of the velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum SpeedFilter {
    /// A Butterworth low-pass. Its cut-off must lie below half the sensor's rate.
    Butterworth {
        /// Order.
        order: usize,
        /// Cut-off, Hz.
        cutoff_hz: f64,
    },
    /// The toolkit's two real poles by backward differences; the toolkit calls 125 rad/s 20 Hz (-6 dB there, -3 dB
    /// at 12.8 Hz, 16 ms of delay).
    DoublePole {
        /// Both poles, rad/s.
        lambda_rad_s: f64,
    },
}

impl SpeedFilter {
    /// The filter at a sensor's rate.
    pub(crate) fn design(&self, rate_hz: f64) -> Result<Sections, DesignError> {
        self.prototype()?.at([self.frequency(); 2], rate_hz).map(Sections::from)
    }

    fn prototype(&self) -> Result<Prototype, DesignError> {
        match *self {
            Self::Butterworth { order, .. } => Prototype::butterworth_lowpass(order),
            Self::DoublePole { .. } => Ok(Prototype::double_pole()),
        }
    }

    /// The cut-off, Hz, or the poles, rad/s.
    fn frequency(&self) -> f64 {
        match *self {
            Self::Butterworth { cutoff_hz, .. } => cutoff_hz,
            Self::DoublePole { lambda_rad_s } => lambda_rad_s,
        }
    }
}

/// Velocity of a point in `N` dimensions. Allocates only when made.
#[derive(Debug, Clone)]
pub(crate) struct SpeedEstimator<const N: usize> {
    rate_hz: f64,
    prototype: Prototype,
    /// Requested frequency of the filters, as [`SpeedFilter::frequency`] returns it.
    frequency: f64,
    filters: [SectionsState; N],
    delay_s: f64,
    previous_m: Option<[f64; N]>,
    velocity_m_s: [f64; N],
}

impl<const N: usize> SpeedEstimator<N> {
    /// An estimator at rest, for positions sampled at the sensor's own rate (not upsampled: the steps would be felt).
    pub(crate) fn new(filter: SpeedFilter, rate_hz: f64) -> Result<Self, DesignError> {
        let sections = filter.design(rate_hz)?;
        Ok(Self {
            rate_hz,
            prototype: filter.prototype()?,
            frequency: filter.frequency(),
            delay_s: sections.group_delay_s(0.0, rate_hz) + 0.5 / rate_hz,
            filters: std::array::from_fn(|_| SectionsState::new(&sections)),
            previous_m: None,
            velocity_m_s: [0.0; N],
        })
    }

    /// Advances one sample: the velocity, m/s. The first sample after the start or [`Self::lift`] gives zero. A position that is
    /// not finite keeps the last velocity.
    pub(crate) fn update(&mut self, position_m: [f64; N]) -> [f64; N] {
        if !position_m.iter().all(|x| x.is_finite()) {
            return self.velocity_m_s;
        }
        let previous_m = self.previous_m.replace(position_m).unwrap_or(position_m);
        for axis in 0..N {
            let mut sample = [(position_m[axis] - previous_m[axis]) * self.rate_hz];
            self.filters[axis].process_in_place(&mut sample);
            self.velocity_m_s[axis] = sample[0];
        }
        self.velocity_m_s
    }

    /// Resets the motion when the tool leaves the sensor: the next position starts from rest.
    pub(crate) fn lift(&mut self) {
        self.previous_m = None;
        self.velocity_m_s = [0.0; N];
        self.filters.iter_mut().for_each(SectionsState::reset);
    }

    /// Tunes the filter to another cut-off, Hz, or to other poles, rad/s; the velocity continues. An invalid
    /// filter changes nothing. The stated delay remains that of the original filter.
    pub(crate) fn turn(&mut self, frequency: f64) {
        if frequency == self.frequency {
            return;
        }
        if let Ok(sections) = self.prototype.at([frequency; 2], self.rate_hz) {
            self.frequency = frequency;
            self.filters.iter_mut().for_each(|filter| filter.turn(&sections));
        }
    }

    /// Takes over the state of another estimator.
    pub(crate) fn copy_state_from(&mut self, other: &Self) {
        (self.previous_m, self.velocity_m_s) = (other.previous_m, other.velocity_m_s);
        if self.prototype != other.prototype {
            return;
        }
        let states = self.filters.iter_mut().zip(&other.filters);
        if self.rate_hz != other.rate_hz {
            // At another rate these sections have other frequencies.
            states.for_each(|(filter, other)| filter.copy_state_from(other));
            return;
        }
        states.for_each(|(filter, other)| filter.take_over(other));
        let wanted = std::mem::replace(&mut self.frequency, other.frequency);
        self.turn(wanted);
    }

    /// The latest velocity, m/s.
    pub(crate) fn velocity_m_s(&self) -> [f64; N] {
        self.velocity_m_s
    }

    /// The latest speed, m/s.
    pub(crate) fn speed_m_s(&self) -> f64 {
        norm(self.velocity_m_s)
    }

    /// Delay of slow changes of speed, s: the filter's delay and half a sample.
    pub(crate) fn delay_s(&self) -> f64 {
        self.delay_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLET: SpeedFilter = SpeedFilter::Butterworth { order: 2, cutoff_hz: 20.0 };

    #[test]
    fn an_even_motion_has_its_speed() {
        for filter in [TABLET, SpeedFilter::DoublePole { lambda_rad_s: 125.0 }] {
            let mut estimator = SpeedEstimator::<2>::new(filter, 125.0).unwrap();
            (0..500).for_each(|k| {
                estimator.update([0.3 + f64::from(k) * 3e-4, -f64::from(k) * 4e-4]);
            });
            assert!((estimator.speed_m_s() - 5e-4 * 125.0).abs() < 1e-9);
            assert!(estimator.velocity_m_s()[1] < 0.0);
        }
    }

    #[test]
    fn a_still_pen_is_still_and_starts_without_a_jump() {
        let mut estimator = SpeedEstimator::<3>::new(TABLET, 125.0).unwrap();
        (0..100).for_each(|_| assert_eq!(estimator.update([0.2, -0.1, 5.0]), [0.0; 3]));
        estimator.update([0.21, -0.1, 5.0]);
        estimator.lift();
        assert_eq!(estimator.update([0.5, 0.5, 0.5]), [0.0; 3], "a pen put down elsewhere has not moved");
    }

    #[test]
    fn the_toolkits_filter_is_late_by_16_ms() {
        let estimator =
            SpeedEstimator::<1>::new(SpeedFilter::DoublePole { lambda_rad_s: 125.0 }, 1000.0).unwrap();
        assert!((estimator.delay_s() - 0.0165).abs() < 1e-9, "{}", estimator.delay_s());
    }

    #[test]
    fn a_cut_off_beyond_what_the_sensor_can_tell_is_refused() {
        let beyond = SpeedFilter::Butterworth { order: 2, cutoff_hz: 62.5 };
        assert!(SpeedEstimator::<2>::new(beyond, 125.0).is_err());
    }

    #[test]
    fn a_bad_position_keeps_the_last_velocity() {
        let mut estimator = SpeedEstimator::<1>::new(TABLET, 125.0).unwrap();
        (0..50).for_each(|k| {
            estimator.update([f64::from(k) * 1e-3]);
        });
        let before = estimator.velocity_m_s();
        assert_eq!(estimator.update([f64::NAN]), before);
    }

    #[test]
    fn a_turned_estimator_goes_on_at_its_speed() {
        for (filter, others) in [
            (TABLET, [5.0, 50.0, 500.0, f64::NAN]),
            (SpeedFilter::DoublePole { lambda_rad_s: 125.0 }, [30.0, 300.0, -1.0, 0.0]),
        ] {
            let mut estimator = SpeedEstimator::<1>::new(filter, 125.0).unwrap();
            let mut way = 0.0;
            let mut step = |estimator: &mut SpeedEstimator<1>| {
                way += 1e-3;
                estimator.update([way])
            };
            (0..500).for_each(|_| _ = step(&mut estimator));
            for other in others {
                estimator.turn(other);
                (0..20).for_each(|_| assert!((step(&mut estimator)[0] - 0.125).abs() < 1e-7, "{other}"));
            }
        }
    }
}
