//! Thread that runs the frames of a stage without drivers, and sends new data to the pages.

use super::lock;
use crate::clock::PERIOD;
use crate::publish::{Publisher, STEP};
use crate::stage::Stage;
use std::sync::{Mutex, Weak};
use std::time::{Duration, Instant};

/// Serves a stage and its pages until the stage is dropped.
pub(super) fn run(stage: &Weak<Mutex<Stage>>) {
    let (mut publisher, mut last, mut since) = (Publisher::default(), Instant::now(), Duration::ZERO);
    let mut runs_frames = true;
    loop {
        // Others get the stage meanwhile, also while frames take longer than real time.
        std::thread::sleep(if runs_frames { PERIOD } else { STEP });
        let Some(stage) = stage.upgrade() else { break };
        let passed = last.elapsed();
        last = Instant::now();
        since += passed;
        let mut stage = lock(&stage);
        runs_frames = stage.advance(passed, STEP);
        if since >= STEP {
            since = Duration::ZERO;
            publisher.publish(&mut stage);
        }
    }
}
