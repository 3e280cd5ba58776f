//! The ticking side of a network device: its latest update while it is fresh, and its state. The engine decides the
//! outputs of actuators while it is silent.

use super::conditioner::{Conditioner, ZeroNews, ZeroSettings};
use super::link::{Count, DRIVEN, Link, Reader, SENSED};
use haptograph_engine::device::{Channel, Device, DeviceKind, DeviceSpec};
use haptograph_engine::frame::Kind;
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::run::AgeMeter;
use haptograph_engine::silence::{InputState, LiveInput, OnSilence};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{MillimetresPerSecond, Milliseconds};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Fade time of measured forces when the device is silent or jumps, and when it is back, s.
const RAMP_S: f64 = 0.01;
/// Index of force and torque in a state.
const WRENCH: usize = 6;
/// Time between two wake-ups beyond which the ticks have stalled, whatever silence the device waits for.
const STALL: Duration = Duration::from_millis(20);
/// Updates may arrive in bursts: extra time before a movement counts as a jump, s.
const BUNCHING_S: f64 = 0.002;

haptograph_engine::settings! {
    /// A device of another program, by haptograph's device protocol.
    pub struct UdpDeviceSettings {
        /// Address and port to listen at: 127.0.0.1 for a program on this machine.
        listen: String = "127.0.0.1:9750".to_owned();
        /// Only address and port to accept packets from; none: the first sender, until it is silent.
        only: Option<String> = None;
        /// Silence after which the device counts as gone, ms.
        timeout_ms: Milliseconds = Milliseconds(20.0), in 1.0..=10_000.0;
        /// Effect of silence on dependent actuators. The device's own actuators are at zero meanwhile.
        on_silence: OnSilence = OnSilence::Zero;
        /// Speed above which a movement of the tip counts as a jump, mm/s.
        fastest_mm_s: MillimetresPerSecond = MillimetresPerSecond(5000.0), in 1.0..=1e6;
        /// Time over which the zero of force and torque is averaged, s, from the first packet on. Until the zero is known they
        /// read zero. It is taken only while they are steady (`zero_steady_n`) and the force is small (`zero_within_n`), and once
        /// per run: an edit keeps it. 0: the device subtracts its own zero.
        zero_s: f64 = 0.0, in 0.0..=60.0;
        /// Largest force that can be an offset, N. With a larger force no zero is taken, because something presses.
        zero_within_n: f64 = 10.0, in 0.0..=1e6;
        /// Largest change of a force within `zero_s`, N, and of a torque by a lever of 50 mm. With a larger change the averaging restarts.
        zero_steady_n: f64 = 0.2, in 0.0..=1e6;
        /// Cut-off of a second-order low-pass on force and torque, below half the rate; none: no filter.
        wrench_cutoff_hz: Option<f64> = None, in 1e-3..=1e6;
    }
}

/// A device that another program owns.
pub struct UdpDevice;

/// Channels of network devices that sources read.
pub(super) const SENSES: &[Channel] = &[
    Channel::new(
        "position",
        Kind::VECTOR,
        Quantity::LENGTH,
        "Position of the tip, m; holds its last value while the device is silent.",
    ),
    Channel::new("orientation", Kind::VECTOR, Quantity::ANGLE, "Orientation as a rotation vector, rad."),
    Channel::new(
        "wrench",
        Kind::WRENCH,
        Quantity::FORCE,
        "Force and torque on the tool, N and N m; zero while silent, or held with `on_silence: Hold`.",
    ),
    Channel::new(
        "force",
        Kind::SCALAR,
        Quantity::FORCE,
        "Normal force of the tip: the force along z, not below zero, N.",
    ),
    Channel::new("touching", Kind::SCALAR, Quantity::NUMBER, "1 while that force is above zero."),
];

/// Channels of network devices that sinks drive.
pub(super) const DRIVES: &[Channel] = &[
    Channel::new("force", Kind::VECTOR, Quantity::FORCE, "Force of the motors on the hand, N."),
    Channel::new("current", Kind::SCALAR, Quantity::CURRENT, "Current through the actuator, A."),
    Channel::new("brake", Kind::SCALAR, Quantity::CURRENT, "Current through the brake's solenoid, A."),
];

impl DeviceKind for UdpDevice {
    type Settings = UdpDeviceSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "UdpDevice",
        doc: "A device that another program owns, by the device protocol over UDP, for example an OpenHaptics or \
              CHAI3D program or a force/torque sensor, whose zero and noise it removes (`zero_s`, `wrench_cutoff_hz`). \
              It works in live runs only. While it is silent or jumps, its outputs are at zero; while it is silent, so \
              is every actuator that depends on it, unless `on_silence` is `Hold`.",
        source: "",
        simulated: false,
        senses: SENSES,
        drives: DRIVES,
        example: r#""arm": UdpDevice(listen: "127.0.0.1:9750")"#,
    };

    fn build(settings: UdpDeviceSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        settings.listen()?;
        settings.only()?;
        let watch = Watch {
            timeout: settings.timeout(),
            fastest_m_s: settings.fastest_mm_s.si(),
            holds: settings.on_silence == OnSilence::Hold,
        };
        let zero = ZeroSettings {
            window_s: settings.zero_s,
            within_n: settings.zero_within_n,
            steady_n: settings.zero_steady_n,
        };
        let conditioner = Conditioner::new(zero, settings.wrench_cutoff_hz, cx.rate)?;
        Ok(Box::new(Remote { conditioner: Some(conditioner), ..Remote::new(watch, cx) }))
    }
}

impl UdpDeviceSettings {
    /// Address to listen at.
    ///
    /// # Errors
    /// [`BuildError`] if it is not an address; a checked graph has one.
    pub fn listen(&self) -> Result<SocketAddr, BuildError> {
        address("listen", &self.listen)
    }

    /// The only sender to accept packets from, if any.
    ///
    /// # Errors
    /// [`BuildError`] if it is not an address; a checked graph has one.
    pub fn only(&self) -> Result<Option<SocketAddr>, BuildError> {
        self.only.as_deref().map(|only| address("only", only)).transpose()
    }

    /// Silence after which the device counts as gone.
    pub fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_ms.si())
    }
}

/// Parses an address. Host names are not resolved, because that could take seconds.
pub(super) fn address(field: &'static str, text: &str) -> Result<SocketAddr, BuildError> {
    text.parse().map_err(|_| {
        BuildError::at(field, format!("`{text}` is not an IP address with a port"))
            .help("write numbers: \"127.0.0.1:9750\", or \"[::1]:9750\"")
    })
}

/// Conditions under which a device counts as silent or as jumping, and the effect of silence.
#[derive(Debug, Clone, Copy)]
pub(super) struct Watch {
    /// Age beyond which an update is stale.
    pub timeout: Duration,
    pub fastest_m_s: f64,
    /// True if dependent actuators continue while it is silent.
    pub holds: bool,
}

/// The body of a device that another program owns. It is silent until it is [attached](Self::attach) to a link that someone
/// publishes to.
#[derive(Debug, Clone)]
pub struct Remote {
    reader: Reader,
    /// Conditioner of its force and torque, if any.
    conditioner: Option<Conditioner>,
    /// Number of its channels that are parts of a state as they are.
    plain: usize,
    period_s: f64,
    watch: Watch,
    /// The last state.
    latest: [f64; SENSED],
    /// Ticks left of the hold after a jump.
    held: u64,
    /// Gain of the forces.
    reach: f64,
    driven: [f64; DRIVEN],
}

impl Remote {
    pub(super) fn new(watch: Watch, cx: &BuildContext) -> Self {
        Self {
            reader: Reader::new(&Arc::new(Link::default()), cx.rate, watch.timeout),
            conditioner: None,
            plain: 3,
            period_s: cx.rate.period_s(),
            watch,
            latest: [0.0; SENSED],
            held: 0,
            reach: 0.0,
            driven: [0.0; DRIVEN],
        }
    }

    /// A device of four vectors, without a wrench: position, orientation, and two that are zero while it is silent.
    pub(super) fn of_vectors(watch: Watch, cx: &BuildContext) -> Self {
        Self { plain: 4, ..Self::new(watch, cx) }
    }

    /// The link that it reads and writes.
    pub fn link(&self) -> &Arc<Link> {
        &self.reader.link
    }

    /// Reads and writes another link from now on, that of the device as it is connected. A zero that was taken there stays.
    pub fn attach(&mut self, link: &Arc<Link>) {
        self.reader.link = Arc::clone(link);
        if let (Some(conditioner), Some((1.., zero))) = (&mut self.conditioner, link.zero.look()) {
            conditioner.start_from(zero);
        }
    }

    fn state(&self) -> InputState {
        match self.reader.state() {
            InputState::Heard if self.held > 0 => InputState::Jumped,
            state => state,
        }
    }

    /// True if the tip has moved faster than a hand can.
    fn jumps_to(&self, sensed: &[f64; SENSED]) -> bool {
        let moved: f64 = (0..3).map(|i| (sensed[i] - self.latest[i]).powi(2)).sum();
        let time_s = self.reader.age_s() + BUNCHING_S;
        moved.sqrt() > self.watch.fastest_m_s * time_s
    }
}

impl Device for Remote {
    fn advance(&mut self) {
        self.held = self.held.saturating_sub(1);
        let news = self.reader.advance();
        let is_news = news.is_some();
        if let Some(news) = news {
            if !self.reader.is_silent() && self.jumps_to(&news.sensed) {
                self.held = self.reader.timeout_ticks();
                self.reader.link.count(Count::Jumps, 1);
            }
            self.latest = news.sensed;
            self.reader.take(&news);
        }
        self.reader.measure_age(is_news, false);
        let state = self.state();
        self.reader.link.input.set(state);
        if let Some(conditioner) = &mut self.conditioner {
            let measured = std::array::from_fn(|lane| self.latest[WRENCH + lane]);
            match conditioner.advance(measured, state == InputState::Heard, is_news) {
                Some(ZeroNews::Taken(zero)) => self.reader.link.zero.put(&zero),
                Some(ZeroNews::Refused) => self.reader.link.count(Count::RefusedZeros, 1),
                None => {}
            }
        }
        let step = match state {
            InputState::Heard => self.period_s / RAMP_S,
            InputState::Silent if self.watch.holds => 0.0,
            _ => -self.period_s / RAMP_S,
        };
        self.reach = (self.reach + step).clamp(0.0, 1.0);
    }

    fn read(&mut self, channel: usize, frame: &mut [f64]) {
        let wrench: &[f64] = match &self.conditioner {
            Some(conditioner) => conditioner.wrench(),
            None => &self.latest[WRENCH..],
        };
        let normal_n = wrench[2].max(0.0) * self.reach;
        match (channel, frame) {
            (0, frame) => frame.copy_from_slice(&self.latest[..3]),
            (1, frame) => frame.copy_from_slice(&self.latest[3..6]),
            (part, frame) if part < self.plain => {
                for (lane, sensed) in frame.iter_mut().zip(&wrench[3 * (part - 2)..]) {
                    *lane = sensed * self.reach;
                }
            }
            (3, frame) => frame.fill(normal_n),
            (_, frame) => frame.fill(f64::from(u8::from(normal_n > 0.0))),
        }
    }

    fn write(&mut self, channel: usize, frame: &[f64]) {
        let first = if channel == 0 { 0 } else { 2 + channel };
        for (driven, given) in self.driven[first..].iter_mut().zip(frame) {
            *driven = *given;
        }
        self.reader.link.driven.put(&self.driven);
    }

    fn group_delay_s(&self, channel: usize) -> f64 {
        match &self.conditioner {
            Some(conditioner) if channel >= 2 => conditioner.group_delay_s(),
            _ => 0.0,
        }
    }

    fn poll(&mut self, now: Instant) {
        let stalled = |before| now.saturating_duration_since(before) > self.watch.timeout.max(STALL);
        if self.driven.iter().any(|driven| *driven != 0.0) && self.reader.woke.is_some_and(stalled) {
            // The device's own watchdog has stopped it.
            self.reader.link.interrupt();
        }
        self.reader.woke = Some(now);
    }

    fn take_interruption(&mut self) -> bool {
        let is_interrupted = self.reader.link.take_interruption();
        if is_interrupted {
            self.driven = [0.0; DRIVEN];
        }
        is_interrupted
    }

    fn ages(&self) -> Option<Arc<AgeMeter>> {
        Some(Arc::clone(&self.reader.link.ages))
    }

    fn live_input(&self) -> Option<LiveInput> {
        Some(LiveInput {
            cell: Arc::clone(&self.reader.link.input),
            holds: self.watch.holds,
            timeout_s: self.watch.timeout.as_secs_f64(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::time::Rate;

    fn remote(holds: bool) -> Remote {
        let cx = BuildContext::new("arm", Rate::new(1000, 1).unwrap());
        let watch = Watch { timeout: Duration::from_millis(20), fastest_m_s: 5.0, holds };
        let mut remote = Remote::new(watch, &cx);
        remote.advance();
        remote
    }

    fn news(remote: &mut Remote, x_m: f64) {
        let mut sensed = [0.0; SENSED];
        (sensed[0], sensed[8]) = (x_m, 1.5);
        remote.link().publish(&sensed);
        remote.advance();
    }

    fn state(remote: &Remote) -> InputState {
        remote.live_input().unwrap().cell.get()
    }

    fn force(remote: &mut Remote) -> f64 {
        let mut frame = [0.0];
        remote.read(3, &mut frame);
        frame[0]
    }

    #[test]
    fn what_is_driven_begins_from_zero_after_a_stall_and_what_is_read_only_goes_on() {
        let mut remote = remote(false);
        let start = Instant::now();
        let wakes_after = |remote: &mut Remote, ms: u64| {
            remote.poll(start + Duration::from_millis(ms));
            remote.take_interruption()
        };
        assert!(!wakes_after(&mut remote, 0) && !wakes_after(&mut remote, 100));
        remote.write(1, &[0.5]);
        assert!(!wakes_after(&mut remote, 110));
        assert!(wakes_after(&mut remote, 140));
        assert_eq!(remote.link().driven.look().unwrap().1, [0.0; DRIVEN]);
        assert!(!wakes_after(&mut remote, 170), "nothing is driven");
    }

    #[test]
    fn nothing_is_felt_before_it_speaks_and_everything_ten_milliseconds_after() {
        let mut remote = remote(false);
        assert_eq!((state(&remote), force(&mut remote)), (InputState::Never, 0.0));
        let mut before = 0.0;
        for _ in 0..10 {
            news(&mut remote, 0.0);
            let now = force(&mut remote);
            assert!(now > before && now - before < 0.16, "no leap: {before} to {now}");
            before = now;
        }
        assert_eq!(state(&remote), InputState::Heard);
        assert!((before - 1.5).abs() < 1e-9);
    }

    #[test]
    fn what_came_before_a_device_was_there_is_news_while_it_is_fresh() {
        let mut first = remote(false);
        news(&mut first, 0.01);
        let told = Instant::now();
        // An edit makes another device of the same address.
        let another = |ms: u64| {
            let mut another = remote(false);
            another.attach(first.link());
            another.poll(told + Duration::from_millis(ms));
            another.advance();
            another
        };
        let mut fresh = another(10);
        assert_eq!(state(&fresh), InputState::Heard);
        (0..11).for_each(|_| fresh.advance());
        assert_eq!(state(&fresh), InputState::Silent, "20 ms after it was told");
        let mut late = another(30);
        assert_eq!((state(&late), force(&mut late)), (InputState::Never, 0.0));
        late.reader.woke = Some(Instant::now());
        news(&mut late, 0.02);
        assert_eq!(state(&late), InputState::Heard);
    }

    #[test]
    fn a_zero_that_was_taken_outlives_an_edit() {
        let zero = ZeroSettings { window_s: 0.1, within_n: 10.0, steady_n: 0.2 };
        let rate = Rate::new(1000, 1).unwrap();
        let link = Arc::new(Link::default());
        link.zero.put(&[0.0, 0.0, -8.0, 0.0, 0.0, 0.0]);
        for (is_attached, expected_n) in [(true, 9.5), (false, 0.0)] {
            let mut edited =
                Remote { conditioner: Some(Conditioner::new(zero, None, rate).unwrap()), ..remote(false) };
            if is_attached {
                edited.attach(&link);
            }
            (0..30).for_each(|_| news(&mut edited, 0.0));
            assert!((force(&mut edited) - expected_n).abs() < 1e-9);
        }
    }

    #[test]
    fn what_it_is_driven_by_is_what_was_delivered() {
        let mut remote = remote(false);
        remote.write(0, &[2.0, 0.0, 0.0]);
        assert_eq!(remote.reader.link.driven.look().unwrap().1[0], 2.0);
    }

    #[test]
    fn ages_are_measured_while_it_speaks() {
        let mut remote = remote(false);
        remote.poll(Instant::now());
        remote.advance();
        assert_eq!(remote.ages().unwrap().ages().total(), 0);
        news(&mut remote, 0.0);
        news(&mut remote, 0.0);
        remote.poll(Instant::now() + Duration::from_millis(8));
        remote.advance();
        // Longer than between the news: the beginning of a silence.
        (0..5).for_each(|_| remote.advance());
        let ages = remote.ages().unwrap().ages();
        assert!(ages.total() == 3 && (8_000_000..1_000_000_000).contains(&ages.max_ns()), "{ages:?}");
    }

    #[test]
    fn silence_takes_forces_to_zero_or_holds_them_and_holds_the_position() {
        for (holds, after) in [(false, 0.0), (true, 1.5)] {
            let mut remote = remote(holds);
            (0..30).for_each(|_| news(&mut remote, 0.01));
            (0..20).for_each(|_| remote.advance());
            assert_eq!(state(&remote), InputState::Heard, "20 ms are no silence");
            (0..11).for_each(|_| remote.advance());
            assert_eq!(state(&remote), InputState::Silent);
            assert!((force(&mut remote) - after).abs() < 1e-9);
            let mut position = [0.0; 3];
            remote.read(0, &mut position);
            assert_eq!(position, [0.01, 0.0, 0.0]);
        }
    }

    #[test]
    fn a_jump_takes_forces_to_zero_for_a_while_and_a_fast_hand_does_not() {
        let mut remote = remote(false);
        (0..30).for_each(|k| news(&mut remote, 0.004 * f64::from(k)));
        assert_eq!(state(&remote), InputState::Heard, "4 m/s is fast, and allowed");
        for _ in 0..10 {
            news(&mut remote, 0.5);
        }
        assert_eq!(state(&remote), InputState::Jumped);
        assert!(force(&mut remote) < 1e-9);
        assert_eq!(remote.reader.link.counts().jumps, 1);
        (0..30).for_each(|_| news(&mut remote, 0.5));
        assert_eq!(state(&remote), InputState::Heard);
    }
}
