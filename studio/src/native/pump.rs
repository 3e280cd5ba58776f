//! Thread that runs the frames of a stage without drivers, and sends new data to the pages.

use super::lock;
use crate::clock::PERIOD;
use crate::publish::{Publisher, STEP};
use crate::stage::Stage;
use haptograph_live::FileWatch;
use std::sync::{Mutex, Weak};
use std::time::{Duration, Instant};

/// Period in which the graph's file is looked at.
const LOOK: Duration = Duration::from_millis(500);

/// Serves a stage and its pages until the stage is dropped.
pub(super) fn run(stage: &Weak<Mutex<Stage>>) {
    let (mut publisher, mut last, mut since) = (Publisher::default(), Instant::now(), Duration::ZERO);
    let (mut runs_frames, mut looked) = (true, Duration::ZERO);
    let mut watch = stage.upgrade().map(|stage| FileWatch::of(&lock(&stage).loaded.graph));
    loop {
        // Others get the stage meanwhile, also while frames take longer than real time.
        std::thread::sleep(if runs_frames { PERIOD } else { STEP });
        let Some(stage) = stage.upgrade() else { break };
        let passed = last.elapsed();
        last = Instant::now();
        since += passed;
        looked += passed;
        let mut stage = lock(&stage);
        runs_frames = stage.advance(passed, STEP);
        if since >= STEP {
            since = Duration::ZERO;
            publisher.publish(&mut stage);
        }
        if looked >= LOOK && stage.pages.study.is_none() {
            looked = Duration::ZERO;
            if watch.as_mut().is_some_and(FileWatch::has_changed) {
                stage.follow_disk();
            }
        }
    }
}
