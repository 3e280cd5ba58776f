//! Repeating what drivers saw.

use super::super::Run;
use super::super::control::COMMANDS;
use super::super::fleet::Fleet;
use super::super::glide::{Glide, Glides};
use super::super::link::{LinkReader, LinkWriter};
use super::super::live::FADE_S;
use super::{FADING, REPLACED, ReplayError, SETTINGS_HEADER, cell, columns, file, header, settings_file};
use crate::plan::Plan;
use haptograph_signal::files::{self, MAX_RECORDING_BYTES};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// What a driver saw, as read from its file.
pub(in super::super) struct Arrivals {
    path: PathBuf,
    numbers: Vec<u32>,
    columns: usize,
    done: usize,
    /// Of each ring that is read: frames that had arrived by the line done last.
    arrived: Vec<u64>,
    fading: bool,
    /// Another graph took over.
    replaced: bool,
    /// What is to be set, and how much of it has been.
    changes: Vec<Glide>,
    changed: usize,
    glides: Glides,
}

impl Arrivals {
    pub fn load(folder: &Path, driver: usize, plan: &Plan) -> Result<Self, ReplayError> {
        let path = file(folder, driver);
        let read = |error| ReplayError::Read {
            path: path.clone(),
            error,
        };
        let mut lines = BufReader::new(files::open(&path, MAX_RECORDING_BYTES).map_err(read)?).lines();
        let found = lines.next().transpose().map_err(read)?.unwrap_or_default();
        let (wanted, columns) = (header(plan), columns(plan));
        if found != wanted {
            return Err(ReplayError::OtherGraph { path, found, wanted });
        }
        let mut numbers = Vec::new();
        for (place, line) in lines.enumerate() {
            let text = line.map_err(read)?;
            let before = numbers.len();
            for number in text.split(',') {
                // Nothing is too large: a line with something that is no number is refused as a whole.
                numbers.extend(number.parse::<u32>());
            }
            if numbers.len() != before + columns || text.split(',').count() != columns {
                let line = place + 2;
                return Err(ReplayError::Line { path, line, columns });
            }
        }
        Ok(Self {
            path,
            numbers,
            columns,
            done: 0,
            arrived: vec![0; plan.ring_reads.len()],
            fading: false,
            replaced: false,
            changes: changes(settings_file(folder, driver), plan)?,
            changed: 0,
            glides: Glides::with_room_for(COMMANDS),
        })
    }

    pub fn is_over(&self) -> bool {
        self.replaced || self.done * self.columns == self.numbers.len()
    }

    /// Runs the next callback, if everything that it saw has been sent by now and what it sent finds room.
    fn run_next<E>(&mut self, run: &mut Run, mut each: impl FnMut(&Run) -> Result<(), E>) -> Result<bool, E> {
        let Some(row) = self.numbers[self.done * self.columns..].get(..self.columns) else {
            return Ok(false);
        };
        self.replaced |= f64::from(row[1]) == REPLACED;
        if self.replaced {
            return Ok(false);
        }
        let (arrived, sent) = row[2..].split_at(self.arrived.len());
        let links = &mut run.state.links;
        let seen = self
            .arrived
            .iter()
            .zip(arrived)
            .map(|(before, more)| before + u64::from(*more));
        let sees = links.readers.iter().zip(seen).all(|(reader, seen)| {
            let there = |reader: &LinkReader| reader.arrivals() >= seen;
            reader.as_ref().is_none_or(there)
        });
        let fits = links.writers.iter().zip(sent).all(|(writer, sent)| {
            let room = |writer: &LinkWriter| writer.free() >= u64::from(*sent);
            writer.as_ref().is_none_or(room)
        });
        if !(sees && fits) {
            return Ok(false);
        }
        for (reader, (before, more)) in links.readers.iter_mut().zip(self.arrived.iter_mut().zip(arrived)) {
            *before += u64::from(*more);
            if let Some(reader) = reader {
                reader.look(*before);
            }
        }
        for (writer, sent) in links.writers.iter_mut().zip(sent) {
            if let Some(writer) = writer {
                writer.look_as(u64::from(*sent));
            }
        }
        if f64::from(row[1]) == FADING && !std::mem::replace(&mut self.fading, true) {
            run.fade_out(FADE_S);
        }
        while let Some(change) = self.changes.get(self.changed)
            && change.begin <= run.driver_frames()
        {
            self.glides.start(*change, run);
            self.changed += 1;
        }
        let mut left = row[0] as usize;
        while left > 0 {
            let rate_hz = run.rate_hz();
            let block = left.min(run.plan.block).min(self.glides.step(run, rate_hz));
            run.advance(block);
            each(run)?;
            left -= block;
        }
        self.done += 1;
        Ok(true)
    }
}

/// What is to be set of a driver, as read from its file.
fn changes(path: PathBuf, plan: &Plan) -> Result<Vec<Glide>, ReplayError> {
    let text = match files::read_text(&path, MAX_RECORDING_BYTES) {
        Ok(text) => text,
        Err(error) => return Err(ReplayError::Read { path, error }),
    };
    let known: Vec<String> = plan.live.iter().map(cell).collect();
    let change = |line: &str| -> Option<Glide> {
        let cells: Vec<&str> = line.splitn(5, ',').collect();
        let [begin, from, to, frames, name] = cells[..] else {
            return None;
        };
        let number = |text: &str| text.parse::<f64>().ok().filter(|number| number.is_finite());
        Some(Glide {
            place: known.iter().position(|known| known == name)?,
            from: number(from)?,
            to: number(to)?,
            begin: begin.parse().ok()?,
            frames: frames.parse().ok()?,
        })
    };
    let mut changes = Vec::new();
    for (place, line) in text.lines().enumerate() {
        match change(line) {
            Some(change) => changes.push(change),
            None if place == 0 && line == SETTINGS_HEADER => {}
            None => {
                let line = place + 1;
                return Err(ReplayError::Setting { path, line });
            }
        }
    }
    Ok(changes)
}

impl Fleet {
    /// Repeats the callbacks of a live run, each driver's in their order. `each` sees every block of every driver;
    /// `goes_on` is asked now and then.
    pub(in super::super) fn replay<E: From<ReplayError>>(
        &mut self,
        scripts: &mut [Arrivals],
        goes_on: impl Fn() -> bool,
        mut each: impl FnMut(usize, &Run) -> Result<(), E>,
    ) -> Result<(), E> {
        while goes_on() {
            let mut moved = false;
            for (driver, (script, run)) in scripts.iter_mut().zip(self.runs_mut()).enumerate() {
                // As far as the others let it: a ring holds little.
                while script.run_next(run, |run| each(driver, run))? {
                    moved = true;
                }
            }
            if scripts.iter().all(Arrivals::is_over) {
                return Ok(());
            }
            if !moved && scripts.iter().any(|script| script.replaced) {
                // The others saw what the graph after this one sent.
                return Ok(());
            }
            if let (false, Some(stuck)) = (moved, scripts.iter().find(|script| !script.is_over())) {
                let (path, line) = (stuck.path.clone(), stuck.done + 2);
                return Err(ReplayError::Contradiction { path, line }.into());
            }
        }
        Ok(())
    }
}
