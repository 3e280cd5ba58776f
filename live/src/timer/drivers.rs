//! The timers of a live run.

use super::thread::TimerThread;
use crate::backend::{Backend, BackendError, Connected, Counts, Lives, State};
use haptograph_engine::graph::Graph;

/// A timer for each clock that nothing else drives.
#[derive(Default)]
pub(super) struct Timers(Vec<Driver>);

struct Driver {
    clock: usize,
    name: String,
    thread: TimerThread,
}

impl Backend for Timers {
    fn open(&mut self, _: &mut Graph) -> Result<(), BackendError> {
        Ok(())
    }

    fn drive(&mut self, graph: &Graph, lives: &mut Lives) -> Result<(), BackendError> {
        for (clock, live) in lives.drain(..) {
            self.0.push(Driver {
                clock,
                name: graph.clocks()[clock].name.clone(),
                thread: TimerThread::start(live).map_err(BackendError::Thread)?,
            });
        }
        Ok(())
    }

    fn status(&self) -> Vec<Connected> {
        let driver = |driver: &Driver| Connected {
            state: match driver.thread.is_finished() {
                true => State::Finished,
                false => State::Running,
            },
            refused: driver.thread.refused.clone(),
            ..Connected::driver(&driver.name, driver.clock, "a timer with 1000 wake-ups a second")
        };
        self.0.iter().map(driver).collect()
    }

    fn counts(&self) -> Vec<Counts> {
        self.0.iter().map(|_| Counts::None).collect()
    }

    fn close(&mut self) -> Result<Lives, BackendError> {
        let ended = |driver: Driver| Some((driver.clock, driver.thread.join()?));
        self.0.drain(..).map(|driver| ended(driver).ok_or(BackendError::Lost)).collect()
    }
}
