//! The capture callback of a soundcard: real-time code, independent of the sound system.

use super::BACKEND;
use super::shared::{Active, Detached, Due, Shared};
use haptograph_engine::graph::Graph;
use haptograph_engine::run::{AgeMeter, AsyncResamplerWriter, Player, async_resampler};
use haptograph_nodes::soundcard::{Card, CardInput};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// Samples per write to a ring.
const AT_ONCE: usize = 64;
/// The largest sample of the coarsest format: a sample no smaller counts as clipped.
const FULL: f64 = 1.0 - 1.0 / 32_768.0;

/// The inputs of a live run, each in the driver of its device. Copies in other drivers are unused.
pub(super) fn inputs_of<'l>(
    graph: &'l Graph,
    lives: impl IntoIterator<Item = &'l mut Player>,
) -> impl Iterator<Item = &'l mut CardInput> {
    let own = move |(driver, live): (usize, &'l mut Player)| {
        let devices = graph.devices().iter().zip(live.devices_mut());
        devices
            .filter(move |(known, _)| BACKEND.reaches(known) && graph.clocks()[known.clock].driver == driver)
            .map(|(_, device)| device)
    };
    graph
        .drivers()
        .into_iter()
        .zip(lives)
        .flat_map(own)
        .filter_map(|device| device.as_any_mut().downcast_mut::<Card>()?.input.as_mut())
}

/// The writing end of an input's ring, in the callback of the card's stream.
pub(super) struct InputTap {
    /// Counted from 0.
    pub channel: usize,
    pub full_scale: f64,
    pub writer: AsyncResamplerWriter,
    pub ages: Arc<AgeMeter>,
}

impl InputTap {
    /// Starts an input, which reads what is written here.
    pub(super) fn of(input: &mut CardInput) -> Self {
        let (writer, reader) = async_resampler(&input.ring);
        input.attach(reader);
        Self {
            channel: input.channel as usize - 1,
            full_scale: input.full_scale,
            writer,
            ages: Arc::clone(&input.ages),
        }
    }
}

/// The inputs that a stream feeds.
pub(super) struct InputTaps(pub Vec<InputTap>);

/// Sends a card's samples to the endpoints that use them.
pub(super) struct CaptureCallback {
    taps: Active<InputTaps>,
    shared: Arc<Shared>,
    due: Due,
}

impl CaptureCallback {
    /// Takes the taps out of the slot.
    pub(super) fn new(
        slot: &Detached<InputTaps>,
        shared: &Arc<Shared>,
        rate_hz: u32,
        start: Instant,
    ) -> Self {
        Self { taps: slot.attach(), shared: Arc::clone(shared), due: Due::new(rate_hz, start) }
    }

    /// Takes a buffer of any length, frames of `channels` samples, the last of which was captured `age` ago.
    pub(crate) fn capture<T: Copy>(
        &mut self,
        data: &[T],
        channels: usize,
        age: Duration,
        convert: impl Fn(T) -> f64,
    ) {
        let began = Instant::now();
        let mut clipped = 0;
        for tap in self.taps.get().into_iter().flat_map(|taps| &mut taps.0) {
            tap.writer.poll();
            for frames in data.chunks(AT_ONCE * channels) {
                let mut values = [0.0; AT_ONCE];
                let samples = frames.chunks_exact(channels).zip(&mut values);
                let count = samples.len();
                for (frame, value) in samples {
                    let sample = frame.get(tap.channel).map_or(0.0, |sample| convert(*sample));
                    clipped += u64::from(sample.is_nan() || sample.abs() >= FULL);
                    // NaN would stay in a resampler.
                    let sample = if sample.is_finite() { sample } else { 0.0 };
                    *value = sample * tap.full_scale;
                }
                tap.writer.write(&values[..count]);
            }
            tap.ages.news(began.checked_sub(age).unwrap_or(began));
        }
        self.shared.clipped.fetch_add(clipped, Relaxed);
        self.due.record(began, data.len() / channels, &self.shared);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::silence::Rig;
    use haptograph_engine::device::{Device, DeviceKind};
    use haptograph_engine::document::Document;
    use haptograph_engine::graph::{CheckOptions, check};
    use haptograph_engine::node::{BuildContext, BuildError};
    use haptograph_engine::run::{FileSinks, Session, SessionOptions};
    use haptograph_engine::silence::OnSilence;
    use haptograph_nodes::soundcard::{CardFormat, SoundcardAccelerometer, SoundcardAccelerometerSettings};
    use haptograph_signal::time::Rate;
    use haptograph_signal::units::Milliseconds;
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 48_000.0;
    const FRAMES: usize = 64;
    const LATENCY_S: f64 = 0.012;
    const TONE_HZ: f64 = 50.0;

    fn settings() -> SoundcardAccelerometerSettings {
        SoundcardAccelerometerSettings {
            m_s2_full_scale: 50.0,
            device: None,
            channel: 2,
            rate_hz: Some(48_000),
            buffer_frames: FRAMES as u32,
            format: CardFormat::Best,
            latency_ms: Some(Milliseconds::of_si(LATENCY_S)),
            on_silence: OnSilence::Zero,
        }
    }

    fn at(rate_hz: u64) -> BuildContext {
        BuildContext::new("tool", Rate::from_hz(rate_hz).unwrap())
    }

    /// A card with three channels, of which the second one is listened to, and the device behind it.
    struct World {
        device: Box<dyn Device>,
        callback: CaptureCallback,
        shared: Arc<Shared>,
        heard: usize,
        /// Ticks of the device for a frame of the card.
        ticks: f64,
        read: usize,
    }

    impl World {
        fn new(built: Result<Box<dyn Device>, BuildError>, rate_hz: f64) -> Self {
            let mut device = built.unwrap();
            let card: &mut Card = device.as_any_mut().downcast_mut().unwrap();
            let slot = Detached::of(InputTaps(vec![InputTap::of(card.input.as_mut().unwrap())]));
            let shared = Arc::default();
            Self {
                callback: CaptureCallback::new(&slot, &shared, 48_000, Instant::now()),
                device,
                shared,
                heard: 0,
                ticks: rate_hz / RATE_HZ,
                read: 0,
            }
        }

        fn accelerometer(rate_hz: u64) -> Self {
            Self::new(SoundcardAccelerometer::build(settings(), &at(rate_hz)), rate_hz as f64)
        }

        /// A buffer passes, heard or not; returns what was read meanwhile.
        fn pass(&mut self, sample: Option<&dyn Fn(f64) -> f64>) -> Vec<f64> {
            if let Some(sample) = sample {
                let second = |frame| sample((self.heard + frame) as f64 / RATE_HZ) as f32;
                let data: Vec<f32> = (0..FRAMES).flat_map(|frame| [1.0, second(frame), -1.0]).collect();
                self.callback.capture(&data, 3, Duration::ZERO, f64::from);
            }
            self.heard += FRAMES;
            self.device.poll(Instant::now());
            let mut read = Vec::new();
            while (self.read as f64) < self.heard as f64 * self.ticks {
                let mut frame = [9.0];
                self.device.advance();
                self.device.read(0, &mut frame);
                self.device.write(0, &[1.0]);
                read.push(frame[0]);
                self.read += 1;
            }
            read
        }
    }

    fn sine(time_s: f64) -> f64 {
        0.5 * (TAU * TONE_HZ * time_s).sin()
    }

    #[test]
    fn what_is_heard_is_read_calibrated_and_as_late_as_declared() {
        for rate_hz in [48_000, 10_000, 1000] {
            let mut world = World::accelerometer(rate_hz);
            let heard: Vec<f64> = (0..750).flat_map(|_| world.pass(Some(&sine))).collect();
            // The last half second: amplitude and delay of the sine.
            let first = heard.len() / 2;
            let (mut s, mut c) = (0.0, 0.0);
            for (k, x) in heard.iter().enumerate().skip(first) {
                let turned = TAU * TONE_HZ * k as f64 / rate_hz as f64;
                let share = 2.0 / (heard.len() - first) as f64;
                (s, c) = (s + share * x * turned.sin(), c + share * x * turned.cos());
            }
            assert!((s.hypot(c) / 25.0 - 1.0).abs() < 1e-3, "{rate_hz}: {}", s.hypot(c));
            // A frame is written when its buffer is full, up to a buffer after its time.
            let late_s = (-c).atan2(s).rem_euclid(TAU) / TAU / TONE_HZ;
            let buffer_s = FRAMES as f64 / RATE_HZ;
            let stated = world.device.latency().sensing_s;
            assert!((stated - (LATENCY_S + buffer_s)).abs() < 1e-12);
            assert!((LATENCY_S - buffer_s..=stated).contains(&late_s), "{rate_hz}: {late_s} s");
        }
    }

    #[test]
    fn what_is_no_number_is_heard_as_nothing_and_counted() {
        let mut world = World::accelerometer(48_000);
        let broken = |time_s: f64| match (time_s * RATE_HZ).round() as u64 % 3 {
            0 => f64::NAN,
            1 => f64::INFINITY,
            _ => 0.5,
        };
        let heard: Vec<f64> = (0..50).flat_map(|_| world.pass(Some(&broken))).collect();
        assert!(heard.iter().all(|x| x.abs() < 26.0) && heard.iter().any(|x| *x > 1.0));
        assert!(world.shared.counts(0).clipped >= 50 * 42);
    }

    #[test]
    fn a_card_that_falls_silent_is_read_as_nothing_and_rises_from_it() {
        let mut world = World::accelerometer(48_000);
        let steady = |_: f64| 0.5;
        let risen = (0..100).flat_map(|_| world.pass(Some(&steady))).last();
        assert!((risen.unwrap() - 25.0).abs() < 0.01, "{risen:?}");
        let fallen: Vec<f64> = (0..30).flat_map(|_| world.pass(None)).collect();
        let rings_on = ((LATENCY_S + 0.006) * RATE_HZ) as usize;
        assert!(fallen[rings_on..].iter().all(|x| *x == 0.0));
        let back: Vec<f64> = (0..100).flat_map(|_| world.pass(Some(&steady))).collect();
        let leap = |ticks: &[f64]| ticks.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        // 25 m/s2 in 5 ms.
        assert!(leap(&fallen) < 0.12 && leap(&back) < 0.12);
        assert!((back.last().unwrap() - 25.0).abs() < 0.01);
    }

    /// 0.4 A beside what is heard: with `Zero` the actuator falls to zero with the card, with `Hold` it goes on.
    #[test]
    fn an_actuator_follows_the_silence_of_a_soundcard() {
        for (policy, silent) in [("Zero", 0.0), ("Hold", 0.4)] {
            let text = r#"Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) },
                nodes: {
                    "tool": Accelerometer(clock: "audio", endpoint: "tool"),
                    "heard": Calibrate(input: "tool", from: "acceleration", to: "current", factor: 0.01),
                    "bias": Constant(clock: "audio", value: 0.4, quantity: "current"),
                    "sum": Add(inputs: ["heard", "bias"]),
                    "out": ActuatorSink(current: "sum", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
                },
                endpoints: { "simulated": {
                    "tool": SoundcardAccelerometer(m_s2_full_scale: 50, on_silence: POLICY),
                    "coil": SimulatedHaptuator(),
                } })"#;
            let mut callback = None;
            let mut rig = Rig::new(&text.replace("POLICY", policy), |graph, lives| {
                let taps = InputTaps(inputs_of(graph, lives).map(InputTap::of).collect());
                let (slot, shared) = (Detached::of(taps), Arc::default());
                callback = Some(CaptureCallback::new(&slot, &shared, 48_000, Instant::now()));
            });
            let mut callback = callback.unwrap();
            let mut speaks = || callback.capture(&[0.2_f32; 48], 1, Duration::ZERO, f64::from);
            assert_eq!(rig.pass(50, || {}), 0.0);
            rig.assert_true_status("tool", true);
            assert!((rig.pass(200, &mut speaks) - 0.5).abs() < 0.01);
            rig.assert_true_status("tool", false);
            assert_eq!(rig.pass(100, || {}), silent);
            rig.assert_true_status("tool", policy == "Zero");
            assert!((rig.pass(200, &mut speaks) - 0.5).abs() < 0.01);
            assert!(rig.leap(0) < 0.01, "{}", rig.leap(0));
        }
    }

    #[test]
    fn ages_are_measured_while_something_is_heard() {
        let mut world = World::accelerometer(48_000);
        let ages = world.device.ages().unwrap();
        world.pass(None);
        assert_eq!(ages.ages().total(), 0);
        for _ in 0..20 {
            world.pass(Some(&sine));
        }
        let ages = ages.ages();
        // The ring alone holds back nearly as much as declared.
        assert!(ages.total() > 10 && ages.quantile_ns(0.5) > 4_000_000, "{ages:?}");
        assert_eq!(world.shared.counts(0).clipped, 0);
    }

    #[test]
    fn neither_end_allocates_or_waits_whatever_comes() {
        let mut world = World::accelerometer(10_000);
        let data = vec![0.5_f32; 3 * 5000];
        let mut highest = 0.0_f64;
        // Buffers of any length, silence, far too much, and time that stands still.
        let odd = [(0, 500), (64, 13), (480, 100), (5000, 1), (5000, 0), (5000, 2000), (1, 3)];
        for (frames, ticks) in odd.into_iter().chain([(480, 100); 20]) {
            let mut frame = [0.0];
            let allocated = crate::realtime::allocations(|| {
                let heard = &data[..3 * frames];
                world.callback.capture(heard, 3, Duration::ZERO, f64::from);
                world.device.poll(Instant::now());
                for _ in 0..ticks {
                    world.device.advance();
                    world.device.read(0, &mut frame);
                }
            });
            assert_eq!(allocated, 0, "{frames} frames, {ticks} ticks");
            highest = highest.max(frame[0]);
        }
        assert!((highest - 25.0).abs() < 0.01, "{highest}");
    }

    #[test]
    fn a_latency_that_cannot_be_kept_is_refused() {
        let hasty = SoundcardAccelerometerSettings { latency_ms: Some(Milliseconds(2.0)), ..settings() };
        let Err(error) = SoundcardAccelerometer::build(hasty, &at(48_000)) else {
            panic!("taken");
        };
        assert_eq!(error.field, Some("latency_ms"));
        assert!(error.message.contains("two buffers"), "{error}");
        let crooked = BuildContext::new("tool", Rate::new(44_101, 2).unwrap());
        let settings = SoundcardAccelerometerSettings { rate_hz: None, ..settings() };
        let Err(error) = SoundcardAccelerometer::build(settings, &crooked) else {
            panic!("taken");
        };
        assert_eq!(error.field, Some("rate_hz"));
    }

    #[test]
    fn of_two_drivers_each_hears_what_hangs_from_it() {
        let text = r#"Graph(format: 1,
            clocks: { "audio": Driver(rate_hz: 48000), "servo": Driver(rate_hz: 8000) },
            nodes: {
                "fast": SoundcardSource(clock: "audio", endpoint: "line"),
                "slow": SoundcardSource(clock: "servo", endpoint: "sensor"),
            },
            endpoints: { "simulated": {
                "line": SoundcardInput(volts_full_scale: 1, rate_hz: 48000),
                "sensor": SoundcardInput(volts_full_scale: 1, rate_hz: 48000, channel: 2),
            } })"#;
        let document = Document::parse("g.ron", text).unwrap();
        let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default())
            .unwrap_or_else(|wrong| panic!("{wrong}"));
        let options = SessionOptions::default();
        let (mut lives, _session) = Session::open_all(FileSinks::new(&graph), &options, None).unwrap();
        let taps = InputTaps(inputs_of(&graph, &mut lives).map(InputTap::of).collect());
        let mut channels: Vec<usize> = taps.0.iter().map(|tap| tap.channel).collect();
        channels.sort_unstable();
        assert_eq!(channels, [0, 1]);
        for (driver, live) in graph.drivers().into_iter().zip(&mut lives) {
            let driver = &*graph.clocks()[driver].name;
            for device in live.devices_mut() {
                let card = device.as_any_mut().downcast_mut::<Card>().unwrap();
                let input = card.input.as_ref().unwrap();
                let here = (driver == "audio") == (input.endpoint == "line");
                assert_eq!(input.is_attached(), here, "{} by {driver}", input.endpoint);
            }
        }
    }
}
