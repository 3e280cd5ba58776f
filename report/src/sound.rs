//! The vibration of a run as a sound: the signal of an actuator at a safe level, for the page or a soundcard.

use super::record::{Reduction, WatchedOutput, watch};
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::Graph;
use haptograph_engine::node::Stream;
use haptograph_nodes::sinks::plots::GROUP as PLOTS;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::resample::{Quality, resample_whole};
use haptograph_signal::time::Rate;

/// Sampling rate of every sound, Hz, supported by all soundcards and browsers.
pub const RATE_HZ: u32 = 48_000;
/// Maximum length of a sound, s.
pub(crate) const LONGEST_S: f64 = 10.0;
/// Peak level of every sound, dBFS.
pub const PEAK_DBFS: f64 = -12.0;
/// Minimum rate of a signal, Hz: a slower one contains only the lowest audible frequencies.
const SLOWEST_HZ: f64 = 2000.0;
/// Fade at both ends, s, which avoids clicks.
const FADE_S: f64 = 0.005;
/// Maximum number of candidate signals kept until the silent ones are known.
const MAX_CANDIDATES: usize = 4;

/// Candidate outputs for the sound of a graph, the most suitable first: outputs of actuators, then vibrations
/// that are written to files or plotted.
pub fn audible(graph: &Graph) -> Vec<WatchedOutput> {
    let nodes = graph.nodes();
    let actuators = nodes.ids().filter(|index| nodes[*index].entry.is_actuator());
    let delivered = actuators.filter_map(|index| watch(graph, index, 0));
    let files = nodes.ids().filter(|index| {
        let entry = &nodes[*index].entry;
        entry.is_file() && entry.spec.group != PLOTS
    });
    let written = files
        .flat_map(|index| nodes.incoming(index))
        .filter_map(|edge| watch(graph, edge.from, edge.edge.output));
    let mut found: Vec<WatchedOutput> = Vec::new();
    for candidate in delivered.chain(written) {
        let stream = &candidate.stream;
        let is_vibration = [Quantity::ACCELERATION, Quantity::FORCE, Quantity::VOLTAGE, Quantity::CURRENT]
            .contains(&stream.quantity);
        let is_fast = stream.kind == Kind::SCALAR && stream.rate.hz() >= SLOWEST_HZ;
        if is_vibration && is_fast && !found.contains(&candidate) {
            found.push(candidate);
        }
    }
    found.truncate(MAX_CANDIDATES);
    found
}

/// The beginning of a signal, unprocessed.
#[derive(Debug, Clone)]
pub struct Clip {
    /// Clock, kind and quantity of the signal.
    pub stream: Stream,
    samples: Vec<f32>,
    most: usize,
    frames: u64,
}

impl Clip {
    /// The empty clip of a scalar, which keeps its first `LONGEST_S`.
    pub fn of(stream: Stream) -> Self {
        let most = (LONGEST_S * stream.rate.hz()) as usize;
        Self { stream, samples: Vec::new(), most, frames: 0 }
    }
}

impl Reduction for Clip {
    fn extend(&mut self, frames: &[f64]) {
        let room = self.most - self.samples.len();
        let finite = |x: &f64| if x.is_finite() { *x as f32 } else { 0.0 };
        self.samples.extend(frames.iter().take(room).map(finite));
        self.frames += frames.len() as u64;
    }
}

/// A sound: one channel at [`RATE_HZ`], with its peak at [`PEAK_DBFS`].
#[derive(Debug, Clone, PartialEq)]
pub struct Sound {
    /// Clock, kind and quantity of the signal.
    pub stream: Stream,
    /// Samples relative to full scale.
    pub samples: Vec<f32>,
    /// Peak of the signal about its mean, SI.
    pub peak: f64,
    /// Value of a sample of 1, SI.
    pub full_scale: f64,
    /// Duration of the whole signal, s.
    pub of_s: f64,
}

impl Sound {
    /// The sound of the first clip that is not silent; `None` if all are.
    pub fn of<'a>(clips: impl IntoIterator<Item = &'a Clip>) -> Option<Self> {
        clips.into_iter().find_map(Self::of_one)
    }

    fn of_one(clip: &Clip) -> Option<Self> {
        let count = clip.samples.len() as f64;
        let mean = clip.samples.iter().map(|x| f64::from(*x)).sum::<f64>() / count;
        let about_mean: Vec<f64> = clip.samples.iter().map(|x| f64::from(*x) - mean).collect();
        let peak = about_mean.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
        let level = about_mean.iter().chain([&mean]).fold(0.0, |most: f64, x| most.max(x.abs()));
        // The remainder of a constant after subtraction of its mean is rounding error.
        if count == 0.0 || peak <= 1e-6 * level {
            return None;
        }
        let to = Rate::from_hz(u64::from(RATE_HZ)).ok()?;
        let resampled = resample_whole(&about_mean, clip.stream.rate, to, Quality::STANDARD).ok()?;
        let peak = resampled.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
        let full_scale = peak / 10_f64.powf(PEAK_DBFS / 20.0);
        Some(Self {
            samples: levelled(&resampled, full_scale),
            peak,
            full_scale,
            of_s: clip.frames as f64 * clip.stream.rate.period_s(),
            stream: clip.stream.clone(),
        })
    }

    /// Duration, s.
    pub fn duration_s(&self) -> f64 {
        self.samples.len() as f64 / f64::from(RATE_HZ)
    }

    /// A WAV file with 16-bit samples.
    pub(crate) fn to_wav(&self) -> Vec<u8> {
        wav(&self.samples, 1)
    }
}

/// The beginnings of two vibrations of one rate as a WAV file of two channels at one scale; `None` if both are silent, or if
/// their rate cannot be converted.
pub(crate) fn wav_of_pair(samples: [&[f64]; 2], rate_hz: f64) -> Option<Vec<u8>> {
    let from = Rate::parse(&rate_hz.to_string()).ok()?;
    let to = Rate::from_hz(u64::from(RATE_HZ)).ok()?;
    let most = samples[0].len().min(samples[1].len()).min((LONGEST_S * rate_hz) as usize);
    let resampled = samples.map(|samples| {
        let mean = samples[..most].iter().sum::<f64>() / most.max(1) as f64;
        let about_mean: Vec<f64> = samples[..most].iter().map(|x| x - mean).collect();
        resample_whole(&about_mean, from, to, Quality::STANDARD).ok()
    });
    let [a, b] = [resampled[0].as_ref()?, resampled[1].as_ref()?];
    let peak = a.iter().chain(b).fold(0.0, |peak: f64, x| peak.max(x.abs()));
    let full_scale = peak / 10_f64.powf(PEAK_DBFS / 20.0);
    let both = [a, b].map(|samples| levelled(samples, full_scale));
    let frames: Vec<f32> = both[0].iter().zip(&both[1]).flat_map(|(a, b)| [*a, *b]).collect();
    (peak > 0.0).then(|| wav(&frames, 2))
}

/// A WAV file at [`RATE_HZ`] with 16-bit samples, frame after frame.
fn wav(samples: &[f32], channels: u16) -> Vec<u8> {
    let (bytes, frame) = (2 * samples.len() as u32, 2 * channels);
    let mut wav = Vec::with_capacity(44 + bytes as usize);
    wav.extend(b"RIFF");
    wav.extend((36 + bytes).to_le_bytes());
    wav.extend(b"WAVEfmt ");
    // PCM, channels, rate, bytes per second, bytes per frame, bits per sample.
    wav.extend(16_u32.to_le_bytes());
    wav.extend(1_u16.to_le_bytes());
    wav.extend(channels.to_le_bytes());
    wav.extend(RATE_HZ.to_le_bytes());
    wav.extend((u32::from(frame) * RATE_HZ).to_le_bytes());
    wav.extend(frame.to_le_bytes());
    wav.extend(16_u16.to_le_bytes());
    wav.extend(b"data");
    wav.extend(bytes.to_le_bytes());
    let samples = samples.iter().map(|x| (x * 32767.0).round() as i16);
    wav.extend(samples.flat_map(i16::to_le_bytes));
    wav
}

/// Samples relative to full scale, faded at both ends.
fn levelled(samples: &[f64], full_scale: f64) -> Vec<f32> {
    let (last, fade) = (samples.len().saturating_sub(1), FADE_S * f64::from(RATE_HZ));
    let envelope = |i: usize| (i.min(last - i) as f64 / fade).min(1.0);
    let levelled = samples.iter().enumerate();
    levelled.map(|(i, x)| (x / full_scale * envelope(i)) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sound(hz: u64, samples: &[f64]) -> Option<Sound> {
        let mut clip = Clip::of(Stream {
            name: "out.delivered".into(),
            kind: Kind::SCALAR,
            quantity: Quantity::CURRENT,
            rate: Rate::from_hz(hz).unwrap(),
            simulated: true,
        });
        for block in samples.chunks(777) {
            clip.extend(block);
        }
        Sound::of([&clip])
    }

    fn tone(hz: f64, rate_hz: f64, seconds: f64) -> Vec<f64> {
        let count = (seconds * rate_hz) as usize;
        let angle = |i: usize| std::f64::consts::TAU * hz * i as f64 / rate_hz;
        (0..count).map(|i| 3.0 + 0.2 * angle(i).sin()).collect()
    }

    #[test]
    fn a_tone_keeps_its_pitch_and_has_the_stated_peak() {
        let sound = sound(10_000, &tone(250.0, 1e4, 1.0)).unwrap();
        assert_eq!(sound.samples.len(), 48_000);
        let peak = sound.samples.iter().fold(0.0, |peak: f32, x| peak.max(x.abs()));
        assert!((20.0 * f64::from(peak).log10() - PEAK_DBFS).abs() < 0.01, "{peak}");
        assert!((sound.peak - 0.2).abs() < 1e-3, "{}", sound.peak);
        // From half a period to half a period, where no sample is near zero.
        let middle = &sound.samples[4896..43_296];
        let upwards = middle.windows(2).filter(|pair| pair[0] < 0.0 && pair[1] >= 0.0);
        assert_eq!(upwards.count(), 200);
    }

    #[test]
    fn a_long_signal_is_cut_and_says_so() {
        let sound = sound(4000, &tone(100.0, 4e3, 25.0)).unwrap();
        assert_eq!((sound.duration_s(), sound.of_s), (10.0, 25.0));
        let wav = sound.to_wav();
        assert_eq!(wav.len(), 44 + 2 * 480_000);
        let reader = hound::WavReader::new(&wav[..]).unwrap();
        assert_eq!((reader.spec().sample_rate, reader.duration()), (48_000, 480_000));
    }

    #[test]
    fn a_pair_keeps_its_proportion_and_is_as_long_as_the_shorter() {
        let [loud, faint] = [(250.0, 1.0), (100.0, 0.1)]
            .map(|(hz, level)| -> Vec<f64> { tone(hz, 1e4, 12.0).into_iter().map(|x| level * x).collect() });
        let wav = wav_of_pair([&loud, &faint[..20_000]], 1e4).unwrap();
        let mut reader = hound::WavReader::new(&wav[..]).unwrap();
        assert_eq!((reader.spec().channels, reader.duration()), (2, 96_000));
        let frames: Vec<f64> = reader.samples::<i16>().map(|x| f64::from(x.unwrap()) / 32767.0).collect();
        let peaks = [0, 1].map(|channel| {
            frames.iter().skip(channel).step_by(2).fold(0.0, |peak: f64, x| peak.max(x.abs()))
        });
        assert!((20.0 * peaks[0].log10() - PEAK_DBFS).abs() < 0.01, "{peaks:?}");
        assert!((peaks[0] / peaks[1] - 10.0).abs() < 0.1, "{peaks:?}");
        assert!(wav_of_pair([&[1.0; 100], &[1.0; 100]], 1e4).is_none());
        assert!(wav_of_pair([&[], &[]], 1e4).is_none() && wav_of_pair([&loud, &faint], 1e-9).is_none());
    }

    #[test]
    fn what_does_not_vibrate_has_no_sound() {
        assert!(sound(10_000, &[0.7; 5000]).is_none());
        assert!(sound(10_000, &[]).is_none());
        assert!(sound(10_000, &[f64::NAN; 50]).is_none());
    }
}
