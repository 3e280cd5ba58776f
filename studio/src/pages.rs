//! The pages that are connected to a stage.

use super::page_clock::PageClock;
use super::stage::Stage;
use super::wire::{MOST_SCOPES, Message, Wanted};

/// Where the messages to a page go.
pub trait Line: Send {
    /// Sends one, without waiting.
    ///
    /// # Errors
    /// [`LineError`]: it did not go.
    fn send(&mut self, message: Message) -> Result<(), LineError>;
}

/// Why a message did not go to its page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineError {
    /// The page does not read.
    Full,
    /// There is no page any more.
    Gone,
}

/// Where a page is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// On the machine of the engine.
    Machine,
    /// Elsewhere, over a network on which others can listen.
    Network,
}

/// A page that is connected.
pub struct Page {
    pub id: u64,
    pub reach: Reach,
    pub line: Box<dyn Line>,
    pub wanted: Vec<Wanted>,
    pub hears: bool,
    /// Does it see the drawing?
    pub sees_levels: bool,
    pub lost: u64,
    pub is_gone: bool,
    pub clock: PageClock,
}

impl Stage {
    /// A page that came; the first is the owner.
    pub fn join(&mut self, line: Box<dyn Line>, reach: Reach) -> u64 {
        let id = self.next_page;
        self.next_page += 1;
        self.pages.push(Page {
            id,
            reach,
            line,
            wanted: Vec::new(),
            hears: false,
            sees_levels: false,
            lost: 0,
            is_gone: false,
            clock: PageClock::default(),
        });
        self.owner.get_or_insert(id);
        id
    }

    /// A page that went. What it held falls silent by itself.
    pub fn leave(&mut self, page: u64) {
        self.pages.retain(|known| known.id != page);
        if self.owner == Some(page) {
            self.disarm();
            self.owner = self.pages.first().map(|known| known.id);
        }
    }

    /// Another page becomes the owner. What it did not arm is not armed.
    pub fn give_to(&mut self, page: u64) {
        if self.owner.replace(page) != Some(page) {
            self.disarm();
        }
    }

    /// The ports that a page wants to see.
    pub fn scope(&mut self, page: u64, mut ports: Vec<Wanted>) {
        ports.truncate(MOST_SCOPES);
        self.page_of(page, |page| page.wanted = ports);
    }

    /// Does something to a page, where it is still there.
    pub fn page_of(&mut self, page: u64, work: impl FnOnce(&mut Page)) {
        if let Some(page) = self.pages.iter_mut().find(|known| known.id == page) {
            work(page);
        }
    }
}
