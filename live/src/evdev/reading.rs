//! Converts Linux's events to positions and forces, on a separate thread.

use super::devices::Input;
use evdev::{AbsInfo, AbsoluteAxisCode, EventSummary, KeyCode, RelativeAxisCode};
use haptograph_nodes::network::link::SENSED;
use haptograph_signal::units::PerMillimetre;
use std::io::{Error, ErrorKind, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::Receiver;
use std::thread::JoinHandle;
use std::time::Duration;

/// Range of an axis in counts, and its counts per millimetre.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Axis {
    min: f64,
    max: f64,
    counts_per_mm: Option<PerMillimetre>,
}

/// Capabilities that a device reports.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Capabilities {
    /// Absolute x and y; none for a mouse.
    place: Option<[Axis; 2]>,
    pressure: Option<Axis>,
}

/// An event.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    /// Absolute position of axis 0 or 1, counts.
    Place(usize, f64),
    /// Relative movement of an axis, counts.
    Move(usize, f64),
    Pressure(f64),
    Down(bool),
}

/// Converts events to positions and forces.
#[derive(Debug, Clone, PartialEq)]
struct Tip {
    /// Counts per metre along x and y, and the counts at the origin.
    counts_per_m: [f64; 2],
    origin: [f64; 2],
    pressure: Option<Axis>,
    pressed_n: f64,
    sensed: [f64; SENSED],
}

impl Tip {
    /// None if the scale is unknown.
    fn new(input: &Input, has: &Capabilities) -> Option<Self> {
        let counts_per_mm = |axis: usize| {
            let reported = has.place.and_then(|place| place[axis].counts_per_mm);
            input.counts_per_mm.or(reported)
        };
        let middle = |axis: usize| has.place.map_or(0.0, |place| 0.5 * (place[axis].min + place[axis].max));
        Some(Self {
            counts_per_m: [counts_per_mm(0)?.si(), counts_per_mm(1)?.si()],
            origin: [middle(0), middle(1)],
            pressure: has.pressure.filter(|axis| axis.max > axis.min),
            pressed_n: input.pressed_n,
            sensed: [0.0; SENSED],
        })
    }

    fn take(&mut self, event: Event) {
        // The y axes of tablets and mice point towards the user.
        let metres = |axis: usize, counts: f64| [1.0, -1.0][axis] * counts / self.counts_per_m[axis];
        match event {
            Event::Place(axis, counts) => self.sensed[axis] = metres(axis, counts - self.origin[axis]),
            Event::Move(axis, counts) => self.sensed[axis] += metres(axis, counts),
            Event::Pressure(counts) => {
                if let Some(Axis { min, max, .. }) = self.pressure {
                    self.sensed[8] = self.pressed_n * ((counts - min) / (max - min)).clamp(0.0, 1.0);
                }
            }
            Event::Down(down) if self.pressure.is_none() => {
                self.sensed[8] = if down { self.pressed_n } else { 0.0 }
            }
            // The force of a lifted pen is zero, whatever its last pressure was.
            Event::Down(false) => self.sensed[8] = 0.0,
            Event::Down(true) => {}
        }
    }
}

/// Time between polls of a device.
const PAUSE: Duration = Duration::from_millis(1);
/// Time between attempts to reopen a device.
const RETRY: Duration = Duration::from_millis(500);
/// Polls between two reports that the device is present.
const PRESENCE_POLLS: u32 = 5;

struct Open {
    device: evdev::Device,
    tip: Tip,
}

impl Open {
    fn new(input: &Input) -> Result<Self> {
        let device = evdev::Device::open(&input.path)?;
        device.set_nonblocking(true)?;
        let tip = tip(&device, input)?;
        Ok(Self { device, tip })
    }

    /// Changes the settings; the tip keeps its position.
    fn with(self, input: &Input) -> Result<Self> {
        let tip = tip(&self.device, input)?;
        let tip = Tip { sensed: self.tip.sensed, ..tip };
        Ok(Self { tip, ..self })
    }

    /// Processes new events. Returns whether there were any.
    fn take(&mut self) -> Result<bool> {
        let mut has_events = false;
        match self.device.fetch_events() {
            Ok(events) => {
                for event in events.filter_map(|event| parse(event.destructure())) {
                    self.tip.take(event);
                    has_events = true;
                }
                Ok(has_events)
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(false),
            Err(error) => Err(error),
        }
    }
}

fn tip(device: &evdev::Device, input: &Input) -> Result<Tip> {
    Tip::new(input, &capabilities(device)?).ok_or_else(unknown_scale)
}

/// The error of a device of unknown scale.
pub(super) fn unknown_scale() -> Error {
    Error::new(ErrorKind::InvalidInput, "it does not report its counts per millimetre; give `counts_per_mm`")
}

fn capabilities(device: &evdev::Device) -> Result<Capabilities> {
    let (mut place, mut pressure) = ([None; 2], None);
    if device.supported_absolute_axes().is_some() {
        for (code, info) in device.get_absinfo()? {
            match code {
                AbsoluteAxisCode::ABS_X => place[0] = Some(axis(&info)),
                AbsoluteAxisCode::ABS_Y => place[1] = Some(axis(&info)),
                AbsoluteAxisCode::ABS_PRESSURE => pressure = Some(axis(&info)),
                _ => {}
            }
        }
    }
    let place = match place {
        [Some(x), Some(y)] => Some([x, y]),
        _ => None,
    };
    Ok(Capabilities { place, pressure })
}

fn axis(info: &AbsInfo) -> Axis {
    Axis {
        min: f64::from(info.minimum()),
        max: f64::from(info.maximum()),
        counts_per_mm: (info.resolution() > 0).then(|| PerMillimetre(f64::from(info.resolution()))),
    }
}

fn parse(event: EventSummary) -> Option<Event> {
    Some(match event {
        EventSummary::AbsoluteAxis(_, AbsoluteAxisCode::ABS_X, value) => Event::Place(0, f64::from(value)),
        EventSummary::AbsoluteAxis(_, AbsoluteAxisCode::ABS_Y, value) => Event::Place(1, f64::from(value)),
        EventSummary::AbsoluteAxis(_, AbsoluteAxisCode::ABS_PRESSURE, value) => {
            Event::Pressure(f64::from(value))
        }
        EventSummary::RelativeAxis(_, RelativeAxisCode::REL_X, value) => Event::Move(0, f64::from(value)),
        EventSummary::RelativeAxis(_, RelativeAxisCode::REL_Y, value) => Event::Move(1, f64::from(value)),
        EventSummary::Key(_, KeyCode::BTN_TOUCH | KeyCode::BTN_LEFT, value) => Event::Down(value != 0),
        _ => return None,
    })
}

/// Reads a device until `stop`, on a separate thread, and reopens one that was unplugged. Also returns whether it reports
/// its scale.
pub(super) fn begin(
    device: &str,
    input: &Input,
    edits: Receiver<Input>,
    stop: &Arc<AtomicBool>,
) -> Result<(JoinHandle<()>, bool)> {
    let first = Open::new(input)?;
    let place = capabilities(&first.device)?.place;
    let states_scale = place.is_some_and(|place| place.iter().all(|axis| axis.counts_per_mm.is_some()));
    let mut open = Some(first);
    let (mut input, stop) = (input.clone(), Arc::clone(stop));
    let thread = std::thread::Builder::new().name(format!("input {device}")).spawn(move || {
        let mut quiet = 0;
        while !stop.load(Relaxed) {
            if let Some(edited) = edits.try_iter().last() {
                input = edited;
                open = open.and_then(|this| this.with(&input).ok());
            }
            let Some(this) = &mut open else {
                std::thread::sleep(RETRY);
                open = Open::new(&input).ok();
                continue;
            };
            match this.take() {
                Ok(has_events) => {
                    quiet = if has_events { 0 } else { quiet + 1 };
                    if quiet % PRESENCE_POLLS == 0 {
                        input.link.publish(&this.tip.sensed);
                    }
                    std::thread::sleep(PAUSE);
                }
                Err(_) => open = None,
            }
        }
    })?;
    Ok((thread, states_scale))
}

#[cfg(test)]
mod tests {
    use super::*;
    use evdev::{EventType, InputEvent};
    use std::path::PathBuf;

    #[test]
    fn linux_events_are_parsed() {
        let parsed = |kind: EventType, code: u16, value: i32| {
            parse(InputEvent::new(kind.0, code, value).destructure())
        };
        assert_eq!(parsed(EventType::ABSOLUTE, 1, 40), Some(Event::Place(1, 40.0)));
        assert_eq!(parsed(EventType::ABSOLUTE, 0x18, 7), Some(Event::Pressure(7.0)));
        assert_eq!(parsed(EventType::RELATIVE, 0, -3), Some(Event::Move(0, -3.0)));
        assert_eq!(parsed(EventType::KEY, 0x14a, 1), Some(Event::Down(true)));
        assert_eq!(parsed(EventType::KEY, 0x110, 0), Some(Event::Down(false)));
        assert_eq!(parsed(EventType::RELATIVE, 8, 1), None, "a wheel is no movement");
    }

    #[test]
    fn a_file_that_is_not_an_event_device_is_an_error() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let input =
            Input { link: Arc::default(), path: path.path().to_owned(), counts_per_mm: None, pressed_n: 1.0 };
        assert!(begin("stylus", &input, std::sync::mpsc::channel().1, &Arc::default()).is_err());
    }

    fn input(counts_per_mm: Option<f64>) -> Input {
        let counts_per_mm = counts_per_mm.map(PerMillimetre);
        Input { link: Arc::default(), path: PathBuf::from("none"), counts_per_mm, pressed_n: 3.0 }
    }

    const fn axis(max: f64, counts_per_mm: Option<PerMillimetre>) -> Axis {
        Axis { min: 0.0, max, counts_per_mm }
    }

    const SCALE: Option<PerMillimetre> = Some(PerMillimetre(100.0));

    #[test]
    fn a_tablet_is_placed_from_its_middle_in_metres_and_presses_in_newtons() {
        let has = Capabilities {
            place: Some([axis(20_000.0, SCALE), axis(10_000.0, SCALE)]),
            pressure: Some(axis(1023.0, None)),
        };
        let mut tip = Tip::new(&input(None), &has).unwrap();
        for event in
            [Event::Place(0, 11_000.0), Event::Place(1, 4000.0), Event::Pressure(1023.0), Event::Down(true)]
        {
            tip.take(event);
        }
        // 10 mm right of the middle, 10 mm away from the user.
        assert_eq!((tip.sensed[0], tip.sensed[1], tip.sensed[8]), (0.01, 0.01, 3.0));
        tip.take(Event::Down(false));
        assert_eq!((tip.sensed[0], tip.sensed[8]), (0.01, 0.0));
    }

    #[test]
    fn a_mouse_moves_from_where_it_is_and_presses_by_its_button() {
        let has = Capabilities::default();
        assert_eq!(Tip::new(&input(None), &has), None, "its scale is unknown");
        let mut tip = Tip::new(&input(Some(40.0)), &has).unwrap();
        for event in [Event::Move(0, 400.0), Event::Move(0, -200.0), Event::Move(1, 40.0), Event::Down(true)]
        {
            tip.take(event);
        }
        assert_eq!((tip.sensed[0], tip.sensed[1], tip.sensed[8]), (0.005, -0.001, 3.0));
        tip.take(Event::Down(false));
        assert_eq!(tip.sensed[8], 0.0);
    }
}
