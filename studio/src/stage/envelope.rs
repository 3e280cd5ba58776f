//! Edits beyond the safety envelope: refused, and confirmed at the terminal.

use super::super::envelope::{Confirmed, Proposal};
use super::super::error::StageError;
use super::super::load::Source;
use super::Stage;
use std::sync::Arc;

impl Stage {
    /// Keeps a refused edit, for confirmation at the terminal.
    pub(crate) fn propose(&mut self, source: Source, text: String, beyond: Vec<String>) {
        self.permitted.proposals += 1;
        self.permitted.proposal = Some(Proposal { number: self.permitted.proposals, beyond, source, text });
    }

    /// Confirms the limits and devices of the latest proposal, if it has this number. The page has to ask for it again.
    ///
    /// # Errors
    /// [`StageError`] if another edit was proposed since, or none was.
    pub(crate) fn confirm(&mut self, number: u64) -> Result<(), StageError> {
        let Some(proposal) = self.permitted.proposal.take_if(|proposal| proposal.number == number) else {
            let why = match &self.permitted.proposal {
                Some(latest) => format!("edit {number} was replaced by edit {}", latest.number),
                None => format!("there is no edit {number} to confirm"),
            };
            return Err(StageError::Other(why));
        };
        self.permitted.confirmed = Some(Arc::new(Confirmed::of(&proposal.source, &proposal.text)?));
        Ok(())
    }
}
