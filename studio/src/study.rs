//! A study that pages conduct.

use haptograph_study::conduct::{Conductor, Presentation};
use serde_json::Value;
use std::time::Instant;

/// A study that is being run on a stage.
pub(crate) struct OnStage {
    pub conductor: Conductor,
    begun: Instant,
    /// What each kind of page was told last.
    pub told: [Value; 2],
    /// The run that follows once the one before has fallen to zero.
    pub presentation: Option<Presentation>,
    /// When the experimenter's page held the actuators last.
    pub held: Option<Instant>,
    /// In a page there is no study: the compiler leaves it out.
    #[cfg(target_family = "wasm")]
    never: std::convert::Infallible,
}

impl OnStage {
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn new(conductor: Conductor) -> Self {
        Self { conductor, begun: Instant::now(), told: Default::default(), presentation: None, held: None }
    }

    /// Time of the session, s.
    pub(crate) fn now_s(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }
}
