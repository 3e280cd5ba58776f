//! The pages connected to a stage.

use super::page_clock::PageClock;
use super::study::OnStage;
use super::wire::{Message, ScopeRequest};

/// Channel for the messages to a page.
pub(crate) trait Line: Send {
    /// Sends a message without blocking.
    ///
    /// # Errors
    /// [`LineError`] if it was not sent.
    fn send(&mut self, message: Message) -> Result<(), LineError>;
}

/// Reason why a message was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LineError {
    /// The page does not read.
    Full,
    /// The page is closed.
    Gone,
}

/// Location of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reach {
    /// On the machine of the engine.
    Machine,
    /// On another machine, over a network that others can record.
    Network,
    /// Of the participant of a study, on any machine: it sees what it is told and nothing else.
    Participant,
}

/// A connected page.
pub(crate) struct Page {
    pub id: u64,
    pub reach: Reach,
    pub line: Box<dyn Line>,
    pub wanted: Vec<ScopeRequest>,
    pub hears: bool,
    /// True if the page displays the drawing.
    pub sees_levels: bool,
    pub lost: u64,
    pub is_gone: bool,
    /// By the driver of a pad.
    pub clocks: Vec<(Option<String>, PageClock)>,
}

/// The pages of a stage.
#[derive(Default)]
pub(crate) struct Pages {
    pub list: Vec<Page>,
    /// The page that controls the pads and the settings.
    pub owner: Option<u64>,
    /// Number of the page that comes next.
    pub next: u64,
    /// What another program wrote into the graph's file, until a page takes or refuses it.
    pub disk: Option<String>,
    /// The study that they conduct, if they do.
    pub study: Option<OnStage>,
}

impl Page {
    /// Its clock by the time of a driver.
    pub(crate) fn clock_of(&mut self, driver: Option<&str>) -> &mut PageClock {
        let known = self.clocks.iter().position(|(known, _)| known.as_deref() == driver);
        let place = known.unwrap_or_else(|| {
            self.clocks.push((driver.map(str::to_owned), PageClock::default()));
            self.clocks.len() - 1
        });
        &mut self.clocks[place].1
    }

    /// Sends a text that a participant may see.
    pub(crate) fn tell(&mut self, message: Message) {
        self.put(message);
    }

    /// Sends a message to a page, but no text to a participant's: names and settings do not reach it.
    pub(crate) fn send(&mut self, message: Message) {
        if self.reach != Reach::Participant || matches!(message, Message::Binary(_)) {
            self.put(message);
        }
    }

    /// Puts a message on the line of a page that may not read. Lost samples are counted; if a text is lost, such as the new graph,
    /// the page is disconnected and receives the full state when it reconnects.
    fn put(&mut self, message: Message) {
        let is_text = matches!(message, Message::Text(_));
        match self.line.send(message) {
            Ok(()) => {}
            Err(LineError::Full) if !is_text => self.lost += 1,
            Err(LineError::Full | LineError::Gone) => self.is_gone = true,
        }
    }
}
