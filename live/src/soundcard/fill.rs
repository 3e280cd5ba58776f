//! The playback callback of a soundcard: real-time code, independent of the sound system.

use super::shared::{Active, Detached, Due, Shared};
use haptograph_engine::device::Playback;
use haptograph_engine::run::{Player, Wake};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

/// Fills the card's buffers from a live run.
pub(super) struct PlaybackCallback {
    live: Active<Player>,
    shared: Arc<Shared>,
    due: Due,
}

impl PlaybackCallback {
    /// Takes the run out of the slot.
    pub(super) fn new(slot: &Detached<Player>, shared: &Arc<Shared>, rate_hz: u32, start: Instant) -> Self {
        Self { live: slot.attach(), shared: Arc::clone(shared), due: Due::new(rate_hz, start) }
    }

    /// Fills a buffer of any length with frames of `channels` samples.
    pub(super) fn fill<T: Copy>(
        &mut self,
        data: &mut [T],
        channels: usize,
        silence: T,
        convert: impl Fn(f64) -> T,
    ) {
        let began = Instant::now();
        data.fill(silence);
        let Some(live) = self.live.get() else { return };
        // Surplus samples after a panic within a block are played in the next buffer.
        let at_rest = live.is_idle();
        let mut clipped = 0;
        for part in data.chunks_mut(live.block() * channels) {
            live.process(part.len() / channels);
            for device in live.devices_mut() {
                if let Some(playback) = device.playback() {
                    clipped += place(playback, part, channels, &convert);
                }
            }
        }
        self.shared.clipped.fetch_add(clipped, Relaxed);
        self.shared.at_rest.store(at_rest, Relaxed);
        let frames = data.len() / channels;
        let (late, lasts) = self.due.record(began, frames, &self.shared);
        let work = began.elapsed();
        live.report(Wake {
            late_ns: late.as_nanos() as u64,
            work_ns: work.as_nanos() as u64,
            frames: frames as u32,
            lost: 0,
            overrun: work > lasts,
        });
    }
}

/// Copies the samples of a card into its channels, aligned to the end of the part: a card that came with a swap has no
/// samples before it. Returns the number of samples beyond full scale.
fn place<T: Copy>(
    playback: &mut Playback,
    part: &mut [T],
    channels: usize,
    convert: &impl Fn(f64) -> T,
) -> u64 {
    let frames = part.len() / channels;
    let (samples, mapped) = playback.waiting(frames);
    let count = samples.len();
    let skipped = frames - count;
    let mut clipped = 0;
    for (frame, sample) in part.chunks_exact_mut(channels).skip(skipped).zip(samples) {
        clipped += u64::from(sample.abs() > 1.0);
        let sample = convert(sample.clamp(-1.0, 1.0));
        for channel in mapped {
            if let Some(slot) = frame.get_mut(*channel as usize - 1) {
                *slot = sample;
            }
        }
    }
    playback.taken(count);
    clipped
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::device::{Channel, Device, DeviceEntry, DeviceKind, DeviceSpec};
    use haptograph_engine::document::Document;
    use haptograph_engine::frame::{Kind, Scalar};
    use haptograph_engine::graph::{CheckOptions, Graph, check};
    use haptograph_engine::node::{
        BuildContext, BuildError, Built, Io, NodeEntry, NodeKind, Port, Processor, Tick,
    };
    use haptograph_engine::run::{FileSinks, Session, SessionOptions};
    use haptograph_engine::settings::NoSettings;
    use haptograph_signal::quantity::Quantity;

    /// Two endpoints on one card: 0.25 of full scale on channel 2, half of it on 1 and 3.
    fn graph() -> Graph {
        let text = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) },
            nodes: {
                "half": Constant(clock: "audio", value: 0.5, quantity: "current"),
                "four": Constant(clock: "audio", value: 4.0, quantity: "current"),
                "a": ActuatorSink(current: "half", endpoint: "a", limit: (peak_a: 1, continuous_a: 1)),
                "b": ActuatorSink(current: "four", endpoint: "b", limit: (peak_a: 8, continuous_a: 8)),
            },
            endpoints: { "simulated": {
                "a": Soundcard(amperes_full_scale: 2.0, channels: [2]),
                "b": Soundcard(amperes_full_scale: 8.0, channels: [1, 3]),
            } })"#;
        let document = Document::parse("g.ron", text).unwrap();
        check(&document, &haptograph_nodes::registry(), &CheckOptions::default())
            .unwrap_or_else(|wrong| panic!("{wrong}"))
    }

    fn open(graph: &Graph, seconds: f64) -> (Player, Session) {
        let options = SessionOptions::default().block(64).seconds(seconds).rested();
        Session::open(FileSinks::new(graph), &options).unwrap()
    }

    fn callback(graph: &Graph, seconds: f64) -> (PlaybackCallback, Arc<Shared>, Session) {
        let (live, session) = open(graph, seconds);
        let (callback, shared) = callback_of(live);
        (callback, shared, session)
    }

    fn callback_of(live: Player) -> (PlaybackCallback, Arc<Shared>) {
        let slot = Detached::of(live);
        let shared = Arc::default();
        let callback = PlaybackCallback::new(&slot, &shared, 48_000, Instant::now());
        (callback, shared)
    }

    #[test]
    fn every_endpoint_plays_on_its_channels_in_buffers_of_any_length() {
        let (mut live, _session) = open(&graph(), 1.0);
        // No limit lets a graph ask for more than a card states: a card that has a quarter of it.
        for device in live.devices_mut() {
            let playback = device.playback().unwrap();
            playback.full_scale = playback.full_scale.min(2.0);
        }
        let (mut callback, shared) = callback_of(live);
        for frames in [1, 64, 170, 5000, 7] {
            let mut data = vec![9.0; frames * 4];
            callback.fill(&mut data, 4, 0.0, |x| x);
            assert!(data.chunks(4).all(|frame| frame == [1.0, 0.25, 1.0, 0.0]), "{frames}");
        }
        // Twice full scale is cut off, and counted once for each sample that should have been played.
        assert_eq!(shared.clipped.load(Relaxed), 1 + 64 + 170 + 5000 + 7);
        assert_eq!(shared.callbacks.load(Relaxed), 5);
    }

    #[test]
    fn at_the_end_everything_falls_to_zero_and_stays_there() {
        let (mut callback, shared, _session) = callback(&graph(), 0.01);
        let mut data = vec![9.0; 1500 * 4];
        callback.fill(&mut data, 4, 0.0, |x| x);
        let channel: Vec<f64> = data.chunks(4).map(|frame| frame[1]).collect();
        assert!(channel[..480].iter().all(|x| *x == 0.25));
        let ramp = &channel[480..960];
        assert!(ramp.windows(2).all(|pair| pair[1] < pair[0]), "{ramp:?}");
        assert!(channel[960..].iter().all(|x| *x == 0.0));
        // Known a buffer later: a card may have samples left to play.
        callback.fill(&mut data, 4, 0.0, |x| x);
        assert!(data.iter().all(|x| *x == 0.0) && shared.at_rest.load(Relaxed));
    }

    /// A panic that is meant to happen: it unwinds as any does, without the message.
    fn panic_quietly() -> ! {
        std::panic::resume_unwind(Box::new("as asked"))
    }

    haptograph_engine::node! {
        /// Panics in the second block.
        struct Doomed(NoSettings) in "plain";
        example: "";
        out OUT: Scalar = Port::of(Quantity::CURRENT, "");
    }

    impl Processor<Doomed> for Doomed {
        fn process(&mut self, tick: &Tick, io: &mut Io<'_, Doomed>) {
            if tick.first >= 64 {
                panic_quietly();
            }
            io.write(Doomed::OUT).fill(0.5);
        }
    }

    impl NodeKind for Doomed {
        fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
            Ok(Built::new(Self))
        }
    }

    /// From 0.5 to nothing on both channels, in steps of a ramp of 10 ms.
    fn assert_falls_without_a_leap(graph: &Graph) {
        for played in play(graph) {
            let most = played.windows(2).map(|pair| (pair[1] - pair[0]).abs());
            let most = most.fold(0.0, f64::max);
            assert!(most < 0.5 / 480.0 * 1.01, "{most}");
            assert_eq!((played[0], played.last()), (0.5, Some(&0.0)));
        }
    }

    /// What two channels play in twelve buffers, until nothing is driven any more.
    fn play(graph: &Graph) -> [Vec<f64>; 2] {
        let (mut callback, shared, _session) = callback(graph, 1.0);
        let mut played = [Vec::new(), Vec::new()];
        for _ in 0..12 {
            let mut data = vec![9.0; 64 * 2];
            callback.fill(&mut data, 2, 0.0, |x| x);
            for (channel, played) in played.iter_mut().enumerate() {
                played.extend(data.chunks(2).map(|frame| frame[channel]));
            }
        }
        assert!(shared.at_rest.load(Relaxed));
        played
    }

    #[test]
    fn no_sample_of_the_way_down_is_lost_when_a_block_ends_in_a_panic() {
        let text = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) },
            nodes: {
                "half": Constant(clock: "audio", value: 0.5, quantity: "current"),
                "z": Doomed(clock: "audio"),
                "a": ActuatorSink(current: "half", endpoint: "a", limit: (peak_a: 1, continuous_a: 1)),
                "b": ActuatorSink(current: "z", endpoint: "b", limit: (peak_a: 1, continuous_a: 1)),
            },
            endpoints: { "simulated": {
                "a": Soundcard(amperes_full_scale: 1.0, channels: [1]),
                "b": Soundcard(amperes_full_scale: 1.0, channels: [2]),
            } })"#;
        let mut registry = haptograph_nodes::registry();
        registry.add(NodeEntry::processor::<Doomed>());
        let document = Document::parse("g.ron", text).unwrap();
        let graph = check(&document, &registry, &CheckOptions::default()).unwrap();
        assert_falls_without_a_leap(&graph);
    }

    /// Panics at whatever it is given from the second block on.
    #[derive(Clone)]
    struct Grenade(u32);

    impl Device for Grenade {
        fn advance(&mut self) {}

        fn read(&mut self, _: usize, _: &mut [f64]) {}

        fn write(&mut self, _: usize, _: &[f64]) {
            self.0 += 1;
            if self.0 > 64 {
                panic_quietly();
            }
        }
    }

    impl DeviceKind for Grenade {
        type Settings = NoSettings;
        const SPEC: DeviceSpec = DeviceSpec {
            name: "Grenade",
            doc: "",
            source: "",
            simulated: true,
            senses: &[],
            drives: &[Channel::new("current", Kind::SCALAR, Quantity::CURRENT, "")],
            example: "",
        };

        fn build(_: NoSettings, _: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
            Ok(Box::new(Self(0)))
        }
    }

    #[test]
    fn a_device_that_panics_on_the_way_down_takes_no_other_with_it() {
        let text = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) },
            nodes: {
                "half": Constant(clock: "audio", value: 0.5, quantity: "current"),
                "a": ActuatorSink(current: "half", endpoint: "a", limit: (peak_a: 1, continuous_a: 1)),
                "b": ActuatorSink(current: "half", endpoint: "b", limit: (peak_a: 1, continuous_a: 1)),
                "c": ActuatorSink(current: "half", endpoint: "c", limit: (peak_a: 1, continuous_a: 1)),
            },
            endpoints: { "simulated": {
                "a": Soundcard(amperes_full_scale: 1.0, channels: [1]),
                "b": Grenade(),
                "c": Soundcard(amperes_full_scale: 1.0, channels: [2]),
            } })"#;
        let mut registry = haptograph_nodes::registry();
        registry.add_device(DeviceEntry::of::<Grenade>());
        let document = Document::parse("g.ron", text).unwrap();
        let graph = check(&document, &registry, &CheckOptions::default()).unwrap();
        assert_falls_without_a_leap(&graph);
    }

    #[test]
    fn a_run_outlives_its_stream() {
        let graph = graph();
        let (live, _session) = Session::open(FileSinks::new(&graph), &SessionOptions::default()).unwrap();
        let slot = Detached::of(live);
        let shared = Arc::default();
        for expected in [10, 20] {
            let mut callback = PlaybackCallback::new(&slot, &shared, 48_000, Instant::now());
            callback.fill(&mut [0.0; 10], 1, 0.0, |x| x);
            drop(callback);
            let live = slot.lock();
            assert_eq!(live.as_ref().map(|live| live.frames()), Some(expected));
        }
    }
}
