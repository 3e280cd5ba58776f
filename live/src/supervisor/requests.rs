//! Requests to a live run: settings at once, parameters by another graph.

use super::history::History;
use super::inbox::Ordered;
use super::live_settings::PendingValue;
use super::loading::{self, Job, SavedOverrides};
use super::{Event, Origin, Request, Supervisor, network_value};
use crate::SettingValue;
use haptograph_engine::run::{ControlError, SetError};
use haptograph_engine::settings::choices;

/// Which events of a change are of interest. A fader is moved a hundred times per second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Verbosity {
    Silent,
    /// Only the reasons of refusals.
    Refusals,
    All,
}

/// A change that needs the graph to be loaded again.
#[derive(Debug)]
pub(super) enum PendingChange {
    Set(Request),
    /// A file of the graph was saved.
    Saved,
}

impl Supervisor {
    /// Reports why a request is refused.
    pub(super) fn refuse(&mut self, verbosity: Verbosity, why: String) {
        if verbosity >= Verbosity::Refusals {
            self.events.push(Event::Refused(why));
        }
    }

    /// Handles requests, in their order: those that need a loaded graph are queued, all others are done at once.
    pub(super) fn handle_requests(&mut self) {
        let arrived = self.requests.inbox.take(self.room());
        let mut requests: Vec<Ordered<Request>> = std::mem::take(&mut self.requests.queued);
        for request in arrived {
            // Only the latest value of a fader counts.
            if request.asked.origin == Origin::Osc {
                let same = |known: &Ordered<Request>| {
                    known.asked.origin == Origin::Osc && known.asked.name == request.asked.name
                };
                requests.retain(|known| !same(known));
            }
            requests.push(request);
        }
        requests.sort_by_key(|request| request.order);
        let mut requests = requests.into_iter().peekable();
        for pending in self.requests.settings.take_pending() {
            while let Some(request) = requests.next_if(|request| request.order < pending.order) {
                self.request_change(request);
            }
            self.set_pending(pending);
        }
        requests.for_each(|request| self.request_change(request));
    }

    /// Passes on a value that a handle has set.
    fn set_pending(&mut self, pending: PendingValue) {
        if !self.requests.settings.is_newest(&pending.name, pending.order) {
            return;
        }
        let set = match pending.target {
            Some((node, setting)) => self.session.set(node, setting, pending.value),
            None => Err(ControlError::NotLive),
        };
        if matches!(set, Err(ControlError::Full)) {
            self.requests.settings.retry(pending.handle);
        }
        let is_first_refusal = self.requests.settings.note(pending.handle, set.is_ok());
        match set {
            Ok(()) => {
                let at_s = self.record.start.elapsed().as_secs_f64();
                let value = SettingValue::Number(pending.value);
                self.record.history.set(at_s, pending.name, value, Origin::Program);
            }
            Err(error) if is_first_refusal => {
                self.refuse(Verbosity::All, format!("`{}` was not changed: {error}", pending.name))
            }
            Err(_) => {}
        }
    }

    /// Sets a live setting of a node at once. A parameter is queued until the graph is loaded with it.
    fn request_change(&mut self, Ordered { order, asked }: Ordered<Request>) {
        let request = asked;
        let Request { name, value, origin } = &request;
        let verbosity = self.verbosity(name, *origin);
        if name.contains('.') {
            // A handle has set a newer value meanwhile.
            if self.requests.settings.target(name).is_some() && !self.requests.settings.is_newest(name, order)
            {
                return;
            }
            let was_set = self.set_directly(name, value, verbosity);
            return self.note(was_set, request);
        }
        if !self.parameters.known.iter().any(|(known, _)| known == name) {
            let names = self.parameters.known.iter().map(|(known, _)| known.as_str());
            let help = choices(name, &names.collect::<Vec<_>>(), "its parameters are");
            self.refuse(verbosity, format!("the graph has no parameter `{name}`{help}"));
            return self.note(false, request);
        }
        if *origin == Origin::Osc
            && let SettingValue::Text(text) = value
            && let Some(refusal) = network_value::refusal(text, &self.parameters.source.path)
        {
            self.refuse(verbosity, format!("`{name}` was not changed: {refusal}"));
            return self.note(false, request);
        }
        // Of requests that are not typed, only the latest for a name counts.
        if *origin != Origin::Keyboard {
            let same = |change: &PendingChange| matches!(change, PendingChange::Set(known) if known.origin == *origin && known.name == *name);
            self.edits.waiting.retain(|change| !same(change));
        }
        self.edits.waiting.push_back(PendingChange::Set(request));
    }

    /// Which events of a request are of interest.
    fn verbosity(&self, name: &str, origin: Origin) -> Verbosity {
        let full = self.requests.refused.len() >= History::MAX;
        match origin {
            Origin::Keyboard | Origin::Program => Verbosity::All,
            Origin::Osc if full || self.requests.refused.iter().any(|known| known == name) => {
                Verbosity::Silent
            }
            Origin::Osc => Verbosity::Refusals,
        }
    }

    /// Records the outcome of a request.
    pub(super) fn note(&mut self, was_set: bool, request: Request) {
        let Request { name, value, origin } = request;
        if was_set {
            let at_s = self.record.start.elapsed().as_secs_f64();
            self.record.history.set(at_s, name.into(), value, origin);
        } else if self.verbosity(&name, origin) == Verbosity::Refusals {
            self.requests.refused.push(name);
        }
    }

    /// Polls the loader; when it is free, starts the next queued change.
    pub(super) fn load_next(&mut self) {
        if let Some((change, loading)) = self.edits.loading.take() {
            let verbosity = match &change {
                PendingChange::Set(request) => self.verbosity(&request.name, request.origin),
                PendingChange::Saved => Verbosity::All,
            };
            match loading.poll() {
                Some(loaded) => self.swap_loaded(change, loaded, &loading, verbosity),
                None if loading.elapsed() < loading::BUDGET => {
                    self.edits.loading = Some((change, loading));
                    return;
                }
                None => {
                    let budget_s = loading::BUDGET.as_secs();
                    self.refuse(
                        verbosity,
                        format!(
                            "the running graph is unchanged: the new one did not load within {budget_s} s"
                        ),
                    );
                    self.reject(change);
                }
            }
        }
        if let Some(change) = self.edits.waiting.pop_front() {
            let job = self.job(&change);
            match self.edits.loader.begin(job) {
                Ok(loading) => self.edits.loading = Some((change, loading)),
                Err(why) => {
                    self.refuse(Verbosity::All, format!("the running graph is unchanged: {why}"));
                    self.reject(change);
                }
            }
        }
    }

    pub(super) fn reject(&mut self, change: PendingChange) {
        if let PendingChange::Set(request) = change {
            self.note(false, request);
        }
    }

    fn job(&mut self, change: &PendingChange) -> Job {
        let mut source = self.parameters.source.clone();
        let saved = match change {
            PendingChange::Set(Request { name, value, .. }) => {
                source.set.retain(|(known, _)| known != name);
                source.set.push((name.clone(), value.to_string()));
                None
            }
            PendingChange::Saved => Some(SavedOverrides {
                given: self.parameters.given.clone(),
                typed: self.parameters.typed.clone(),
            }),
        };
        Job { source, saved, known: self.edits.known.take() }
    }

    fn set_directly(&mut self, name: &str, value: &SettingValue, verbosity: Verbosity) -> bool {
        let number = match value {
            SettingValue::Number(number) => *number,
            SettingValue::Text(text) => {
                self.refuse(verbosity, format!("`{name}` was not changed: `{text}` is not a number"));
                return false;
            }
        };
        let target = self.requests.settings.target(name);
        let set = match target {
            Some((node, setting)) => self.session.set(node, setting, number).map_err(SetError::from),
            None => Err(self.session.unknown_setting(name).into()),
        };
        match set {
            Ok(()) => {
                if verbosity == Verbosity::All {
                    self.events.push(Event::Set(name.to_owned(), number));
                }
                true
            }
            Err(error) => {
                self.refuse(verbosity, format!("`{name}` was not changed: {error}"));
                false
            }
        }
    }
}
