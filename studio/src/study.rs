//! A study that pages conduct.

use haptograph_study::conduct::{Conduct, Presentation};
use serde_json::Value;
#[cfg(not(target_family = "wasm"))]
use std::time::Instant;

/// A study that is being run on a stage.
pub(crate) struct OnStage {
    pub conductor: Box<dyn Conduct + Send>,
    begun: Begun,
    /// What each kind of page was told last.
    pub told: [Value; 2],
    /// The run that follows once the one before has fallen to zero.
    pub presentation: Option<Presentation>,
    /// When the experimenter's page held the actuators last, s.
    pub held_s: Option<f64>,
}

/// When a session began: a page has the clock that it is told.
#[cfg(not(target_family = "wasm"))]
type Begun = Instant;
#[cfg(target_family = "wasm")]
type Begun = std::time::Duration;

impl OnStage {
    pub(crate) fn new(conductor: Box<dyn Conduct + Send>) -> Self {
        #[cfg(not(target_family = "wasm"))]
        let begun = Instant::now();
        #[cfg(target_family = "wasm")]
        let begun = haptograph_signal::time::since_1970();
        Self { conductor, begun, told: Default::default(), presentation: None, held_s: None }
    }

    /// Time of the session, s.
    pub(crate) fn now_s(&self) -> f64 {
        #[cfg(not(target_family = "wasm"))]
        let passed = self.begun.elapsed();
        #[cfg(target_family = "wasm")]
        let passed = haptograph_signal::time::since_1970().saturating_sub(self.begun);
        passed.as_secs_f64()
    }
}
