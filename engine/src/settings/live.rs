//! Live settings: their handles, and how these are looked up.

use super::Settings;
use crate::node::NodeKind;
use crate::node_id::NodeId;
use std::marker::PhantomData;

/// A setting that can change while the graph runs.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveSetting {
    /// The node.
    pub node: NodeId,
    /// The node's path.
    pub path: String,
    /// Handle of the setting.
    pub setting: SettingId,
    /// The name.
    pub field: &'static str,
    /// The value.
    pub value: f64,
    /// Smallest and largest value.
    pub range: Option<(f64, f64)>,
    /// True if the value is a whole number. Such a setting jumps to its new value.
    pub whole: bool,
    /// SI per unit of the value and the range, which are as in graph files.
    pub si_per_unit: f64,
}

impl LiveSetting {
    /// Path and field: `out.gain`, `mix.gains[1]`.
    pub fn name(&self) -> String {
        format!("{}.{}", self.path, self.label())
    }

    /// The field, with the place in the list if the setting is one: `gains[1]`.
    pub fn label(&self) -> String {
        match self.setting.item {
            None => self.field.to_owned(),
            Some(item) => format!("{}[{item}]", self.field),
        }
    }

    pub(crate) fn is_same_as(&self, other: &Self) -> bool {
        let key = |live: &Self| (live.field, live.setting.item);
        self.path == other.path && key(self) == key(other)
    }
}

/// A field of a [`Settings`] struct, from its declaration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeclaredField {
    /// The name.
    pub name: &'static str,
    /// True if the setting can change while the graph runs.
    pub is_live: bool,
    /// True if the setting is the limit of an actuator sink.
    pub is_limit: bool,
}

/// The most numbers of a list that is a live setting. With more of them the setting is not live.
pub const MAX_LIVE_ITEMS: usize = 64;

/// A live number of a node whose kind is known at run time only: the place of the setting in the list of settings and, if it
/// is a list, that of the number in it. Programs that set values get it with a [`LiveSetting`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SettingId {
    index: usize,
    item: Option<usize>,
}

/// Handle of a live setting of the node kind `K`, by which [`Processor::set`](crate::node::Processor::set) gets its new
/// values.
///
/// It is looked up by name at compile time, and can be used in a pattern:
///
/// ```
/// use haptograph_engine::settings::LiveId;
/// # use haptograph_engine::node::*;
///
/// haptograph_engine::settings! {
///     /// Settings of `Smoother`.
///     pub struct SmootherSettings {
///         /// Where the response has fallen by 3 dB.
///         [live] cutoff_hz: f64 = 20.0;
///         /// Poles.
///         order: u32 = 2;
///     }
/// }
/// # struct Smoother;
/// # impl NodeKind for Smoother {
/// #     type Settings = SmootherSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "", group: "", doc: "", source: "", example: "", inputs: &[], outputs: &[] };
/// #     fn build(_: SmootherSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
///
/// const CUTOFF_HZ: LiveId<Smoother> = LiveId::named("cutoff_hz");
///
/// fn is_cutoff(setting: LiveId<Smoother>) -> bool {
///     matches!(setting, CUTOFF_HZ)
/// }
/// assert!(is_cutoff(CUTOFF_HZ));
/// ```
///
/// A setting that is not live does not compile:
///
/// ```compile_fail,E0080
/// # use haptograph_engine::{node::*, settings::LiveId};
/// # haptograph_engine::settings! {
/// #     /// Settings of a smoother.
/// #     pub struct SmootherSettings {
/// #         /// Where the response has fallen by 3 dB.
/// #         [live] cutoff_hz: f64 = 20.0;
/// #         /// Poles.
/// #         order: u32 = 2;
/// #     }
/// # }
/// # struct Smoother;
/// # impl NodeKind for Smoother {
/// #     type Settings = SmootherSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "", group: "", doc: "", source: "", example: "", inputs: &[], outputs: &[] };
/// #     fn build(_: SmootherSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const ORDER: LiveId<Smoother> = LiveId::named("order");
/// ```
///
/// Nor does a name that no setting has:
///
/// ```compile_fail,E0080
/// # use haptograph_engine::{node::*, settings::LiveId};
/// # haptograph_engine::settings! {
/// #     /// Settings of a smoother.
/// #     pub struct SmootherSettings {
/// #         /// Where the response has fallen by 3 dB.
/// #         [live] cutoff_hz: f64 = 20.0;
/// #         /// Poles.
/// #         order: u32 = 2;
/// #     }
/// # }
/// # struct Smoother;
/// # impl NodeKind for Smoother {
/// #     type Settings = SmootherSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "", group: "", doc: "", source: "", example: "", inputs: &[], outputs: &[] };
/// #     fn build(_: SmootherSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const CUTOFF_HZ: LiveId<Smoother> = LiveId::named("cutof_hz");
/// ```
///
/// Nor does a setting of another node:
///
/// ```compile_fail,E0308
/// # use haptograph_engine::{node::*, settings::LiveId};
/// # haptograph_engine::settings! {
/// #     /// Settings of a smoother.
/// #     pub struct SmootherSettings {
/// #         /// Where the response has fallen by 3 dB.
/// #         [live] cutoff_hz: f64 = 20.0;
/// #         /// Poles.
/// #         order: u32 = 2;
/// #     }
/// # }
/// # struct Smoother;
/// # impl NodeKind for Smoother {
/// #     type Settings = SmootherSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "", group: "", doc: "", source: "", example: "", inputs: &[], outputs: &[] };
/// #     fn build(_: SmootherSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// # enum Other {}
/// const CUTOFF_HZ: LiveId<Smoother> = LiveId::named("cutoff_hz");
///
/// fn is_cutoff(setting: LiveId<Other>) -> bool {
///     setting == CUTOFF_HZ
/// }
/// ```
pub type LiveId<K> = TypedId<fn() -> K>;

/// The type of a [`LiveId`]. A parameter that is a pointer to a function lets it stand in patterns, whatever the kind.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct TypedId<T> {
    index: usize,
    kind: PhantomData<T>,
}

impl<T> std::fmt::Debug for TypedId<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "LiveId({})", self.index)
    }
}

impl<K: NodeKind> LiveId<K> {
    /// The handle of the live setting `name` of `K`. In a constant a wrong name is a compile error.
    ///
    /// # Panics
    /// If no setting has this name, or the setting is not live.
    pub const fn named(name: &str) -> Self {
        Self { index: SettingId::of::<K::Settings>(name).index, kind: PhantomData }
    }
}

impl<K> LiveId<K> {
    /// One number of the setting, which is a list.
    pub const fn item(self, item: usize) -> SettingId {
        SettingId { index: self.index, item: Some(item) }
    }
}

impl<K> LiveId<K> {
    /// The handle of a setting of the list of `K`.
    pub(crate) const fn at(setting: SettingId) -> Self {
        Self { index: setting.index, kind: PhantomData }
    }
}

impl<K> From<LiveId<K>> for SettingId {
    fn from(setting: LiveId<K>) -> Self {
        Self::at(setting.index)
    }
}

impl SettingId {
    /// The handle of the live setting `name` of `S`. In a constant a wrong name is a compile error.
    ///
    /// # Panics
    /// If no setting has this name, or the setting is not live.
    pub(crate) const fn of<S: Settings>(name: &str) -> Self {
        let mut index = 0;
        while index < S::FIELDS.len() {
            let field = S::FIELDS[index];
            if same(field.name, name) {
                assert!(field.is_live, "this setting is not live: its declaration needs `[live]`");
                return Self::at(index);
            }
            index += 1;
        }
        panic!("no setting has this name")
    }

    /// The setting with this index in the list of settings.
    pub(crate) const fn at(index: usize) -> Self {
        Self { index, item: None }
    }

    /// This number of the setting, which is a list.
    #[must_use]
    pub const fn with_item(self, item: usize) -> Self {
        Self { item: Some(item), ..self }
    }

    /// Index in the list of settings.
    pub(crate) const fn index(self) -> usize {
        self.index
    }

    /// Place in the list, if the setting is one.
    pub const fn item(self) -> Option<usize> {
        self.item
    }
}

/// True if two names are equal, in constants too.
pub(crate) const fn same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    if one.len() != other.len() {
        return false;
    }
    let mut at = 0;
    while at < one.len() {
        if one[at] != other[at] {
            return false;
        }
        at += 1;
    }
    true
}

/// True if one of the fields is the limit of an actuator sink, in constants too.
pub(crate) const fn has_limit(fields: &[DeclaredField]) -> bool {
    let mut at = 0;
    while at < fields.len() {
        if fields[at].is_limit {
            return true;
        }
        at += 1;
    }
    false
}

/// Number of live fields, in constants too.
pub(crate) const fn count_live(fields: &[DeclaredField]) -> usize {
    let (mut at, mut live) = (0, 0);
    while at < fields.len() {
        live += fields[at].is_live as usize;
        at += 1;
    }
    live
}

/// True if any of the flags is set, in constants too. For [`settings!`](crate::settings!).
#[doc(hidden)]
pub const fn any(flags: &[bool]) -> bool {
    let mut at = 0;
    while at < flags.len() {
        if flags[at] {
            return true;
        }
        at += 1;
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    crate::settings! {
        /// Three of them, the second of which is not live.
        struct Toy {
            /// The first.
            [live] low: f64 = 0.0;
            /// Not live.
            order: u32 = 2;
            /// The last.
            [live, below_nyquist] high: f64 = 1.0;
        }
    }

    #[test]
    fn a_live_setting_is_found_by_its_name() {
        const LOW: SettingId = SettingId::of::<Toy>("low");
        const HIGH: SettingId = SettingId::of::<Toy>("high");
        assert_eq!((LOW.index(), HIGH.index()), (0, 2));
        assert_eq!(count_live(Toy::FIELDS), 2);
        let names: Vec<&str> = Toy::specs().iter().map(|spec| spec.name).collect();
        assert_eq!(names, Toy::FIELDS.iter().map(|field| field.name).collect::<Vec<_>>());
        let lives: Vec<bool> = Toy::specs().iter().map(|spec| spec.live).collect();
        assert_eq!(lives, Toy::FIELDS.iter().map(|field| field.is_live).collect::<Vec<_>>());
    }

    #[test]
    #[should_panic(expected = "not live")]
    fn what_is_not_live_has_no_handle() {
        let _ = SettingId::of::<Toy>("order");
    }

    #[test]
    #[should_panic(expected = "no setting has this name")]
    fn a_wrong_name_has_no_handle() {
        let _ = SettingId::of::<Toy>("lo");
    }
}
