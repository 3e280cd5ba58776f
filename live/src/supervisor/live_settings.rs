//! Live settings by name and by handle. A name is looked up once for each graph, and no number becomes text.

use super::inbox::{RequestSender, SendError};
use haptograph_engine::graph::{LiveSetting, NodeId};
use haptograph_engine::node::SettingId;
use haptograph_engine::run::UnknownSetting;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A live setting of the running graph, as the engine addresses it.
pub(super) type Target = (NodeId, SettingId);

/// Sets one live setting of a live run from any thread. [`Supervisor::setting`](super::Supervisor::setting) makes it.
///
/// The handle stays valid when another graph is swapped in: it then addresses the setting of the same name.
#[derive(Debug, Clone)]
pub struct SettingHandle {
    slot: Arc<Slot>,
    sender: RequestSender,
}

/// Reason why a name has no handle.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// No live setting of the running graph has the name.
    #[error(transparent)]
    Unknown(#[from] UnknownSetting),
    /// The name is a parameter; a new value of it loads the graph again.
    #[error(
        "`{0}` is a parameter of the graph, not a live setting; `Supervisor::set` loads the graph with its new value"
    )]
    Parameter(String),
}

/// The value on its way from a handle to the supervisor: the latest counts.
#[derive(Debug)]
struct Slot {
    name: Arc<str>,
    bits: AtomicU64,
    /// Position of the value among all requests.
    order: AtomicU64,
    /// True if the supervisor has not taken the value yet.
    is_pending: AtomicBool,
    has_ended: AtomicBool,
}

impl SettingHandle {
    /// The name of the setting: `out.gain`.
    pub fn name(&self) -> &str {
        &self.slot.name
    }

    /// Sets the value, and ends the supervisor's [`wait`](super::Supervisor::wait). The next
    /// [`poll`](super::Supervisor::poll) passes these bits to the node, or reports once why it does not.
    /// Of several values between two polls the latest counts.
    ///
    /// # Errors
    /// [`SendError::Ended`].
    pub fn set(&self, value: f64) -> Result<(), SendError> {
        if self.slot.has_ended.load(Ordering::Acquire) {
            return Err(SendError::Ended);
        }
        self.slot.bits.store(value.to_bits(), Ordering::Release);
        self.slot.order.store(self.sender.ordered(()).order, Ordering::Release);
        if !self.slot.is_pending.swap(true, Ordering::AcqRel) {
            self.sender.wake();
        }
        Ok(())
    }
}

/// The live settings of the running graph, and the handles of them.
pub(super) struct LiveSettings {
    by_name: HashMap<String, Target>,
    handles: Vec<Bound>,
    /// The order of the latest value of each setting of the graph.
    latest: HashMap<String, u64>,
}

/// The supervisor's end of a handle.
struct Bound {
    slot: Arc<Slot>,
    /// `None` if the running graph does not have the setting.
    target: Option<Target>,
    /// True if a refusal was reported since the last value that was set.
    is_refused: bool,
}

/// A value that a handle has set.
pub(super) struct PendingValue {
    /// Index of the handle.
    pub handle: usize,
    pub order: u64,
    pub name: Arc<str>,
    pub target: Option<Target>,
    pub value: f64,
}

impl LiveSettings {
    /// The live settings of a graph.
    pub(super) fn of<'l>(settings: impl Iterator<Item = &'l LiveSetting>) -> Self {
        Self { by_name: targets(settings), handles: Vec::new(), latest: HashMap::new() }
    }

    /// Turns to the settings of another graph.
    pub(super) fn rebind<'l>(&mut self, settings: impl Iterator<Item = &'l LiveSetting>) {
        self.by_name = targets(settings);
        self.latest.retain(|name, _| self.by_name.contains_key(name));
        for bound in &mut self.handles {
            bound.target = self.by_name.get(&*bound.slot.name).copied();
        }
    }

    pub(super) fn target(&self, name: &str) -> Option<Target> {
        self.by_name.get(name).copied()
    }

    /// A handle of a setting that the graph has.
    pub(super) fn handle(&mut self, name: &str, sender: &RequestSender) -> Option<SettingHandle> {
        let target = self.target(name)?;
        let is_in_use =
            |slot: &Arc<Slot>| Arc::strong_count(slot) > 1 || slot.is_pending.load(Ordering::Acquire);
        self.handles.retain(|bound| is_in_use(&bound.slot));
        // All handles of a name are one, so that the latest value counts.
        if let Some(bound) = self.handles.iter().find(|bound| &*bound.slot.name == name) {
            return Some(SettingHandle { slot: Arc::clone(&bound.slot), sender: sender.clone() });
        }
        let slot = Arc::new(Slot {
            name: name.into(),
            bits: AtomicU64::new(0),
            order: AtomicU64::new(0),
            is_pending: AtomicBool::new(false),
            has_ended: AtomicBool::new(false),
        });
        self.handles.push(Bound { slot: Arc::clone(&slot), target: Some(target), is_refused: false });
        Some(SettingHandle { slot, sender: sender.clone() })
    }

    /// The values that were set, in their order.
    pub(super) fn take_pending(&mut self) -> Vec<PendingValue> {
        let bound = self.handles.iter().enumerate();
        let pending = bound.filter(|(_, bound)| bound.slot.is_pending.swap(false, Ordering::AcqRel));
        let mut pending: Vec<_> = pending
            .map(|(handle, Bound { slot, target, .. })| PendingValue {
                handle,
                order: slot.order.load(Ordering::Acquire),
                name: Arc::clone(&slot.name),
                target: *target,
                value: f64::from_bits(slot.bits.load(Ordering::Acquire)),
            })
            .collect();
        pending.sort_by_key(|pending| pending.order);
        pending
    }

    /// Takes a handle's value once more at the next poll, unless there is a newer one: the queue to the driver was
    /// full.
    pub(super) fn retry(&self, handle: usize) {
        self.handles[handle].slot.is_pending.store(true, Ordering::Release);
    }

    /// True if a value of this order is newer than all that were set by the same name.
    pub(super) fn is_newest(&mut self, name: &str, order: u64) -> bool {
        match self.latest.get_mut(name) {
            Some(latest) if *latest > order => false,
            Some(latest) => {
                *latest = order;
                true
            }
            None => {
                self.latest.insert(name.to_owned(), order);
                true
            }
        }
    }

    /// Ends the handles: their values are no longer read.
    pub(super) fn end(&self) {
        for bound in &self.handles {
            bound.slot.has_ended.store(true, Ordering::Release);
        }
    }

    /// Records whether a handle's value was set. Returns true for the first refusal in a row.
    pub(super) fn note(&mut self, handle: usize, was_set: bool) -> bool {
        let was_refused = std::mem::replace(&mut self.handles[handle].is_refused, !was_set);
        !was_set && !was_refused
    }
}

fn targets<'l>(settings: impl Iterator<Item = &'l LiveSetting>) -> HashMap<String, Target> {
    settings.map(|live| (live.name(), (live.node, live.setting))).collect()
}

impl Drop for LiveSettings {
    fn drop(&mut self) {
        self.end();
    }
}
