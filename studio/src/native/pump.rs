//! Thread that sends new data to the pages.

use super::lock;
use crate::publish::{Publisher, STEP};
use crate::stage::Stage;
use std::sync::{Mutex, Weak};
use std::time::Instant;

/// Serves the pages of a stage until the stage is dropped.
pub(super) fn run(stage: &Weak<Mutex<Stage>>) {
    let (mut publisher, mut last) = (Publisher::default(), Instant::now());
    loop {
        std::thread::sleep(STEP);
        let Some(stage) = stage.upgrade() else { break };
        let passed = last.elapsed();
        last = Instant::now();
        let mut stage = lock(&stage);
        stage.advance_replay(passed);
        publisher.publish(&mut stage, passed);
    }
}
