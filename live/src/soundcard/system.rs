//! The sound system, through cpal: lists cards, and opens streams to play or to listen.

use super::shared::{Detached, Shared};
use super::{Ability, CardFormat, Listed, OpenedStream, Request, SoundcardError};
use crate::timer::prepare_thread;
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{
    BufferSize, Error, ErrorKind, FromSample, I24, SampleFormat, SizedSample, Stream, StreamConfig,
    SupportedStreamConfigRange,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

/// Time limit for opening a stream.
pub(super) const OPENING: Duration = Duration::from_secs(5);

/// Direction of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    Play,
    Listen,
}

impl Direction {
    fn default_of(self, host: &cpal::Host) -> Option<cpal::Device> {
        match self {
            Self::Play => host.default_output_device(),
            Self::Listen => host.default_input_device(),
        }
    }

    fn devices_of(self, host: &cpal::Host) -> Result<Vec<cpal::Device>, SoundcardError> {
        match self {
            Self::Play => host.output_devices().map(Iterator::collect),
            Self::Listen => host.input_devices().map(Iterator::collect),
        }
        .map_err(system)
    }

    fn configs_of(self, device: &cpal::Device) -> Result<Vec<SupportedStreamConfigRange>, Error> {
        match self {
            Self::Play => device.supported_output_configs().map(Iterator::collect),
            Self::Listen => device.supported_input_configs().map(Iterator::collect),
        }
    }
}

/// The soundcards of this machine.
///
/// # Errors
/// [`SoundcardError::System`] if there is no sound system.
pub fn list() -> Result<Vec<Listed>, SoundcardError> {
    let mut found: Vec<Listed> = Vec::new();
    for host in hosts() {
        for direction in [Direction::Play, Direction::Listen] {
            // The default card is not always listed.
            let mut all = direction.devices_of(&host)?;
            let default = direction.default_of(&host);
            let default_name = default.as_ref().and_then(name);
            if !all.iter().any(|device| name(device) == default_name) {
                all.extend(default);
            }
            for device in all {
                let Some(name) = name(&device) else { continue };
                let known = found.iter().position(|card| card.name == name);
                let place = known.unwrap_or_else(|| {
                    found.push(Listed {
                        name: name.clone(),
                        about: about(&device),
                        plays: None,
                        listens: None,
                    });
                    found.len() - 1
                });
                let ability = Ability {
                    default: default_name.as_ref() == Some(&name),
                    // A card in use by another program does not state what it supports.
                    formats: direction
                        .configs_of(&device)
                        .map(|all| all.iter().map(shown).collect())
                        .unwrap_or_default(),
                };
                match direction {
                    Direction::Play => found[place].plays = Some(ability),
                    Direction::Listen => found[place].listens = Some(ability),
                }
            }
        }
    }
    Ok(found)
}

/// The available hosts, created one by one: cpal's default host can panic if a library is missing.
fn hosts() -> impl Iterator<Item = cpal::Host> {
    cpal::available_hosts().into_iter().filter_map(|id| cpal::host_from_id(id).ok())
}

fn name(device: &cpal::Device) -> Option<String> {
    device.id().ok().map(|id| id.id().to_owned())
}

pub(super) fn card_name(device: &cpal::Device) -> String {
    name(device).unwrap_or_else(|| about(device))
}

fn about(device: &cpal::Device) -> String {
    device.description().map_or_else(|_| String::new(), |about| about.name().to_owned())
}

fn shown(config: &SupportedStreamConfigRange) -> String {
    let (low, high) = (config.min_sample_rate(), config.max_sample_rate());
    let rates = if low == high { format!("{low} Hz") } else { format!("{low} to {high} Hz") };
    format!("{} channels, {}, {rates}", config.channels(), config.sample_format())
}

pub(super) fn system(error: Error) -> SoundcardError {
    SoundcardError::System(error.to_string())
}

/// State that the callback of a stream works with.
pub(super) trait CallbackState: Sized {
    const DIRECTION: Direction;

    /// Opens a stream with samples of type `T`.
    fn build<T>(setup: &Setup<Self>, device: &cpal::Device, config: StreamConfig) -> Result<Stream, Error>
    where
        T: SizedSample + FromSample<f64> + Send + 'static,
        f64: FromSample<T>;
}

/// Everything that a stream needs each time it is opened.
pub(super) struct Setup<P> {
    pub slot: Detached<P>,
    pub shared: Arc<Shared>,
    pub health: Arc<Health>,
    /// Messages of the callback's first call, and errors of the stream.
    pub errors: SyncSender<String>,
    pub start: Instant,
}

/// Health of a stream, by its errors.
#[derive(Debug, Default)]
pub(super) struct Health {
    /// The card has gone.
    pub lost: AtomicBool,
    /// An error occurred; the stream may recover.
    pub troubled: AtomicBool,
}

/// Finds the requested card and starts a stream.
pub(super) fn open<P: CallbackState>(
    request: &Request,
    setup: &Setup<P>,
) -> Result<(Stream, OpenedStream), SoundcardError> {
    let direction = P::DIRECTION;
    let is_able = |device: &cpal::Device| choose(direction, request, device, "").is_ok();
    let device = find(direction, request.device.as_deref(), is_able)?;
    let card = card_name(&device);
    let (channels, format) = choose(direction, request, &device, &card)?;
    let built = |buffer_size: BufferSize| {
        let config = StreamConfig { channels, sample_rate: request.rate_hz, buffer_size };
        match format {
            SampleFormat::F32 => P::build::<f32>(setup, &device, config),
            SampleFormat::I32 => P::build::<i32>(setup, &device, config),
            SampleFormat::I24 => P::build::<I24>(setup, &device, config),
            _ => P::build::<i16>(setup, &device, config),
        }
    };
    let stream = match built(BufferSize::Fixed(request.buffer_frames)) {
        // Fall back to another buffer size; the run reports it.
        Err(error) if error.kind() == ErrorKind::UnsupportedConfig => built(BufferSize::Default),
        other => other,
    };
    let stream = stream.map_err(system)?;
    stream.play().map_err(system)?;
    let got = OpenedStream {
        card,
        rate_hz: request.rate_hz,
        channels,
        format: format.to_string(),
        buffer_frames: stream.buffer_size().ok(),
    };
    Ok((stream, got))
}

/// The card of a name. One piece of hardware has several names of which some have too few channels: of those that `wanted` is a
/// part of, the first that `is_able`.
pub(super) fn find(
    direction: Direction,
    wanted: Option<&str>,
    is_able: impl Fn(&cpal::Device) -> bool,
) -> Result<cpal::Device, SoundcardError> {
    let mut names = Vec::new();
    for host in hosts() {
        let Some(wanted) = wanted else {
            match direction.default_of(&host) {
                Some(device) => return Ok(device),
                None => continue,
            }
        };
        let all = direction.devices_of(&host)?;
        let cards: Vec<[String; 2]> =
            all.iter().map(|device| [name(device).unwrap_or_default(), about(device)]).collect();
        names.extend(all.iter().filter_map(name));
        let place = pick(&cards, wanted, |place| is_able(&all[place]));
        if let Some(device) = place.and_then(|place| all.into_iter().nth(place)) {
            return Ok(device);
        }
    }
    Err(SoundcardError::Unknown {
        wanted: wanted.unwrap_or("default").to_owned(),
        does: match direction {
            Direction::Play => "plays",
            Direction::Listen => "listens",
        },
        found: match names.as_slice() {
            [] => "none".to_owned(),
            names => names.join(", "),
        },
    })
}

/// Of cards by name and description: the one of this name; else the first able one with it as a part; else the first with it as
/// a part, whose error then says what it lacks.
fn pick(cards: &[[String; 2]], wanted: &str, is_able: impl Fn(usize) -> bool) -> Option<usize> {
    let part = wanted.to_lowercase();
    let exact = cards.iter().position(|[name, _]| name == wanted);
    let has_part = |place: &usize| cards[*place].iter().any(|text| text.to_lowercase().contains(&part));
    let partly = || (0..cards.len()).filter(has_part);
    exact.or_else(|| partly().find(|place| is_able(*place))).or_else(|| partly().next())
}

/// The smallest sufficient number of channels, and the best sample format at the rate.
pub(super) fn choose(
    direction: Direction,
    request: &Request,
    device: &cpal::Device,
    card: &str,
) -> Result<(u16, SampleFormat), SoundcardError> {
    let wanted = match request.format {
        CardFormat::Best => &[SampleFormat::F32, SampleFormat::I32, SampleFormat::I24, SampleFormat::I16][..],
        CardFormat::Float => &[SampleFormat::F32],
        CardFormat::Bits32 => &[SampleFormat::I32],
        CardFormat::Bits24 => &[SampleFormat::I24],
        CardFormat::Bits16 => &[SampleFormat::I16],
    };
    let rate = request.rate_hz;
    let all = direction.configs_of(device).map_err(system)?;
    let fits = |config: &&SupportedStreamConfigRange| {
        config.channels() >= request.channels
            && (config.min_sample_rate()..=config.max_sample_rate()).contains(&rate)
    };
    let best = |config: &&SupportedStreamConfigRange| {
        let place = wanted.iter().position(|format| *format == config.sample_format())?;
        Some((config.channels(), place))
    };
    let chosen = all.iter().filter(fits).filter(|config| best(config).is_some()).min_by_key(best);
    chosen.map(|config| (config.channels(), config.sample_format())).ok_or_else(|| {
        SoundcardError::Unsupported {
            card: card.to_owned(),
            wanted: format!("{} channels at {rate} Hz in {wanted:?}", request.channels),
            found: all.iter().map(shown).collect::<Vec<_>>().join("; "),
        }
    })
}

impl<P> Setup<P> {
    /// Returns a function that prepares the stream's thread at the first callback, before its first sample: only then
    /// it may block.
    pub(crate) fn preparation(&self) -> impl FnMut() + Send + use<P> {
        let mut errors = Some(self.errors.clone());
        move || {
            if let Some(errors) = errors.take() {
                for refused in prepare_thread() {
                    let _ = errors.try_send(refused);
                }
            }
        }
    }

    /// Returns the error callback of a stream.
    pub(super) fn failed(&self) -> impl FnMut(Error) + Send + use<P> {
        let (shared, health) = (Arc::clone(&self.shared), Arc::clone(&self.health));
        let errors = self.errors.clone();
        move |error| match error.kind() {
            // There can be thousands of xruns: only count them.
            ErrorKind::Xrun => {
                shared.xruns.fetch_add(1, Relaxed);
                shared.after_xrun.store(true, Relaxed);
            }
            ErrorKind::DeviceNotAvailable | ErrorKind::StreamInvalidated => health.lost.store(true, Relaxed),
            _ => {
                health.troubled.store(true, Relaxed);
                // The queue is full: drop the message.
                let _ = errors.try_send(error.to_string());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_a_name_finds_the_card_with_enough_channels() {
        let about = "DualSense Wireless Controller, USB Audio";
        let cards = [
            ("default", "PipeWire"),
            ("front:CARD=Controller", about),
            ("hw:CARD=Controller", about),
            ("hw:CARD=PCH", "PCH"),
        ];
        let cards = cards.map(|(name, about)| [name.to_owned(), about.to_owned()]);
        let has_four = |place: usize| place == 2;
        assert_eq!(pick(&cards, "wireless controller", has_four), Some(2));
        assert_eq!(pick(&cards, "front:CARD=Controller", has_four), Some(1), "the very name");
        assert_eq!(pick(&cards, "PCH", has_four), Some(3), "what it lacks is reported");
        assert_eq!(pick(&cards, "Scarlett", has_four), None);
    }
}
