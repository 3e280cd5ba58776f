//! State shared by a device's body, which ticks, and the thread that reaches the device: the latest update each way,
//! lock-free and wait-free.

use haptograph_engine::run::AgeMeter;
use haptograph_engine::silence::{InputCell, InputState};
use haptograph_signal::time::Rate;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering, fence};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The latest update of N numbers: one thread writes, others read. A read during a write returns none.
#[derive(Debug)]
pub struct Latest<const N: usize> {
    /// Version, odd during a write.
    version: AtomicU64,
    words: [AtomicU64; N],
}

/// Attempts of a read that meets a write.
const TRIES: usize = 4;

impl<const N: usize> Default for Latest<N> {
    fn default() -> Self {
        Self { version: AtomicU64::new(0), words: std::array::from_fn(|_| AtomicU64::new(0)) }
    }
}

impl<const N: usize> Latest<N> {
    /// Writes new numbers. Only one thread may call it.
    pub fn put(&self, values: &[f64; N]) {
        let version = self.version.load(Ordering::Relaxed);
        self.version.store(version.wrapping_add(1), Ordering::Relaxed);
        fence(Ordering::Release);
        for (word, value) in self.words.iter().zip(values) {
            word.store(value.to_bits(), Ordering::Relaxed);
        }
        self.version.store(version.wrapping_add(2), Ordering::Release);
    }

    /// Number of writes and the latest numbers; none during a write.
    pub fn look(&self) -> Option<(u64, [f64; N])> {
        (0..TRIES).find_map(|_| {
            let before = self.version.load(Ordering::Acquire);
            let values = std::array::from_fn(|i| f64::from_bits(self.words[i].load(Ordering::Relaxed)));
            fence(Ordering::Acquire);
            let after = self.version.load(Ordering::Relaxed);
            (before == after && before.is_multiple_of(2)).then_some((before / 2, values))
        })
    }
}

/// Size of a state: position (m), orientation (rotation vector, rad), force (N), torque (N m).
pub const SENSED: usize = 12;
/// Size of a command: force (N), current of the actuator and of the brake (A).
pub const DRIVEN: usize = 5;

/// Counts of a device's packets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counts {
    /// Accepted.
    pub accepted: u64,
    /// Packets that were sent but never received.
    pub missing: u64,
    /// Dropped because a newer one was accepted: out of order, or duplicate.
    pub outdated: u64,
    /// Wrong size, version or content.
    pub malformed: u64,
    /// A number is NaN or infinite.
    pub not_numbers: u64,
    /// A number is larger than a device may send.
    pub too_large: u64,
    /// The sender was not the device.
    #[cfg_attr(feature = "serde", serde(rename = "strangers"))]
    pub rejected_packets: u64,
    /// Accepted, but the tip had moved faster than a hand can.
    pub jumps: u64,
    /// Number of times that no zero of force and torque was taken, because something moved or pressed.
    pub refused_zeros: u64,
    /// The OSC address is one that no device listens to.
    pub unclaimed: u64,
}

/// The latest updates in both directions of a device, and its counts.
#[derive(Debug, Default)]
pub struct Link {
    /// The latest measurements of the device.
    pub sensed: Latest<SENSED>,
    /// The latest commands to its actuators.
    pub driven: Latest<DRIVEN>,
    /// The zero of force and torque, once it is taken. It outlives the devices of edited graphs.
    pub zero: Latest<6>,
    /// Age of the measurements when they are read.
    pub ages: Arc<AgeMeter>,
    /// State of the device's input, set by its ticks.
    pub input: Arc<InputCell>,
    /// The OSC addresses of messages that no device listens to.
    pub unclaimed: Unclaimed,
    /// True from zeros that the device got because the ticks stalled until the ticks begin from zero.
    interrupted: AtomicBool,
    counts: [AtomicU64; 10],
}

/// One of the [`Counts`].
#[derive(Debug, Clone, Copy)]
pub enum Count {
    /// Accepted.
    Accepted,
    /// Lost on the way.
    Missing,
    /// Older than one that was accepted.
    Outdated,
    /// The size, version or content is wrong.
    Malformed,
    /// A number is NaN or infinite.
    NotNumbers,
    /// A number is too large.
    TooLarge,
    /// The sender was not the device.
    Rejected,
    /// Accepted, though the tip had moved too fast.
    Jumps,
    /// A zero was not taken.
    RefusedZeros,
    /// The OSC address is one that no device listens to.
    Unclaimed,
}

/// OSC addresses that no device listens to, with the number of messages to each. No real-time thread reads them.
#[derive(Debug, Default)]
pub struct Unclaimed(Mutex<Vec<(String, u64)>>);

impl Unclaimed {
    /// Largest number of addresses that are kept, the first to arrive, and their largest length, bytes.
    const MOST: usize = 16;
    const LONGEST: usize = 100;

    /// Counts a message to this address.
    pub fn add(&self, address: &str) {
        let mut list = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, times)) = list.iter_mut().find(|(known, _)| known == address) {
            *times += 1;
        } else if list.len() < Self::MOST && address.len() <= Self::LONGEST {
            list.push((address.to_owned(), 1));
        }
    }

    /// The addresses that are kept, with their present counts.
    pub fn list(&self) -> Vec<(String, u64)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Link {
    /// Version of the latest command; 0 before the first.
    pub fn driven_version(&self) -> u64 {
        self.driven.look().map_or(0, |(version, _)| version)
    }

    /// Marks that the device got zeros because no new command had come: it gets them until the ticks begin from zero.
    pub fn interrupt(&self) {
        self.interrupted.store(true, Ordering::Release);
    }

    /// True until the ticks begin from zero after an interruption.
    pub fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Acquire)
    }

    /// Ends an interruption, if there is one, with a command of zeros.
    pub fn take_interruption(&self) -> bool {
        let is_interrupted = self.is_interrupted();
        if is_interrupted {
            self.driven.put(&[0.0; DRIVEN]);
            self.interrupted.store(false, Ordering::Release);
        }
        is_interrupted
    }

    /// Publishes an update of the device's measurements.
    pub fn publish(&self, sensed: &[f64; SENSED]) {
        self.sensed.put(sensed);
        self.count(Count::Accepted, 1);
        self.ages.news(Instant::now());
    }

    /// Publishes an update of an input of one number.
    pub fn publish_number(&self, number: f64) {
        let mut sensed = [0.0; SENSED];
        sensed[0] = number;
        self.publish(&sensed);
    }

    /// Adds to a count.
    pub fn count(&self, what: Count, times: u64) {
        self.counts[what as usize].fetch_add(times, Ordering::Relaxed);
    }

    /// All counts.
    pub fn counts(&self) -> Counts {
        let [
            accepted,
            missing,
            outdated,
            malformed,
            not_numbers,
            too_large,
            rejected_packets,
            jumps,
            refused_zeros,
            unclaimed,
        ] = std::array::from_fn(|i| self.counts[i].load(Ordering::Relaxed));
        Counts {
            accepted,
            missing,
            outdated,
            malformed,
            not_numbers,
            too_large,
            rejected_packets,
            jumps,
            refused_zeros,
            unclaimed,
        }
    }

    /// Counts a message to an OSC address that no device listens to.
    pub fn count_unclaimed(&self, address: &str) {
        self.count(Count::Unclaimed, 1);
        self.unclaimed.add(address);
    }
}

/// The reading end of a link for a ticking thread: its updates and their age.
#[derive(Debug, Clone)]
pub(super) struct Reader {
    pub link: Arc<Link>,
    period_s: f64,
    /// Age in ticks beyond which an update is stale.
    timeout_ticks: u64,
    /// Version of the latest update that was taken.
    seen: u64,
    /// Ticks since that update.
    age: u64,
    /// Largest number of ticks between two updates that was not a silence.
    longest_gap: u64,
    /// Time at which the driver of a live run woke.
    pub woke: Option<Instant>,
}

/// An update that has arrived since the last tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct News {
    pub sensed: [f64; SENSED],
    version: u64,
    age: u64,
}

impl Reader {
    /// Makes a reader for ticks at a rate, for which updates older than `timeout` are stale.
    pub(super) fn new(link: &Arc<Link>, rate: Rate, timeout: Duration) -> Self {
        let period_s = rate.period_s();
        Self {
            link: Arc::clone(link),
            period_s,
            timeout_ticks: (timeout.as_secs_f64() / period_s).ceil() as u64,
            seen: 0,
            age: 0,
            longest_gap: 0,
            woke: None,
        }
    }

    /// Advances by a tick. Returns a new update, to be [taken](Self::take).
    pub(super) fn advance(&mut self) -> Option<News> {
        self.age = self.age.saturating_add(1);
        let (version, sensed) = self.link.sensed.look()?;
        if version == self.seen {
            return None;
        }
        let age = self.age_of_news()?;
        Some(News { sensed, version, age })
    }

    /// Takes an update as the latest.
    pub(super) fn take(&mut self, news: &News) {
        if !self.is_silent() {
            self.longest_gap = self.longest_gap.max(self.age);
        }
        (self.seen, self.age) = (news.version, news.age);
    }

    /// Measures the age of the latest update when it is read. A gap longer than all gaps so far counts as the beginning
    /// of a silence and is not measured; if a sender only `speaks_of_changes`, each update is measured once.
    pub(super) fn measure_age(&self, is_news: bool, speaks_of_changes: bool) {
        let is_awaited = !speaks_of_changes && self.age <= self.longest_gap && !self.is_silent();
        if let Some(woke) = self.woke.filter(|_| is_news || is_awaited) {
            self.link.ages.read(woke, 0.0);
        }
    }

    /// True if an update has ever arrived.
    pub(super) fn was_heard(&self) -> bool {
        self.seen > 0
    }

    /// True if the input is silent: no update has arrived within the timeout.
    pub(super) fn is_silent(&self) -> bool {
        self.seen == 0 || self.age > self.timeout_ticks
    }

    /// State of the input.
    pub(super) fn state(&self) -> InputState {
        match () {
            () if !self.was_heard() => InputState::Never,
            () if self.is_silent() => InputState::Silent,
            () => InputState::Heard,
        }
    }

    /// Time since the latest update, s.
    pub(super) fn age_s(&self) -> f64 {
        self.age as f64 * self.period_s
    }

    /// Number of ticks without an update that is a silence.
    pub(super) fn timeout_ticks(&self) -> u64 {
        self.timeout_ticks
    }

    /// Age of the new update, in ticks; `None` if it arrived before this reader was made and is stale.
    fn age_of_news(&self) -> Option<u64> {
        let Some(woke) = self.woke.filter(|_| self.seen == 0) else {
            return Some(0);
        };
        let age_s = self.link.ages.newest(woke).as_secs_f64();
        let ticks = (age_s / self.period_s) as u64;
        (ticks <= self.timeout_ticks).then_some(ticks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_never_sees_half_of_a_put() {
        let latest = Arc::new(Latest::<8>::default());
        let writer = Arc::clone(&latest);
        let putting = std::thread::spawn(move || (1..=100_000).for_each(|k| writer.put(&[f64::from(k); 8])));
        let mut newest = 0;
        while newest < 100_000 {
            if let Some((version, values)) = latest.look() {
                assert!(values.iter().all(|value| *value == version as f64), "{version}: {values:?}");
                assert!(version >= newest);
                newest = version;
            }
        }
        putting.join().unwrap();
    }
}
