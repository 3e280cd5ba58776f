//! Pages that come, go and own the stage.

use super::super::pages::{Line, Page, Reach};
use super::super::wire::{MAX_SCOPES, ScopeRequest, text};
use super::Stage;

impl Stage {
    /// Adds a page; the first one becomes the owner.
    pub(crate) fn join(&mut self, line: Box<dyn Line>, reach: Reach) -> u64 {
        let id = self.pages.next;
        self.pages.next += 1;
        self.pages.list.push(Page {
            id,
            reach,
            line,
            wanted: Vec::new(),
            hears: false,
            sees_levels: false,
            lost: 0,
            is_gone: false,
            clocks: Vec::new(),
        });
        if reach == Reach::Participant {
            if self.study_drives() && self.pages.owner.is_some() {
                self.interrupt_study("another page of the participant came");
            }
            self.pages.owner = Some(id);
        } else if self.pages.study.is_none() {
            self.give_to(self.pages.owner.unwrap_or(id));
        }
        id
    }

    /// Removes a page. Its inputs fall silent by their timeout.
    pub(crate) fn leave(&mut self, page: u64) {
        self.pages.list.retain(|known| known.id != page);
        if self.pages.study.is_some() {
            // The latest page of the participant is the one that counts.
            let participants = self.pages.list.iter().filter(|page| page.reach == Reach::Participant);
            self.pages.owner = participants.map(|page| page.id).max();
            if self.study_drives() {
                self.interrupt_study("a page left");
            }
        } else if self.pages.owner == Some(page) {
            self.disarm();
            // A page of the network could not resume the run.
            let of_machine = self.pages.list.iter().find(|page| page.reach == Reach::Machine);
            self.pages.owner = of_machine.or(self.pages.list.first()).map(|page| page.id);
            if self.pages.owner.is_some() {
                self.release_inputs();
            }
        }
    }

    /// Makes another page the owner. Actuators that the previous owner armed are disarmed, and what it held is released.
    pub(crate) fn give_to(&mut self, page: u64) {
        if self.pages.owner.replace(page) != Some(page) {
            self.disarm();
            self.release_inputs();
        }
    }

    /// Sends a message to the owner.
    pub(crate) fn tell_owner(&mut self, value: &serde_json::Value) {
        let owner = self.pages.owner;
        if let Some(page) = self.pages.list.iter_mut().find(|page| Some(page.id) == owner) {
            page.send(text(value));
        }
    }

    /// Tells the pages of this machine that another program changed the graph's file.
    pub(crate) fn follow_disk(&mut self) {
        let Ok(now) = self.source.read() else { return };
        if now != self.on_disk && self.pages.disk.as_ref() != Some(&now) {
            let message = text(&serde_json::json!({ "type": "disk", "text": now }));
            let own = self.pages.list.iter_mut().filter(|page| page.reach == Reach::Machine);
            own.for_each(|page| page.send(message.clone()));
            self.pages.disk = Some(now);
        }
    }

    /// Sets the ports that a page displays.
    pub(crate) fn scope(&mut self, page: u64, mut ports: Vec<ScopeRequest>) {
        ports.truncate(MAX_SCOPES);
        self.page_of(page, |page| page.wanted = ports);
    }

    /// Calls `work` with a page if it is still connected.
    pub(crate) fn page_of(&mut self, page: u64, work: impl FnOnce(&mut Page)) {
        if let Some(page) = self.pages.list.iter_mut().find(|known| known.id == page) {
            work(page);
        }
    }
}
