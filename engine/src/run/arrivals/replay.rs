//! Replays the logs of drivers.

use super::super::Run;
use super::super::async_resampler::{AsyncResamplerReader, AsyncResamplerWriter};
use super::super::fade::FADE_S;
use super::super::player::{Player, PlayerState};
use super::super::ramp::ParamRamp;
use super::super::silence::SilenceGate;
use super::inputs::scripts;
use super::rows::Lines;
use super::{
    FADING, REPLACED, RESUMED, ReplayBounds, ReplayError, SETTINGS_HEADER, cell, columns, file, gated,
    header, settings_file,
};
use crate::plan::Plan;
use crate::settings::LiveSetting;
use std::path::Path;
use std::sync::Arc;

/// Longest possible callback or ramp, s: no driver catches up after a longer stall.
const LONGEST_S: f64 = 10.0;
/// Largest rate of wake-ups without frames, Hz.
const WAKES_HZ: f64 = 2000.0;
/// Tolerance of the number of wake-ups.
const SPARE_WAKES: f64 = 1e4;

/// Reads the callbacks of a driver from its file and checks each against those before it.
struct Rows {
    lines: Lines,
    columns: usize,
    gates: usize,
    devices: usize,
    /// Largest number of frames of a callback, of frames in all, and of lines.
    most: [f64; 3],
    /// Frames and lines so far.
    frames: u64,
    count: u64,
    state: u32,
}

impl Rows {
    fn open(
        plan: &Plan,
        (folder, driver): (&Path, usize),
        bounds: &ReplayBounds,
    ) -> Result<Self, ReplayError> {
        let rate_hz = plan.driver_rate().hz();
        let in_time = bounds.longest_s * rate_hz;
        let frames = bounds.frames.filter(|_| driver == 0);
        let frames = frames.map_or(in_time, |(frames, _)| in_time.min(frames as f64));
        Ok(Self {
            lines: Lines::open(file(folder, driver), &header(plan))?,
            columns: columns(plan),
            gates: gated(plan).count(),
            devices: plan.devices.len(),
            most: [
                (LONGEST_S * rate_hz).max(1.0),
                frames,
                bounds.longest_s * WAKES_HZ.max(rate_hz) + SPARE_WAKES,
            ],
            frames: 0,
            count: 0,
            state: 0,
        })
    }

    /// Reads the next line into `row`; empty at the end of the file.
    fn next(&mut self, row: &mut Vec<u32>) -> Result<(), ReplayError> {
        row.clear();
        let Some(text) = self.lines.next()? else {
            return Ok(());
        };
        // A cell that is not a whole number is dropped, and its line refused for the missing column.
        row.extend(text.split(',').take(self.columns).flat_map(str::parse::<u32>));
        if row.len() != self.columns || text.split(',').count() != self.columns {
            return Err(self.lines.malformed(self.columns));
        }
        self.count += 1;
        let before = self.state;
        if f64::from(row[1]) != RESUMED {
            self.frames += u64::from(row[0]);
            self.state = row[1];
        }
        let why = match f64::from(row[1]) {
            _ if f64::from(before) == REPLACED => "it follows the line of a change of graph",
            state if state > RESUMED => "its second number is not 0, 1, 2 or 3",
            state if state == RESUMED => match row[0] as usize > self.devices {
                true => "the driver has no such device",
                false => return Ok(()),
            },
            state if state < f64::from(before) => "the run continues after its fade-out",
            _ if row[2..].iter().take(self.gates).any(|open| *open > 1) => {
                "the gate of an actuator is neither 0 nor 1"
            }
            _ if f64::from(row[0]) > self.most[0] => "a callback cannot run so many frames",
            _ if self.frames as f64 > self.most[1] => "the driver has run more frames than the run has",
            _ if self.count as f64 > self.most[2] => "a run of that length cannot have so many callbacks",
            _ => return Ok(()),
        };
        Err(self.lines.implausible(why))
    }
}

/// Reads the setting changes of a driver from its file.
struct Changes {
    lines: Lines,
    /// The live settings with their names in the file.
    known: Vec<(String, LiveSetting)>,
    most_frames: f64,
    begin: u64,
}

impl Changes {
    fn open(plan: &Plan, (folder, driver): (&Path, usize)) -> Result<Self, ReplayError> {
        Ok(Self {
            lines: Lines::open(settings_file(folder, driver), SETTINGS_HEADER)?,
            known: plan.live.iter().map(|live| (cell(live), live.clone())).collect(),
            most_frames: LONGEST_S * plan.driver_rate().hz(),
            begin: 0,
        })
    }

    fn next(&mut self) -> Result<Option<ParamRamp>, ReplayError> {
        let Some(text) = self.lines.next()? else {
            return Ok(None);
        };
        let Some(ramp) = self.ramp(&text) else {
            let (path, line) = self.lines.place();
            return Err(ReplayError::Setting { path, line });
        };
        let range = self.known[ramp.place].1.range.unwrap_or((f64::MIN, f64::MAX));
        let is_in_range = |value: f64| (range.0..=range.1).contains(&value);
        let why = match () {
            () if ramp.begin < self.begin => "its frame is before that of the previous line",
            () if !(is_in_range(ramp.from) && is_in_range(ramp.to)) => {
                "the value is out of the setting's range"
            }
            () if ramp.frames as f64 > self.most_frames => "a ramp cannot take so many frames",
            () => {
                self.begin = ramp.begin;
                return Ok(Some(ramp));
            }
        };
        Err(self.lines.implausible(why))
    }

    fn ramp(&self, line: &str) -> Option<ParamRamp> {
        let cells: Vec<&str> = line.splitn(5, ',').collect();
        let [begin, from, to, frames, name] = cells[..] else {
            return None;
        };
        let number = |text: &str| text.parse::<f64>().ok().filter(|number| number.is_finite());
        Some(ParamRamp {
            place: self.known.iter().position(|(known, _)| known == name)?,
            from: number(from)?,
            to: number(to)?,
            begin: begin.parse().ok()?,
            frames: frames.parse().ok()?,
        })
    }
}

/// Reads all logs of a run and refuses lines that a run of that length cannot have written. Uses constant memory; stops
/// early if `goes_on` returns false.
pub(in super::super) fn check_logs(
    plans: &[Arc<Plan>],
    folder: &Path,
    bounds: &ReplayBounds,
    goes_on: &impl Fn() -> bool,
) -> Result<(), ReplayError> {
    for (driver, plan) in plans.iter().enumerate() {
        let mut rows = Rows::open(plan, (folder, driver), bounds)?;
        let mut row = Vec::new();
        rows.next(&mut row)?;
        while !row.is_empty() && goes_on() {
            rows.next(&mut row)?;
        }
        let whole = bounds.frames.filter(|(_, is_whole)| *is_whole && driver == 0);
        if whole.is_some_and(|(frames, _)| rows.frames != frames) && goes_on() {
            return Err(rows.lines.implausible("the file ends before the run did"));
        }
        let mut changes = Changes::open(plan, (folder, driver))?;
        while let Some(change) = changes.next()?
            && goes_on()
        {
            if change.begin > rows.frames {
                return Err(changes.lines.implausible("its frame is after the end of the run"));
            }
        }
        for (_, script) in scripts(plan, (folder, driver), bounds)? {
            script.check(goes_on)?;
        }
    }
    Ok(())
}

/// Replay of a driver from its files.
pub(in super::super) struct Arrivals {
    rows: Rows,
    /// The next callback; empty at the end.
    row: Vec<u32>,
    gated: Vec<usize>,
    /// Frames arrived by the last callback, for each ring that is read.
    arrived: Vec<u64>,
    fading: bool,
    /// True if another graph took over.
    replaced: bool,
    /// Setting changes.
    changes: Changes,
    /// The next change.
    change: Option<ParamRamp>,
}

impl Arrivals {
    pub(crate) fn open(plan: &Plan, of: (&Path, usize), bounds: &ReplayBounds) -> Result<Self, ReplayError> {
        let (mut rows, mut row) = (Rows::open(plan, of, bounds)?, Vec::new());
        rows.next(&mut row)?;
        let mut changes = Changes::open(plan, of)?;
        Ok(Self {
            rows,
            row,
            gated: gated(plan).collect(),
            arrived: vec![0; plan.ring_reads.len()],
            fading: false,
            replaced: false,
            change: changes.next()?,
            changes,
        })
    }

    pub(crate) fn is_over(&self) -> bool {
        self.replaced || self.row.is_empty()
    }

    /// Runs the next callback, if the frames that it read have arrived and those that it sent fit.
    fn run_next(
        &mut self,
        player: &mut Player,
        each: &mut impl FnMut(&mut Run, usize),
    ) -> Result<bool, ReplayError> {
        let Some((&[frames, state], seen)) = self.row.split_first_chunk() else {
            return Ok(false);
        };
        self.replaced |= f64::from(state) == REPLACED;
        if self.replaced {
            return Ok(false);
        }
        let run = player.run_mut();
        if f64::from(state) == RESUMED {
            match (frames as usize).checked_sub(1) {
                Some(device) => run.restart_device(device, FADE_S),
                None => run.restart_from_zero(FADE_S),
            }
            self.rows.next(&mut self.row)?;
            return Ok(true);
        }
        let (gates, rings) = seen.split_at(self.gated.len());
        let (arrived, sent) = rings.split_at(self.arrived.len());
        if !has_arrived(run, (&self.arrived, arrived), sent) {
            return Ok(false);
        }
        apply(run, (&mut self.arrived, arrived), sent);
        for (actuator, open) in self.gated.iter().zip(gates) {
            run.turn_gate(*actuator, *open > 0, FADE_S);
        }
        if f64::from(state) == FADING && !std::mem::replace(&mut self.fading, true) {
            run.fade_out(FADE_S);
        }
        while let Some(change) = self.change.take_if(|change| change.begin <= player.frames()) {
            player.start_ramp(change);
            self.change = self.changes.next()?;
        }
        player.run_due(frames as usize, each);
        player.run_mut().check_inputs()?;
        self.rows.next(&mut self.row)?;
        Ok(true)
    }
}

/// True if the frames that a callback read have arrived and those that it sent fit.
fn has_arrived(run: &Run, (before, arrived): (&[u64], &[u32]), sent: &[u32]) -> bool {
    let ring_ends = &run.state.ring_ends;
    let seen = before.iter().zip(arrived).map(|(before, more)| before + u64::from(*more));
    let sees = ring_ends.readers.iter().zip(seen).all(|(reader, seen)| {
        let there = |reader: &AsyncResamplerReader| reader.arrivals() >= seen;
        reader.as_ref().is_none_or(there)
    });
    let fits = ring_ends.writers.iter().zip(sent).all(|(writer, sent)| {
        let room = |writer: &AsyncResamplerWriter| writer.free() >= u64::from(*sent);
        writer.as_ref().is_none_or(room)
    });
    sees && fits
}

/// Sets the rings of a run to the counts of the callback.
fn apply(run: &mut Run, (before, arrived): (&mut [u64], &[u32]), sent: &[u32]) {
    let ring_ends = &mut run.state.ring_ends;
    for (reader, (before, more)) in ring_ends.readers.iter_mut().zip(before.iter_mut().zip(arrived)) {
        *before += u64::from(*more);
        if let Some(reader) = reader {
            reader.poll(*before);
        }
    }
    for (writer, sent) in ring_ends.writers.iter_mut().zip(sent) {
        if let Some(writer) = writer {
            writer.poll_as(u64::from(*sent));
        }
    }
}

impl Run {
    /// Returns the first error of the input scripts.
    fn check_inputs(&mut self) -> Result<(), ReplayError> {
        let scripts = self.state.devices.iter_mut().filter_map(|device| device.script.as_mut());
        scripts.filter_map(|script| script.failure()).next().map_or(Ok(()), Err)
    }
}

/// Lets the players read their live inputs from a run's folder.
pub(in super::super) fn repeat_inputs(
    players: &mut [Player],
    folder: &Path,
    bounds: &ReplayBounds,
) -> Result<(), ReplayError> {
    for (driver, player) in players.iter_mut().enumerate() {
        let run = player.run_mut();
        let plan = Arc::clone(&run.plan);
        for (place, script) in scripts(&plan, (folder, driver), bounds)? {
            run.state.devices[place].script = Some(script);
        }
        // No input has been heard yet in the replayed run.
        for place in gated(&plan) {
            run.state.actuators[place].gate = SilenceGate::new(false);
        }
    }
    Ok(())
}

/// Replays the callbacks of a live run, those of each driver in order. Calls `each` after every block; stops early if it
/// or `goes_on` returns false, or if a node panics.
pub(in super::super) fn replay(
    players: &mut [Player],
    scripts: &mut [Arrivals],
    goes_on: impl Fn() -> bool,
    mut each: impl FnMut(usize, &Run) -> bool,
) -> Result<(), ReplayError> {
    let mut is_written = true;
    loop {
        let mut moved = false;
        for (driver, (script, player)) in scripts.iter_mut().zip(&mut *players).enumerate() {
            // Until the driver has to wait for the others: a ring holds little.
            loop {
                let panicked = player.state() == PlayerState::Panicked;
                if panicked || !is_written || !goes_on() {
                    return Ok(());
                }
                if !script.run_next(player, &mut |run, _| is_written &= each(driver, run))? {
                    break;
                }
                moved = true;
            }
        }
        // When another graph took over, the other drivers read frames of the next graph.
        let is_over = !moved && scripts.iter().any(|script| script.replaced);
        if is_over || scripts.iter().all(Arrivals::is_over) {
            return Ok(());
        }
        if let (false, Some(stuck)) = (moved, scripts.iter().find(|script| !script.is_over())) {
            let (path, line) = stuck.rows.lines.place();
            return Err(ReplayError::Contradiction { path, line });
        }
    }
}
