//! A session with participants: what comes next, what each page shows, and when an answer is kept. It neither serves pages nor runs
//! graphs: whoever conducts it does what a [`Step`] asks for.

mod answers;
mod views;

use crate::check::{Checked, StudyError};
use crate::data::{Claim, Folder, Row, Status};
use crate::document::{Phase, Study};
use crate::order::{Stimulus, Trial};
use crate::progress::next;
use crate::tally::Tally;
use haptograph_engine::graph::Graph;
use haptograph_engine::registry::Registry;
use haptograph_engine::run::ARM_RISE_S;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// What a page says.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "say", rename_all = "lowercase", deny_unknown_fields)]
pub enum Said {
    /// The participant agrees to take part.
    Agree,
    /// The participant is ready for the actuators.
    Start {
        /// Number of the trial that was seen.
        trial: u32,
    },
    /// The participant wants to feel the earlier or left one or A (0), the other one or B (1), or X (2).
    Feel {
        /// 0, 1 or 2.
        place: usize,
    },
    /// The participant's answer.
    Answer(Answer),
    /// The experimenter lets a participant take part, or go on.
    Begin {
        /// Code of the participant.
        code: String,
        /// Name of the group.
        group: String,
    },
    /// The experimenter has looked at the actuators and their limits.
    Confirm,
    /// What the trial needs is laid out.
    Ready,
    /// Opens the answer before its conditions are reached.
    Open,
    /// Goes on without an answer.
    Skip,
    /// Brings the trial before back.
    Repeat,
    /// Interrupts the trial; [`Ready`](Self::Ready) goes on.
    Pause,
    /// Keeps a note.
    Note {
        /// What it says.
        text: String,
    },
    /// Ends the session; the participant can go on later.
    Leave,
    /// The participant withdraws: the data are removed.
    Withdraw,
}

impl Said {
    /// True for what the participant's page says.
    pub fn is_participants(&self) -> bool {
        matches!(self, Self::Agree | Self::Start { .. } | Self::Feel { .. } | Self::Answer(_))
    }
}

/// An answer, as far as its trial asks for one.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Answer {
    /// Number of the trial that was seen.
    pub trial: u32,
    /// The mark on the line, 0 to 1, or a number.
    pub rating: Option<f64>,
    /// The earlier or left one (0), or the other (1); or the number of a chosen answer.
    pub choice: Option<usize>,
    /// Words.
    pub text: Option<String>,
}

/// What the conductor of a session has to do now.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Nothing.
    None,
    /// Take the actuators to zero and end the run.
    Silence,
    /// The same, then run this; [`Conductor::began`] is told when it runs.
    Present(Presentation),
    /// Arm the actuators, if both pages are there.
    Arm,
}

/// A run in which something is felt.
#[derive(Debug, Clone, PartialEq)]
pub struct Presentation {
    /// Parameters of the graph.
    pub set: Vec<(String, String)>,
    /// Seed of the run.
    pub seed: u64,
    /// Folder in which the runs of the participant are kept.
    pub folder: PathBuf,
    /// Name of the run's folder, without the number of the run.
    pub name: String,
}

/// A study that is run, as its pages drive it: [`Conductor`]. As a trait object it costs a program that runs none nothing.
pub trait Conduct {
    /// Takes what a page says at a time of the session, s.
    ///
    /// # Errors
    /// Why it is not possible now; nothing has changed then.
    fn hear(&mut self, said: Said, now_s: f64) -> Stepped;

    /// The run that was asked for has begun: it is felt from a time on that does not tell how long it took to load. Real actuators are armed
    /// first, and felt when they have risen.
    fn began(&mut self, now_s: f64);

    /// Ports of the graph whose frames the current trial needs, and the lamp's.
    fn ports(&self) -> Vec<String>;

    /// Takes frames of one of these ports.
    fn take(&mut self, port: &str, of: (usize, &str), frames: &[f64], now_s: f64);

    /// Lets time pass, s: a prepared trial begins, an answer opens once its conditions are reached, and a recording ends; it is kept
    /// when its run is over. A stimulus counts as felt once it was touched. `now` is whether a run goes on, and whether it is touched.
    ///
    /// # Errors
    /// If the next trial cannot begin.
    fn tick(&mut self, now_s: f64, now: (bool, bool)) -> Stepped;

    /// True if a run belongs to the trial, or was asked for.
    fn has_run(&self) -> bool;

    /// True if the run of the trial goes on, with armed actuators where there are any.
    fn is_rendering(&self) -> bool;

    /// True if the participant's pad is heard now.
    fn is_felt_at(&self, now_s: f64) -> bool;

    /// Interrupts the trial, as by a STOP: it goes on when the experimenter is ready, with what was gained so far.
    fn interrupt(&mut self, why: &'static str, now_s: f64);

    /// Shows the experimenter what went wrong.
    fn report(&mut self, why: String);

    /// Says that something went wrong, such as a run that did not start, and interrupts the trial.
    fn fail(&mut self, why: String, now_s: f64);

    /// What the participant's page shows at a time of the session, s.
    fn participant_view(&self, now_s: f64) -> Value;

    /// What the experimenter's page shows at a time of the session, s. It names what is laid out, but neither surface nor version of
    /// what is rendered: who runs the session is as blind as can be.
    fn experimenter_view(&self, now_s: f64) -> Value;
}

/// A study that is being run.
pub struct Conductor {
    checked: Checked,
    folder: Folder,
    /// Real actuators with their limits, in words; none if all devices are simulated.
    driven: Vec<String>,
    /// True if a device is real, so that a run keeps what it senses of a real surface.
    has_sensors: bool,
    /// True once the experimenter has confirmed the limits.
    is_confirmed: bool,
    seat: Option<Seat>,
    /// The last thing that went wrong.
    trouble: Option<String>,
    /// Participants so far.
    known: Vec<Known>,
    /// True while the lamp of the participant's page is lit.
    lamp: bool,
}

/// A participant so far.
struct Known {
    code: String,
    group: String,
    /// Number of trials with an attempt.
    done: usize,
    /// True if no trial is left.
    has_finished: bool,
    has_withdrawn: bool,
}

/// A participant in a session.
#[derive(Default)]
struct Seat {
    code: String,
    group: usize,
    /// From the consent on.
    claim: Option<Claim>,
    trials: Vec<Trial>,
    /// The trial to be repeated.
    again: Option<u32>,
    state: State,
    /// Real samples that lie there, left or earlier first.
    laid: [Option<String>; 2],
    /// Why the experimenter has to see to it before the trial goes on, and since when, s.
    held: Option<(&'static str, f64)>,
    /// True if the answer to the training trial before was right.
    feedback: Option<bool>,
}

#[derive(Default)]
enum State {
    #[default]
    Consent,
    /// The trial waits for the experimenter.
    Preparing(Current),
    /// It waits for the participant, since it arms actuators.
    Prepared(Current),
    Felt(Current),
    Done,
}

/// The run in which a stimulus is felt.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
enum Run {
    /// None: what is felt is real, or a question.
    #[default]
    None,
    /// Asked for at this time, s.
    Asked(f64),
    /// It runs. Real actuators are armed at this time, s.
    Begun(f64),
    /// They are armed.
    Armed,
}

/// A trial in progress.
#[derive(Default)]
struct Current {
    trial: Trial,
    /// The stimuli by their place: the left or earlier one first, X last.
    places: Vec<Option<Stimulus>>,
    tallies: Vec<Option<Tally>>,
    /// True for places that were felt.
    felt: Vec<bool>,
    /// The place that is felt now.
    place: usize,
    /// The run in which it is felt.
    run: Run,
    /// Since when, s; in the future while the actuators rise, `None` while nothing is felt.
    since_s: Option<f64>,
    exploration_s: f64,
    /// When the answer opened, s.
    opened_s: Option<f64>,
    is_forced: bool,
}

impl Current {
    fn is_virtual(&self, place: usize) -> bool {
        self.places[place].is_some_and(|of| of.version.is_some())
    }

    /// True if virtual stimuli take turns.
    fn has_turns(&self) -> bool {
        self.places.len() > 1 && (0..self.places.len()).all(|place| self.is_virtual(place))
    }

    /// True if the place that is felt is rendered; a practice without stimuli is the graph as it is.
    fn renders(&self, study: &Study) -> bool {
        let phase = &study.phases.0[self.trial.phase].1;
        !matches!(phase, Phase::Questions(_) | Phase::Break(_))
            && self.places[self.place].is_none_or(|of| of.version.is_some())
    }

    fn is_reached(&self) -> bool {
        (0..self.places.len()).all(|place| {
            let is_open = self.tallies[place].as_ref().is_none_or(Tally::is_open);
            !self.is_virtual(place) || (is_open && self.felt[place])
        })
    }
}

/// Shortest time from the wish to feel a stimulus until it begins, s, whatever is loaded meanwhile.
pub const PAUSE_S: f64 = 0.6;
/// Time after an interruption in which nobody goes on, s.
const GUARD_S: f64 = 1.0;
/// Why a trial waits for a real sample.
const LAY_OUT: &str = "lay out";
/// Longest note and answer in words, bytes.
const LONGEST: usize = 10_000;

/// Number of trials with an attempt.
fn attempted(rows: &[Row]) -> usize {
    rows.iter().map(|row| row.trial).collect::<BTreeSet<u32>>().len()
}

type Stepped = Result<Step, String>;

impl Conductor {
    /// A session in a folder; the graph tells which real actuators it drives.
    ///
    /// # Errors
    /// If the folder holds other data.
    pub fn open(checked: Checked, folder: Folder, graph: &Graph) -> Result<Self, StudyError> {
        let driven = graph.actuators().filter(|(_, device, _)| !device.entry.spec.simulated);
        let driven = driven.map(|(node, device, limit)| {
            let unit = node.outputs.first().map_or_else(String::new, |output| output.quantity.unit());
            let (peak, rms) = (limit.peak, limit.continuous);
            format!(
                "{} on {}: at most {peak} {unit}, in the long run {rms} {unit} RMS",
                node.path, device.name
            )
        });
        let driven = driven.collect();
        let has_sensors = graph.devices().iter().any(|device| !device.entry.spec.simulated);
        let mut opened = Self {
            checked,
            folder,
            driven,
            has_sensors,
            is_confirmed: false,
            seat: None,
            trouble: None,
            known: Vec::new(),
            lamp: false,
        };
        opened.look_at_people()?;
        Ok(opened)
    }

    /// The parameters with which the graph is opened: those of the first virtual surface.
    ///
    /// # Errors
    /// With the graph's findings.
    pub fn first(
        checked: &Checked,
        registry: &Registry,
    ) -> Result<(Graph, Vec<(String, String)>), StudyError> {
        let study = &checked.study;
        let surface = study.surfaces.0.iter().position(|(_, of)| of.file.is_some());
        let first = surface.map(|surface| Stimulus { surface, version: Some(0) });
        let phase = &study.phases.0[0].1;
        let set = checked.parameters(phase, (first, None));
        Ok((checked.graph(registry, phase, (first, None), study.seed)?, set))
    }

    fn look_at_people(&mut self) -> Result<(), StudyError> {
        let rows = self.folder.rows()?;
        let study = &self.checked.study;
        let known = self.folder.participants()?.into_iter().map(|known| {
            let own = rows.iter().filter(|row| row.participant == known.participant).cloned();
            let own: Vec<Row> = own.collect();
            let group = (0..study.group_count()).find(|group| study.group_name(*group) == known.group);
            let trials = study.trials(&known.participant, group.unwrap_or(0));
            let has_finished = next(study, &trials, &own).is_none();
            let has_withdrawn = !known.withdrawn_utc.is_empty();
            Known {
                code: known.participant,
                group: known.group,
                done: attempted(&own),
                has_finished,
                has_withdrawn,
            }
        });
        self.known = known.collect();
        Ok(())
    }

    fn begin(&mut self, code: &str, group: &str) -> Stepped {
        if self.seat.is_some() {
            return Err("a participant is there; end that session first".to_owned());
        }
        self.is_confirmed = false;
        self.checked.check_code(code).map_err(|error| error.to_string())?;
        let study = &self.checked.study;
        let group = (0..study.group_count())
            .find(|known| study.group_name(*known) == group)
            .ok_or_else(|| format!("the study has no group `{group}`"))?;
        let known = self.known.iter().find(|known| known.code == code);
        let trials = study.trials(code, group);
        let mut seat = Seat { code: code.to_owned(), group, trials, ..Seat::default() };
        // Who came before has agreed.
        if known.is_some() {
            seat.claim = Some(self.claim(&seat)?);
        }
        let is_back = seat.claim.is_some();
        self.seat = Some(seat);
        if is_back { self.advance(Some("the session begins")) } else { Ok(Step::None) }
    }

    fn claim(&self, seat: &Seat) -> Result<Claim, String> {
        let group = self.checked.study.group_name(seat.group);
        self.folder.claim(&seat.code, group, false).map_err(|error| error.to_string())
    }

    fn seat(&mut self) -> Result<&mut Seat, String> {
        self.seat.as_mut().ok_or_else(|| "no participant is there".to_owned())
    }

    fn agree(&mut self) -> Stepped {
        let seat = self.seat.as_ref().filter(|seat| matches!(seat.state, State::Consent));
        let Some(seat) = seat else { return Ok(Step::None) };
        let claim = self.claim(seat)?;
        self.seat()?.claim = Some(claim);
        self.look_at_people().map_err(|error| error.to_string())?;
        self.advance(Some("the session begins"))
    }

    /// Goes on to the next trial, for which the experimenter is needed if there is a reason.
    fn advance(&mut self, held: Option<&'static str>) -> Stepped {
        let study = &self.checked.study;
        let Some(seat) = &mut self.seat else { return Ok(Step::None) };
        let Some(claim) = &seat.claim else { return Ok(Step::None) };
        let again = seat.again.take();
        let again = again.and_then(|number| seat.trials.iter().find(|trial| trial.number == number)).cloned();
        let again = again.map(|trial| {
            let before = claim.rows().iter().rev().find(|row| row.trial == trial.number);
            Trial { level: before.map_or(trial.level, |row| row.level), ..trial }
        });
        let Some(trial) = again.or_else(|| next(study, &seat.trials, claim.rows())) else {
            seat.state = State::Done;
            return Ok(Step::Silence);
        };
        let phase = &study.phases.0[trial.phase].1;
        let places = study.places(&trial);
        let rendered = places.iter().position(|of| of.is_some_and(|of| of.version.is_some()));
        let laid = std::array::from_fn(|place| {
            let of = places.get(place).copied().flatten().filter(|of| of.version.is_none())?;
            study.surfaces.0[of.surface].1.sample.clone()
        });
        let current = Current {
            trial,
            tallies: places.iter().map(|of| of.is_some().then(|| Tally::new(study, phase))).collect(),
            felt: vec![false; places.len()],
            place: rendered.unwrap_or(places.len() - 1),
            places,
            ..Current::default()
        };
        // What lies there from the trial before is taken away, too.
        let is_to_lay = laid != seat.laid;
        seat.laid = laid;
        seat.held = held.or(is_to_lay.then_some(LAY_OUT)).map(|why| (why, f64::NEG_INFINITY));
        seat.state = State::Preparing(current);
        if seat.held.is_some() || (self.needs_confirmation()) { Ok(Step::Silence) } else { self.prepared() }
    }

    fn needs_confirmation(&self) -> bool {
        !self.driven.is_empty() && !self.is_confirmed
    }

    /// The experimenter is ready: the trial begins, with real actuators when the participant starts it.
    fn ready(&mut self, now_s: f64) -> Stepped {
        // A press that was meant for another button does not undo a STOP.
        if self.seat.as_ref().and_then(|seat| seat.held).is_some_and(|(_, since_s)| now_s < since_s + GUARD_S)
        {
            return Ok(Step::None);
        }
        if self.needs_confirmation() {
            return Err("confirm the limits of the actuators first".to_owned());
        }
        let seat = self.seat()?;
        if !matches!(seat.state, State::Preparing(_)) {
            return Ok(Step::None);
        }
        seat.held = None;
        self.prepared()
    }

    /// What is prepared waits for the participant if it arms actuators or goes on by itself.
    fn prepared(&mut self) -> Stepped {
        let Some(seat) = &mut self.seat else { return Ok(Step::None) };
        if let State::Preparing(current) = std::mem::replace(&mut seat.state, State::Done) {
            seat.state = State::Prepared(current);
        }
        Ok(Step::Silence)
    }

    /// True if a prepared trial waits for the participant's hand.
    fn awaits_start(&self, current: &Current) -> bool {
        !self.driven.is_empty() && current.renders(&self.checked.study)
    }

    fn start(&mut self, trial: u32, now_s: f64) -> Stepped {
        let is_prepared = matches!(
            &self.seat,
            Some(Seat { state: State::Prepared(current), .. }) if current.trial.number == trial
        );
        if is_prepared { self.present(None, now_s) } else { Ok(Step::None) }
    }

    /// Lets the other one of two be felt.
    fn feel(&mut self, place: usize, now_s: f64) -> Stepped {
        let seat = self.seat()?;
        match &seat.state {
            State::Felt(current)
                if current.has_turns() && place < current.places.len() && current.has_begun(now_s) =>
            {
                if current.place == place {
                    Ok(Step::None)
                } else {
                    self.present(Some(place), now_s)
                }
            }
            _ => Ok(Step::None),
        }
    }

    /// Presents a place of the current trial.
    fn present(&mut self, place: Option<usize>, now_s: f64) -> Stepped {
        let Some(seat) = &mut self.seat else { return Ok(Step::None) };
        let (State::Prepared(mut current) | State::Felt(mut current)) =
            std::mem::replace(&mut seat.state, State::Done)
        else {
            return Ok(Step::None);
        };
        current.pass(now_s);
        current.place = place.unwrap_or(current.place);
        let study = &self.checked.study;
        self.lamp = false;
        let phase = &study.phases.0[current.trial.phase].1;
        if matches!(phase, Phase::Questions(_) | Phase::Break(_)) {
            current.since_s = Some(now_s);
            current.opened_s = matches!(phase, Phase::Questions(_)).then_some(now_s);
            seat.state = State::Felt(current);
            return Ok(Step::Silence);
        }
        let stimulus = current.places[current.place];
        let is_second = (current.place == 1) != current.trial.is_swapped;
        let level = match (phase.facts().varied, is_second) {
            (Some(varied), false) => Some(varied.standard),
            _ => current.trial.level,
        };
        let code = seat.code.clone();
        let attempts = seat.claim.iter().flat_map(Claim::rows);
        let attempt = attempts.filter(|row| row.trial == current.trial.number).count() + 1;
        let presentation = Presentation {
            set: self.checked.parameters(phase, (stimulus, level)),
            // Each of a trial's stimuli has noise of its own: the X of ABX is not the same waveform as its twin.
            seed: self.checked.seed_of(&code, &current.trial).wrapping_add(current.place as u64),
            folder: self.folder.path().join("signals").join(&code),
            name: format!("{:03}-{attempt}", current.trial.number),
        };
        if let Some(tally) = &mut current.tallies[current.place] {
            tally.begin_run();
        }
        let runs = current.renders(study) || self.has_sensors || matches!(phase, Phase::Record(_));
        current.run = if runs { Run::Asked(now_s) } else { Run::None };
        current.since_s = (!runs).then_some(now_s + PAUSE_S);
        seat.state = State::Felt(current);
        Ok(if runs { Step::Present(presentation) } else { Step::Silence })
    }

    /// The trial that is felt.
    fn felt(&self) -> Option<&Current> {
        let state = &self.seat.as_ref()?.state;
        if let State::Felt(current) = state { Some(current) } else { None }
    }

    fn felt_mut(&mut self) -> Option<&mut Current> {
        let state = &mut self.seat.as_mut()?.state;
        if let State::Felt(current) = state { Some(current) } else { None }
    }

    fn leave(&mut self) -> Stepped {
        self.seat = None;
        if let Err(error) = self.look_at_people() {
            self.trouble = Some(error.to_string());
        }
        Ok(Step::Silence)
    }

    fn withdraw(&mut self, now_s: f64) -> Stepped {
        self.interrupt("withdrawal", now_s);
        let seat = self.seat()?;
        let code = seat.code.clone();
        if seat.claim.take().is_some()
            && let Err(error) = self.folder.remove(&code)
        {
            let claim = self.seat.as_ref().map(|seat| self.claim(seat));
            self.seat()?.claim = claim.and_then(Result::ok);
            return Err(error.to_string());
        }
        self.seat = None;
        self.look_at_people().map_err(|error| error.to_string())?;
        Ok(Step::Silence)
    }

    fn note(&mut self, text: &str) -> Result<(), String> {
        if text.len() > LONGEST {
            return Err(format!("a note has {LONGEST} bytes at most"));
        }
        let seat = self.seat.as_ref().ok_or("no participant is there")?;
        let claim = seat.claim.as_ref().ok_or("nothing is kept before the participant agrees")?;
        let trial = match &seat.state {
            State::Preparing(current) | State::Prepared(current) | State::Felt(current) => {
                current.trial.number
            }
            State::Consent | State::Done => 0,
        };
        claim.note(trial, text).map_err(|error| error.to_string())
    }
}

impl Conduct for Conductor {
    fn hear(&mut self, said: Said, now_s: f64) -> Stepped {
        let heard = match said {
            Said::Begin { code, group } => self.begin(&code, &group),
            Said::Agree => self.agree(),
            Said::Confirm => {
                self.is_confirmed = true;
                Ok(Step::None)
            }
            Said::Ready => self.ready(now_s),
            Said::Start { trial } => self.start(trial, now_s),
            Said::Feel { place } => self.feel(place, now_s),
            Said::Answer(answer) => self.answer(&answer, now_s),
            Said::Open => self.open_answer(now_s),
            Said::Skip => self.skip(now_s),
            Said::Repeat => self.repeat(),
            Said::Pause => {
                self.interrupt("paused", now_s);
                Ok(Step::Silence)
            }
            Said::Note { text } => self.note(&text).map(|()| Step::None),
            Said::Leave => self.leave(),
            Said::Withdraw => self.withdraw(now_s),
        };
        if heard.is_ok() {
            self.trouble = None;
        }
        heard
    }

    fn began(&mut self, now_s: f64) {
        let study = &self.checked.study;
        if let Some(Seat { state: State::Felt(current), .. }) = &mut self.seat
            && let Run::Asked(asked_s) = current.run
        {
            let from_s = now_s.max(asked_s + PAUSE_S);
            let arms = !self.driven.is_empty() && current.renders(study);
            current.run = if arms { Run::Begun(from_s) } else { Run::Armed };
            current.since_s = Some(if arms { from_s + ARM_RISE_S } else { from_s });
        }
    }

    fn ports(&self) -> Vec<String> {
        let page = self.checked.study.page.as_ref();
        let lamp = page.and_then(|page| page.lamp.as_ref()).map(|name| name.text.clone());
        let tally = self.felt().and_then(|current| current.tallies[current.place].as_ref());
        tally.into_iter().flat_map(Tally::ports).map(str::to_owned).chain(lamp).collect()
    }

    fn take(&mut self, port: &str, of: (usize, &str), frames: &[f64], now_s: f64) {
        let lamp = self.checked.study.page.as_ref().and_then(|page| page.lamp.as_ref());
        if let Some(last) = frames.last().filter(|_| lamp.is_some_and(|lamp| lamp.text == port)) {
            self.lamp = *last != 0.0;
        }
        if let Some(current) = self.felt_mut().filter(|current| current.has_begun(now_s))
            && let Some(tally) = &mut current.tallies[current.place]
        {
            tally.take(port, of, frames);
        }
    }

    fn tick(&mut self, now_s: f64, (is_running, is_touched): (bool, bool)) -> Stepped {
        let begins = match self.seat.as_ref().map(|seat| &seat.state) {
            Some(State::Prepared(current)) => !self.awaits_start(current),
            _ => false,
        };
        if begins {
            return self.present(None, now_s);
        }
        let rises = |current: &&mut Current| matches!(current.run, Run::Begun(from_s) if now_s >= from_s);
        if let Some(current) = self.felt_mut().filter(rises) {
            current.run = Run::Armed;
            return Ok(Step::Arm);
        }
        if let Some(Seat { state: State::Felt(current), .. }) = &mut self.seat
            && current.has_begun(now_s)
        {
            current.felt[current.place] |= is_touched;
            let phase = &self.checked.study.phases.0[current.trial.phase].1;
            let is_record = matches!(phase, Phase::Record(_));
            let is_reached = current.is_forced
                || phase
                    .facts()
                    .length_s
                    .map_or_else(|| current.is_reached(), |s| current.explored_s(now_s) >= s);
            if current.opened_s.is_none() && is_reached {
                current.opened_s = Some(now_s);
                return Ok(if is_record { Step::Silence } else { Step::None });
            }
            if is_record && current.opened_s.is_some() && !is_running {
                return self.keep_recording();
            }
        }
        Ok(Step::None)
    }

    fn has_run(&self) -> bool {
        self.felt().is_some_and(|current| current.run != Run::None)
    }

    fn is_rendering(&self) -> bool {
        let is_armed = |current: &Current| current.run == Run::Armed && current.renders(&self.checked.study);
        self.felt().is_some_and(is_armed)
    }

    fn is_felt_at(&self, now_s: f64) -> bool {
        self.felt().is_some_and(|current| current.has_begun(now_s))
    }

    fn interrupt(&mut self, why: &'static str, now_s: f64) {
        let Some(seat) = &mut self.seat else { return };
        seat.state = match std::mem::replace(&mut seat.state, State::Done) {
            State::Preparing(mut current) | State::Prepared(mut current) | State::Felt(mut current) => {
                current.pass(now_s);
                // The answer opens again at once, if it was open.
                (current.run, current.opened_s) = (Run::None, None);
                if matches!(self.checked.study.phases.0[current.trial.phase].1, Phase::Record(_)) {
                    current.exploration_s = 0.0;
                }
                State::Preparing(current)
            }
            other => other,
        };
        if matches!(seat.state, State::Preparing(_)) && seat.held.is_none_or(|(before, _)| before != why) {
            seat.held = Some((why, now_s));
            // It is in the notes, not in the trial: a STOP is no failure.
            let _ = self.note(why);
        }
    }

    fn report(&mut self, why: String) {
        self.trouble = Some(why);
    }

    fn fail(&mut self, why: String, now_s: f64) {
        self.interrupt("the run failed", now_s);
        self.trouble = Some(why);
    }

    fn participant_view(&self, now_s: f64) -> Value {
        self.participants(now_s)
    }

    fn experimenter_view(&self, now_s: f64) -> Value {
        self.experimenters(now_s)
    }
}

impl Current {
    fn has_begun(&self, now_s: f64) -> bool {
        self.since_s.is_some_and(|since_s| now_s >= since_s)
    }

    /// Time for which it was felt until the answer opened, s.
    fn explored_s(&self, now_s: f64) -> f64 {
        let until_s = self.opened_s.unwrap_or(now_s);
        self.exploration_s + self.since_s.map_or(0.0, |since_s| (until_s - since_s).max(0.0))
    }

    /// Nothing is felt from now on, s.
    fn pass(&mut self, now_s: f64) {
        self.exploration_s = self.explored_s(now_s);
        self.since_s = None;
    }
}
