//! Soundcards through cpal: what there is, and a stream that drives a live run.

use super::fill::{Filler, Home, Shared};
use super::{CardCounts, CardFormat, Got, Listed, Request, SoundcardError};
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{
    BufferSize, Error, ErrorKind, FromSample, I24, OutputCallbackInfo, SampleFormat, SizedSample,
    StreamConfig, SupportedStreamConfigRange,
};
use haptograph_engine::run::{Live, Timer};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A card that has not asked for samples for so long has gone.
const SILENT: Duration = Duration::from_secs(2);
/// How often one that has gone is looked for.
const RETRY: Duration = Duration::from_millis(500);
/// How long a system may take to open a stream.
const OPENING: Duration = Duration::from_secs(5);

/// The soundcards of this machine that can play.
///
/// # Errors
/// [`SoundcardError::System`] where it has no sound system.
pub fn list() -> Result<Vec<Listed>, SoundcardError> {
    let mut found = Vec::new();
    for host in hosts() {
        let default = host.default_output_device().and_then(|device| device.id().ok());
        for device in host.output_devices().map_err(system)? {
            let Ok(id) = device.id() else { continue };
            found.push(Listed {
                default: default.as_ref() == Some(&id),
                about: about(&device),
                name: id.id().to_owned(),
                // A card that another program holds does not say what it can.
                formats: device
                    .supported_output_configs()
                    .map(|all| all.map(|config| shown(&config)).collect())
                    .unwrap_or_default(),
            });
        }
    }
    Ok(found)
}

/// The hosts that are there. Asked for one by one: asking for the default one can panic where a library is missing.
fn hosts() -> impl Iterator<Item = cpal::Host> {
    cpal::available_hosts()
        .into_iter()
        .filter_map(|id| cpal::host_from_id(id).ok())
}

fn about(device: &cpal::Device) -> String {
    device
        .description()
        .map_or_else(|_| String::new(), |about| about.name().to_owned())
}

fn shown(config: &SupportedStreamConfigRange) -> String {
    let (low, high) = (config.min_sample_rate(), config.max_sample_rate());
    let rates = if low == high {
        format!("{low} Hz")
    } else {
        format!("{low} to {high} Hz")
    };
    format!(
        "{} channels, {}, {rates}",
        config.channels(),
        config.sample_format()
    )
}

fn system(error: Error) -> SoundcardError {
    SoundcardError::System(error.to_string())
}

/// What the sound system states of a stream.
#[derive(Debug, Default)]
struct Stated {
    xruns: AtomicU64,
    output_latency_max_ns: AtomicU64,
    /// The card has gone.
    lost: AtomicBool,
}

/// A stream that drives a live run.
pub struct CardDriver {
    request: Request,
    got: Got,
    stream: Option<cpal::Stream>,
    home: Home,
    shared: Arc<Shared>,
    stated: Arc<Stated>,
    /// What the callback has to say; only its first call and errors speak.
    told: (SyncSender<String>, Receiver<String>),
    start: Instant,
    vanished: u64,
    /// When the last new callback was seen, and which.
    heard: (Instant, u64),
    tried: Instant,
    rested: Option<Instant>,
}

impl CardDriver {
    /// Opens the card and lets it drive a live run.
    ///
    /// # Errors
    /// [`SoundcardError`] where there is no such card, or it cannot do what is asked for.
    pub fn start(request: Request, live: Live) -> Result<Self, SoundcardError> {
        let home: Home = Arc::new(Mutex::new(Some(Box::new(live))));
        let shared = Arc::new(Shared::default());
        let stated = Arc::new(Stated::default());
        let told = sync_channel(64);
        let start = Instant::now();
        let opening = Opening {
            request: &request,
            home: &home,
            shared: &shared,
            stated: &stated,
            told: &told.0,
            start,
        };
        let (stream, got) = opening.open()?;
        Ok(Self {
            request,
            got,
            stream: Some(stream),
            home,
            shared,
            stated,
            told,
            start,
            vanished: 0,
            heard: (Instant::now(), 0),
            tried: Instant::now(),
            rested: None,
        })
    }

    /// What was got.
    pub fn got(&self) -> &Got {
        &self.got
    }

    /// Looks after the stream: reopens it where the card has gone and come back. Returns what there is to say.
    pub fn tend(&mut self) -> Vec<String> {
        let mut said: Vec<String> = self.told.1.try_iter().collect();
        let now = Instant::now();
        let callbacks = self.shared.callbacks.load(Relaxed);
        if callbacks != self.heard.1 {
            self.heard = (now, callbacks);
        }
        if self.shared.at_rest.load(Relaxed) && self.rested.is_none() {
            self.rested = Some(now);
        }
        let silent = now.saturating_duration_since(self.heard.0) > SILENT;
        if self.stream.is_some() && (silent || self.stated.lost.load(Relaxed)) {
            // What was driven by it is at rest with it; the run waits at home.
            self.stream = None;
            self.vanished += 1;
            self.tried = now;
            said.push(format!(
                "soundcard {} has gone; the run waits until it is back",
                self.got.card
            ));
        } else if self.stream.is_none() && now.saturating_duration_since(self.tried) > RETRY {
            self.tried = now;
            said.extend(self.reopen());
        }
        said
    }

    fn reopen(&mut self) -> Option<String> {
        self.stated.lost.store(false, Relaxed);
        if let Some(live) = at_home(&self.home).as_mut() {
            live.resume();
        }
        let opening = Opening {
            request: &self.request,
            home: &self.home,
            shared: &self.shared,
            stated: &self.stated,
            told: &self.told.0,
            start: self.start,
        };
        let (stream, got) = opening.open().ok()?;
        (self.stream, self.got) = (Some(stream), got);
        self.heard.0 = Instant::now();
        Some(format!("soundcard {} is back", self.got.card))
    }

    /// Is the run over, and have the last buffers been played?
    pub fn is_finished(&self) -> bool {
        let frames = self.got.buffer_frames.unwrap_or(self.request.buffer_frames);
        let plays = Duration::from_secs_f64(3.0 * f64::from(frames) / f64::from(self.got.rate_hz));
        self.rested.is_some_and(|since| since.elapsed() > plays)
    }

    /// Is the card away?
    pub fn is_waiting(&self) -> bool {
        self.stream.is_none()
    }

    /// What was counted.
    pub fn counts(&self) -> CardCounts {
        CardCounts {
            xruns: self.stated.xruns.load(Relaxed),
            xrun_delay_max_ns: self.shared.xrun_delay_max_ns.load(Relaxed),
            xrun_last_ns: self.shared.xrun_last_ns.load(Relaxed),
            clipped: self.shared.clipped.load(Relaxed),
            vanished: self.vanished,
            output_latency_max_ns: self.stated.output_latency_max_ns.load(Relaxed),
        }
    }

    /// Closes the stream and gives the run back.
    pub fn join(mut self) -> Option<Live> {
        self.stream = None;
        at_home(&self.home).take().map(|live| *live)
    }
}

fn at_home(home: &Home) -> std::sync::MutexGuard<'_, Option<Box<Live>>> {
    home.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a stream is opened with.
struct Opening<'a> {
    request: &'a Request,
    home: &'a Home,
    shared: &'a Arc<Shared>,
    stated: &'a Arc<Stated>,
    told: &'a SyncSender<String>,
    start: Instant,
}

impl Opening<'_> {
    fn open(&self) -> Result<(cpal::Stream, Got), SoundcardError> {
        let device = self.device()?;
        let card = device
            .id()
            .map_or_else(|_| about(&device), |id| id.id().to_owned());
        let (channels, format) = self.choose(&device, &card)?;
        let mut config = StreamConfig {
            channels,
            sample_rate: self.request.rate_hz,
            buffer_size: BufferSize::Fixed(self.request.buffer_frames),
        };
        let mut built = self.build(&device, config, format);
        if built
            .as_ref()
            .is_err_and(|error| error.kind() == ErrorKind::UnsupportedConfig)
        {
            // A buffer of another size is better than none; what was got is said.
            config.buffer_size = BufferSize::Default;
            built = self.build(&device, config, format);
        }
        let stream = built.map_err(system)?;
        stream.play().map_err(system)?;
        let got = Got {
            card,
            rate_hz: self.request.rate_hz,
            channels,
            format: format.to_string(),
            buffer_frames: stream.buffer_size().ok(),
        };
        Ok((stream, got))
    }

    fn device(&self) -> Result<cpal::Device, SoundcardError> {
        let mut names = Vec::new();
        for host in hosts() {
            let Some(wanted) = &self.request.device else {
                match host.default_output_device() {
                    Some(device) => return Ok(device),
                    None => continue,
                }
            };
            let all: Vec<cpal::Device> = host.output_devices().map_err(system)?.collect();
            let name = |device: &cpal::Device| device.id().map(|id| id.id().to_owned()).unwrap_or_default();
            let part = wanted.to_lowercase();
            let exact = all.iter().position(|device| name(device) == *wanted);
            let partly = || {
                all.iter().position(|device| {
                    name(device).to_lowercase().contains(&part)
                        || about(device).to_lowercase().contains(&part)
                })
            };
            names.extend(all.iter().map(name));
            if let Some(device) = exact.or_else(partly).and_then(|place| all.into_iter().nth(place)) {
                return Ok(device);
            }
        }
        Err(SoundcardError::Unknown {
            wanted: self
                .request
                .device
                .clone()
                .unwrap_or_else(|| "default".to_owned()),
            found: if names.is_empty() {
                "none".to_owned()
            } else {
                names.join(", ")
            },
        })
    }

    /// The fewest channels that suffice, and the best form of samples at the rate.
    fn choose(&self, device: &cpal::Device, card: &str) -> Result<(u16, SampleFormat), SoundcardError> {
        let wanted = match self.request.format {
            CardFormat::Best => &[
                SampleFormat::F32,
                SampleFormat::I32,
                SampleFormat::I24,
                SampleFormat::I16,
            ][..],
            CardFormat::Float => &[SampleFormat::F32],
            CardFormat::Bits32 => &[SampleFormat::I32],
            CardFormat::Bits24 => &[SampleFormat::I24],
            CardFormat::Bits16 => &[SampleFormat::I16],
        };
        let rate = self.request.rate_hz;
        let all: Vec<_> = device.supported_output_configs().map_err(system)?.collect();
        let fits = |config: &&SupportedStreamConfigRange| {
            config.channels() >= self.request.channels
                && (config.min_sample_rate()..=config.max_sample_rate()).contains(&rate)
        };
        let best = |config: &&SupportedStreamConfigRange| {
            let place = wanted
                .iter()
                .position(|format| *format == config.sample_format())?;
            Some((config.channels(), place))
        };
        let chosen = all
            .iter()
            .filter(fits)
            .filter(|config| best(config).is_some())
            .min_by_key(best);
        chosen
            .map(|config| (config.channels(), config.sample_format()))
            .ok_or_else(|| SoundcardError::Unsupported {
                card: card.to_owned(),
                wanted: format!("{} channels at {rate} Hz in {wanted:?}", self.request.channels),
                found: all.iter().map(shown).collect::<Vec<_>>().join("; "),
            })
    }

    fn build(
        &self,
        device: &cpal::Device,
        config: StreamConfig,
        format: SampleFormat,
    ) -> Result<cpal::Stream, Error> {
        match format {
            SampleFormat::F32 => self.build_as::<f32>(device, config),
            SampleFormat::I32 => self.build_as::<i32>(device, config),
            SampleFormat::I24 => self.build_as::<I24>(device, config),
            _ => self.build_as::<i16>(device, config),
        }
    }

    fn build_as<T: SizedSample + FromSample<f64> + Send + 'static>(
        &self,
        device: &cpal::Device,
        config: StreamConfig,
    ) -> Result<cpal::Stream, Error> {
        let mut filler = Filler::new(self.home, self.shared, config.sample_rate, self.start);
        let channels = usize::from(config.channels);
        let (stated, told) = (Arc::clone(self.stated), self.told.clone());
        let mut first = true;
        let fill = move |data: &mut [T], info: &OutputCallbackInfo| {
            if std::mem::take(&mut first) {
                // Before the first sample: the only moment at which this thread may wait.
                for refused in Timer::default().prepare_thread().refused {
                    let _ = told.try_send(refused);
                }
            }
            let stamp = info.timestamp();
            let ahead = stamp.playback.saturating_duration_since(stamp.callback);
            stated
                .output_latency_max_ns
                .fetch_max(ahead.as_nanos() as u64, Relaxed);
            filler.fill(data, channels, T::EQUILIBRIUM, T::from_sample);
        };
        let (shared, stated) = (Arc::clone(self.shared), Arc::clone(self.stated));
        let told = self.told.clone();
        let failed = move |error: Error| match error.kind() {
            // One of these can bring thousands: they are counted only.
            ErrorKind::Xrun => {
                stated.xruns.fetch_add(1, Relaxed);
                shared.after_xrun.store(true, Relaxed);
            }
            ErrorKind::DeviceNotAvailable | ErrorKind::StreamInvalidated => stated.lost.store(true, Relaxed),
            _ => {
                // Where nobody reads, one more is not needed.
                let _ = told.try_send(error.to_string());
            }
        };
        device.build_output_stream(config, fill, failed, Some(OPENING))
    }
}
