//! A source that plays a WAV file by position on a surface instead of by time.

use super::wav::read_at_any_rate;
use crate::vector::{direction, dot};
use crate::wav::Layout;
use haptograph_engine::frame::{Linear, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, LiveId, NodeKind, Optional, Port, Processor, Tick,
};
use haptograph_signal::files::MAX_RECORDING_BYTES;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Millimetres, MillimetresPerSecond};
use std::path::PathBuf;
use std::sync::Arc;

haptograph_engine::choices! {
    /// Output beyond the ends of the recording.
    pub(crate) enum Beyond {
        /// The recording repeats; a straight line joins its end to its start.
        Repeat,
        /// Zero.
        Silence,
    }
}

haptograph_engine::settings! {
    /// Settings of [`WavOverPosition`].
    pub struct WavOverPositionSettings {
        /// The WAV file, relative to the graph file. It may have any rate and at most 16 777 216 frames.
        file: PathBuf;
        /// Channel of the file, counted from 0.
        channel: u32 = 0;
        /// Value of a full-scale sample (1.0), in the SI unit of `quantity`.
        [live] full_scale: f64 = 1.0;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
        /// Length of the recording on the surface. Give this or `recorded_mm_s`.
        length_mm: Option<Millimetres> = None, in 1e-3..=1e6;
        /// Speed of the tool at which playback has the original rate. Give this or `length_mm`.
        recorded_mm_s: Option<MillimetresPerSecond> = None, in 1e-3..=1e6;
        /// Position of the first sample on the surface.
        start_mm: Millimetres = Millimetres(0.0), in -1e6..=1e6;
        /// Direction of the recording on the surface, a vector of any length. It applies if the position is a vector.
        axis: [f64; 3] = [1.0, 0.0, 0.0];
        /// Output before the start and after the end of the recording.
        beyond: Beyond = Beyond::Repeat;
        /// Speed of full amplitude if `speed` is connected; the amplitude is zero at rest and rises up to this speed.
        [live] full_at_mm_s: MillimetresPerSecond = MillimetresPerSecond(10.0), in 1e-3..=1e6;
    }
}

/// Largest number of frames of a recording.
const MAX_FRAMES: u64 = 1 << 24;

haptograph_engine::node! {
    /// Plays one channel of a WAV file by position on a surface instead of by time: at twice the speed it sounds an octave
    /// higher, and moving backwards plays backwards. A frame is the mean of the linearly interpolated recording over the
    /// distance since the last frame. This attenuates aliases: by 3.9 dB at half the rate, and by 13 dB or more for
    /// components that would alias to 0 Hz. At rest the output holds its value; connect `speed` for silence. A position of
    /// a slower clock needs a `Linear` bridge: between held positions nothing moves.
    /// Elsewhere: BufRd, tabread4~, rdtable.
    pub struct WavOverPosition(WavOverPositionSettings) in "sources";
    source: "vibration by position: Strohmeier and Hornbaek, CHI 2017";
    example: r#""grain": WavOverPosition(position: "stylus.position", file: "recordings/felt.wav", length_mm: 60, full_scale: 20, quantity: "acceleration")"#;
    in POSITION: Linear =
        Port::of(Quantity::LENGTH, "Position of the tool, m: a distance, or a 3-vector whose component \
                                    along `axis` is used. NaN or infinite: the output is zero.");
    in SPEED: Scalar, Optional =
        Port::of(Quantity::SPEED, "Speed of the tool, m/s. The amplitude rises with it up to \
                                   `full_at_mm_s`.");
    out OUTPUT: Scalar = Port::of_setting("quantity", "The recording at that position.");
}

impl NodeKind for WavOverPosition {
    fn build(settings: WavOverPositionSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let width = cx.width(Self::POSITION);
        if !matches!(width, 1 | 3) {
            return Err(BuildError::at("position", "a position has one or three components")
                .help("connect the component of the signal that is a length"));
        }
        let axis = direction(settings.axis).ok_or_else(|| {
            BuildError::at("axis", "the length of the axis is zero").help("give a vector other than zero")
        })?;
        let (samples, rate_hz) =
            read_at_any_rate(&settings.file, settings.channel, MAX_RECORDING_BYTES, refuse_long)?;
        let per_m = match (settings.length_mm, settings.recorded_mm_s) {
            (Some(length_mm), None) => samples.len() as f64 / length_mm.si(),
            (None, Some(recorded_mm_s)) => rate_hz / recorded_mm_s.si(),
            (Some(_), Some(_)) => {
                return Err(
                    BuildError::at("recorded_mm_s", "`length_mm` is given too").help("remove one of them")
                );
            }
            (None, None) => {
                let message = "the length of the recording on the surface is missing";
                return Err(BuildError::of_node(message).help("add `length_mm: ...` or `recorded_mm_s: ...`"));
            }
        };
        Ok(Built::new(Scanning {
            recording: Arc::new(Recording::new(samples, settings.beyond == Beyond::Repeat)),
            per_m,
            start_m: settings.start_mm.si(),
            axis: (width == 3).then_some(axis),
            full_scale: settings.full_scale,
            full_at_m_s: settings.full_at_mm_s.si(),
            before: None,
        }))
    }
}

fn refuse_long(layout: &Layout) -> Result<(), BuildError> {
    let frames = layout.frames();
    if (2..=MAX_FRAMES).contains(&frames) {
        return Ok(());
    }
    let message = format!("the file has {frames} frames; 2 to {MAX_FRAMES} are supported");
    Err(BuildError::at("file", message).help("shorten the recording"))
}

/// Linearly interpolated samples; positions are in samples.
#[derive(Debug)]
struct Recording {
    samples: Box<[f64]>,
    /// Integral from the first sample to each sample; if the recording repeats, also to the next first sample.
    sums: Box<[f64]>,
    repeats: bool,
}

impl Recording {
    /// Takes at least two samples.
    fn new(samples: Vec<f64>, repeats: bool) -> Self {
        let again = samples.first().copied().filter(|_| repeats);
        let next = samples.iter().skip(1).copied().chain(again);
        let mut sum = 0.0;
        let cells = samples.iter().zip(next).map(|(from, to)| {
            sum += 0.5 * (from + to);
            sum
        });
        Self { sums: std::iter::once(0.0).chain(cells).collect(), samples: samples.into(), repeats }
    }

    /// Number of intervals between samples.
    fn cells(&self) -> f64 {
        (self.sums.len() - 1) as f64
    }

    /// The value at a position.
    fn at(&self, place: f64) -> f64 {
        let cells = self.cells();
        if !self.repeats && !(0.0..=cells).contains(&place) {
            return 0.0;
        }
        let place = if self.repeats { place.rem_euclid(cells) } else { place };
        let cell = place as usize;
        let part = place - cell as f64;
        // The remainder can round up to the length; the first sample follows the last.
        let sample = |cell: usize| self.samples.get(cell).or(self.samples.first()).copied().unwrap_or(0.0);
        sample(cell) + part * (sample(cell + 1) - sample(cell))
    }

    /// The integral from the first sample to a sample index, which may lie beyond the ends.
    fn integral_to(&self, sample: f64) -> f64 {
        let cells = self.cells();
        let whole = self.sums.last().copied().unwrap_or(0.0);
        let (times, at) = if self.repeats {
            ((sample / cells).floor(), sample.rem_euclid(cells))
        } else {
            (0.0, sample.clamp(0.0, cells))
        };
        times * whole + self.sums.get(at as usize).copied().unwrap_or(whole)
    }

    /// The mean between two positions.
    fn mean(&self, one: f64, other: f64) -> f64 {
        let (from, to) = (one.min(other), one.max(other));
        let (first, last) = (from.floor() + 1.0, to.floor());
        if last < first {
            // Both lie in one interval.
            return self.at(0.5 * (from + to));
        }
        let left = (first - from) * self.at(0.5 * (from + first));
        let right = (to - last) * self.at(0.5 * (last + to));
        let between = self.integral_to(last) - self.integral_to(first);
        let mean = (left + between + right) / (to - from);
        if mean.is_finite() { mean } else { 0.0 }
    }
}

#[derive(Debug, Clone)]
struct Scanning {
    recording: Arc<Recording>,
    /// Samples per metre.
    per_m: f64,
    start_m: f64,
    /// Direction along which the position counts; none if it is a scalar.
    axis: Option<[f64; 3]>,
    full_scale: f64,
    full_at_m_s: f64,
    /// Position of the last frame; none at the start and after NaN or infinity.
    before: Option<f64>,
}

impl Scanning {
    fn next(&mut self, position_m: f64, speed_m_s: Option<f64>) -> f64 {
        let place = (position_m - self.start_m) * self.per_m;
        if !place.is_finite() {
            self.before = None;
            return 0.0;
        }
        let mean = self.recording.mean(self.before.unwrap_or(place), place);
        self.before = Some(place);
        let share = match speed_m_s {
            None => 1.0,
            Some(speed_m_s) if speed_m_s.is_finite() => (speed_m_s.abs() / self.full_at_m_s).min(1.0),
            Some(_) => 0.0,
        };
        self.full_scale * share * mean
    }
}

impl Processor<WavOverPosition> for Scanning {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, WavOverPosition>) {
        let (positions, speeds) = (io.read(WavOverPosition::POSITION), io.read(WavOverPosition::SPEED));
        for (frame, y) in io.write(WavOverPosition::OUTPUT).iter_mut().enumerate() {
            let position_m = match self.axis {
                None => positions.get(frame).copied(),
                Some(axis) => positions.as_chunks().0.get(frame).map(|at| dot(*at, axis)),
            };
            *y = self.next(position_m.unwrap_or(f64::NAN), speeds.map(|speeds| speeds[frame]));
        }
    }

    fn set(&mut self, setting: LiveId<WavOverPositionSettings>, value: f64) {
        match setting {
            WavOverPositionSettings::full_scale => self.full_scale = value,
            WavOverPositionSettings::full_at_mm_s => self.full_at_m_s = value,
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.before = self.before;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wav::write_mono;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;
    use std::f64::consts::TAU;
    use std::path::Path;

    /// A file of a sine with so many samples a period.
    fn file(folder: &Path, samples: u32, period: f64) -> PathBuf {
        let path = folder.join("felt.wav");
        let sine = (0..samples).map(|k| (TAU * f64::from(k) / period).sin());
        write_mono(&path, 8000, sine);
        path
    }

    fn settings(file: PathBuf, beyond: Beyond) -> WavOverPositionSettings {
        WavOverPositionSettings {
            file,
            channel: 0,
            full_scale: 2.0,
            quantity: "acceleration".into(),
            length_mm: Some(Millimetres(100.0)),
            recorded_mm_s: None,
            start_mm: Millimetres(10.0),
            axis: [0.0, 3.0, 0.0],
            beyond,
            full_at_mm_s: MillimetresPerSecond(10.0),
        }
    }

    #[test]
    fn the_value_of_a_place_is_felt_there_whatever_the_way_to_it() {
        let folder = tempfile::tempdir().unwrap();
        // A period of 10 mm, 100 samples.
        let wanted = settings(file(folder.path(), 1000, 100.0), Beyond::Repeat);
        let mut bench = Bench::new::<WavOverPosition>(wanted, 1000.0, &[Kind::SCALAR]).unwrap();
        // 20 mm/s: 0.02 mm a tick, back and forth, over the joint at 110 mm.
        let way_m: Vec<f64> =
            (0..4000).map(|k: i32| 1e-3 * (95.0 + 0.02 * f64::from(2000 - (k - 2000).abs()))).collect();
        let y = bench.run_in_blocks(&[&way_m], &[1, 7, 64]).remove(0);
        for (k, y) in y.iter().enumerate().skip(1) {
            // Between the places of this tick and the one before.
            let place_m = 0.5 * (way_m[k] + way_m[k - 1]);
            let wanted = 2.0 * (TAU * (place_m - 0.01) / 0.01).sin();
            assert!((y - wanted).abs() < 3e-3, "{k}: {y} instead of {wanted}");
        }
    }

    #[test]
    fn what_is_too_fine_for_the_speed_is_averaged_away() {
        let folder = tempfile::tempdir().unwrap();
        // A period of 0.8 mm, 8 samples; at 100 Hz and 79 mm/s it would be heard at 1.25 Hz.
        let wanted = settings(file(folder.path(), 1000, 8.0), Beyond::Repeat);
        let mut bench = Bench::new::<WavOverPosition>(wanted, 100.0, &[Kind::SCALAR]).unwrap();
        let way_m: Vec<f64> = (0..500).map(|k| 0.79e-3 * f64::from(k)).collect();
        let y = bench.run(&[&way_m]).remove(0);
        let largest = y.iter().skip(1).fold(0.0_f64, |largest, y| largest.max(y.abs()));
        // sin(pi f) / (pi f) at f = 0.9875 of the rate is 0.0127, of an amplitude of 2.
        assert!((0.01..0.03).contains(&largest), "{largest}");
    }

    #[test]
    fn it_is_silent_at_rest_and_beyond_its_ends_where_that_is_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let wanted = settings(file(folder.path(), 1000, 100.0), Beyond::Silence);
        let kinds = [Kind::VECTOR, Kind::SCALAR];
        let mut bench = Bench::new::<WavOverPosition>(wanted, 1000.0, &kinds).unwrap();
        let mut at = |y_mm: f64, speed_m_s: f64| {
            let place = [0.5, 1e-3 * y_mm, -0.3];
            // Twice: the second frame is the value of the place.
            let positions = [place, place];
            bench.run(&[positions.as_flattened(), &[speed_m_s; 2]])[0][1]
        };
        let crest_mm = 10.0 + 2.5;
        assert!((at(crest_mm, 0.5) - 2.0).abs() < 1e-6);
        assert!((at(crest_mm, -0.005) - 1.0).abs() < 1e-6);
        for (y_mm, speed_m_s) in
            [(crest_mm, 0.0), (crest_mm, f64::NAN), (f64::NAN, 0.5), (1e300, 0.5), (9.0, 0.5), (111.0, 0.5)]
        {
            assert_eq!(at(y_mm, speed_m_s), 0.0, "{y_mm} mm at {speed_m_s} m/s");
        }
    }

    #[test]
    fn a_length_is_given_once() {
        let folder = tempfile::tempdir().unwrap();
        let good = settings(file(folder.path(), 1000, 100.0), Beyond::Repeat);
        let refused = |settings| {
            Bench::new::<WavOverPosition>(settings, 1000.0, &[Kind::SCALAR]).err().map(|error| error.field)
        };
        assert_eq!(refused(good.clone()), None);
        let both =
            WavOverPositionSettings { recorded_mm_s: Some(MillimetresPerSecond(100.0)), ..good.clone() };
        assert_eq!(refused(both), Some(Some("recorded_mm_s")));
        let none = WavOverPositionSettings { length_mm: None, ..good.clone() };
        assert_eq!(refused(none), Some(None));
        let nowhere = WavOverPositionSettings { axis: [0.0; 3], ..good };
        assert_eq!(refused(nowhere), Some(Some("axis")));
    }
}
