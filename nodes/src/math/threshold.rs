//! Events from a signal.

use haptograph_engine::frame::{Event, Record, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, QuantityRule, Tick,
};

haptograph_engine::settings! {
    /// Settings of [`Threshold`].
    pub struct ThresholdSettings {
        /// Fires when the signal rises to this value or above it, in the SI unit of the signal.
        [live] rises_to: f64;
        /// The signal has to fall to this value or below it before the next event; none: to any value below `rises_to`.
        [live] falls_to: Option<f64> = None;
    }
}

haptograph_engine::node! {
    /// Fires an event when a scalar rises to a value, and not again before it has fallen (hysteresis). A signal that starts
    /// above the value fires only after it has fallen.
    /// Elsewhere: Schmidt, threshold~, comparator.
    pub struct Threshold(ThresholdSettings) in "math";
    example: r#""pressed": Threshold(input: "stylus.force", rises_to: 0.5, falls_to: 0.3)"#;
    in INPUT: Scalar = Port::any("The signal.");
    out EVENT: Event = Port::any("Event with the signal's value.").carrying(QuantityRule::Same("input"));
}

impl NodeKind for Threshold {
    fn build(settings: ThresholdSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        if let Some(falls_to) = settings.falls_to.filter(|falls_to| *falls_to > settings.rises_to) {
            let message = format!("`falls_to` is {falls_to}, which is above {}", settings.rises_to);
            return Err(BuildError::at("falls_to", message).help("give a value no higher than `rises_to`"));
        }
        Ok(Built::new(Rising { rises_to: settings.rises_to, falls_to: settings.falls_to, armed: false }))
    }
}

#[derive(Debug, Clone)]
struct Rising {
    rises_to: f64,
    falls_to: Option<f64>,
    armed: bool,
}

impl Rising {
    /// NaN neither fires nor arms.
    fn fires(&mut self, x: f64) -> bool {
        let fires = self.armed && x >= self.rises_to;
        let falls = x < self.rises_to && self.falls_to.is_none_or(|falls_to| x <= falls_to);
        self.armed = (self.armed && !fires) || falls;
        fires
    }
}

impl Processor<Threshold> for Rising {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Threshold>) {
        let x = io.read(Threshold::INPUT);
        for (event, x) in io.write(Threshold::EVENT).iter_mut().zip(x) {
            let fired = self.fires(*x);
            let value = if fired { *x } else { 0.0 };
            *event = Event { fired, value }.to_components();
        }
    }

    fn set(&mut self, setting: LiveId<ThresholdSettings>, value: f64) {
        match setting {
            ThresholdSettings::rises_to => self.rises_to = value,
            // Not above the level that it is armed for, as in a file.
            ThresholdSettings::falls_to => self.falls_to = Some(value.min(self.rises_to)),
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.armed = self.armed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    fn fired(falls_to: Option<f64>, x: &[f64]) -> Vec<usize> {
        let settings = ThresholdSettings { rises_to: 0.5, falls_to };
        let mut bench = Bench::new::<Threshold>(settings, 1000.0, &[Kind::SCALAR]).unwrap();
        let events = bench.run_in_blocks(&[x], &[1, 3, 64]);
        let frames = events[0].as_chunks::<2>().0.iter().enumerate();
        let fired = frames.filter(|(_, lanes)| Event::from_components(lanes).fired);
        fired.map(|(tick, _)| tick).collect()
    }

    #[test]
    fn it_fires_once_each_time_the_signal_has_risen() {
        let x = [0.9, 0.6, 0.4, 0.5, 0.45, 0.7, 0.2, 0.3, f64::NAN, 0.8, 0.9, 0.1, 0.5];
        assert_eq!(fired(None, &x), [3, 5, 9, 12]);
        // It shakes about the value after tick 3.
        assert_eq!(fired(Some(0.4), &x), [3, 9, 12]);
    }

    #[test]
    fn it_cannot_have_to_fall_to_above_what_it_rises_to() {
        let settings = ThresholdSettings { rises_to: 0.5, falls_to: Some(0.6) };
        assert!(Bench::new::<Threshold>(settings, 1000.0, &[Kind::SCALAR]).is_err());
    }
}
