//! A source that plays a WAV file on each event.

use super::wav::read;
use haptograph_engine::frame::{Event, Scalar};
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
use std::path::PathBuf;
use std::sync::Arc;

haptograph_engine::settings! {
    /// Settings of [`OneShot`].
    pub struct OneShotSettings {
        /// The WAV file, relative to the graph file.
        file: PathBuf;
        /// Channel of the file, counted from 0.
        channel: u32 = 0;
        /// Value of a full-scale sample (1.0), in the SI unit of `quantity`.
        [live] full_scale: f64 = 1.0;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
        /// Scales the amplitude by the event's value divided by this, in the SI unit of the event; none: fixed amplitude.
        [live] per_value: Option<f64> = None, in 1e-12..=1e12;
    }
}

haptograph_engine::node! {
    /// Plays one channel of a WAV file, such as a click, each time an event fires, the first sample at the event's own
    /// tick. An event during playback restarts it. The file's rate has to be that of the node's clock.
    /// Elsewhere: PlayBuf, tabplay~.
    pub struct OneShot(OneShotSettings) in "sources";
    example: r#""click": OneShot(start: "pressed.event", file: "recordings/felt.wav", full_scale: 0.2, quantity: "current")"#;
    in START: Event = Port::any("Begins it.");
    out OUTPUT: Scalar = Port::of_setting("quantity", "The recording; zero while it does not play.");
}

impl NodeKind for OneShot {
    fn build(settings: OneShotSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Playing {
            samples: read(&settings.file, settings.channel, cx.rate.hz())?.into(),
            full_scale: settings.full_scale,
            per_value: settings.per_value,
            at: usize::MAX,
            factor: 1.0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Playing {
    samples: Arc<[f64]>,
    full_scale: f64,
    per_value: Option<f64>,
    /// Index of the next sample.
    at: usize,
    factor: f64,
}

impl Processor<OneShot> for Playing {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, OneShot>) {
        let events = io.decode(OneShot::START);
        for (y, event) in io.write(OneShot::OUTPUT).iter_mut().zip(events) {
            if event.fired {
                let factor = self.per_value.map_or(1.0, |unit| event.value / unit);
                self.factor = if factor.is_finite() { factor } else { 0.0 };
                self.at = 0;
            }
            *y = self.samples.get(self.at).map_or(0.0, |sample| self.factor * (sample * self.full_scale));
            self.at = self.at.saturating_add(1);
        }
    }

    fn set(&mut self, setting: LiveId<OneShotSettings>, value: f64) {
        match setting {
            OneShotSettings::full_scale => self.full_scale = value,
            // The next event plays with it.
            OneShotSettings::per_value => self.per_value = Some(value),
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        (new.at, new.factor) = (self.at, self.factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wav::write_mono;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    #[test]
    fn it_plays_from_the_event_on_and_begins_anew_at_the_next() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("click.wav");
        write_mono(&file, 1000, [1.0, 0.5, 0.25]);
        let heard = |per_value| {
            let settings = OneShotSettings {
                file: file.clone(),
                channel: 0,
                full_scale: 2.0,
                quantity: "current".into(),
                per_value,
            };
            let mut bench = Bench::new::<OneShot>(settings, 1000.0, &[Kind::EVENT]).unwrap();
            let mut events = [[0.0, 0.0]; 12];
            (events[2], events[7], events[9]) = ([1.0, 3.0], [1.0, 0.5], [1.0, f64::NAN]);
            bench.run_in_blocks(&[events.as_flattened()], &[1, 5])[0].clone()
        };
        let same = [0.0, 0.0, 2.0, 1.0, 0.5, 0.0, 0.0, 2.0, 1.0, 2.0, 1.0, 0.5];
        assert_eq!(heard(None), same);
        let by_value = [0.0, 0.0, 6.0, 3.0, 1.5, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0];
        assert_eq!(heard(Some(1.0)), by_value);
    }
}
