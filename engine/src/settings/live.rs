//! Live settings: their handles, and how these are looked up.

use super::{Flag, Settings};
use crate::node_id::NodeId;
use std::borrow::Cow;
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
    /// Symbol of that unit; empty if there is none.
    pub unit: Cow<'static, str>,
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

    /// True if it is the setting of that name, though perhaps in another graph. Real-time safe.
    pub fn is_same_as(&self, other: &Self) -> bool {
        let key = |live: &Self| (live.field, live.setting.item);
        self.path == other.path && key(self) == key(other)
    }
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

/// Handle of a live setting of the settings `S`, by which [`Processor::set`](crate::node::Processor::set) gets its new values.
///
/// [`settings!`](crate::settings!) declares it as a constant with the name of the field, which can be used in a pattern:
///
/// ```
/// use haptograph_engine::settings::LiveId;
///
/// haptograph_engine::settings! {
///     /// Settings of a smoother.
///     pub struct SmootherSettings {
///         /// Where the response has fallen by 3 dB.
///         [live] cutoff_hz: f64 = 20.0;
///         /// Poles.
///         order: u32 = 2;
///     }
/// }
///
/// fn is_cutoff(setting: LiveId<SmootherSettings>) -> bool {
///     matches!(setting, SmootherSettings::cutoff_hz)
/// }
/// assert!(is_cutoff(SmootherSettings::cutoff_hz));
/// ```
///
/// A setting that is not live has no handle:
///
/// ```compile_fail,E0599
/// # use haptograph_engine::settings::LiveId;
/// # haptograph_engine::settings! {
/// #     /// Settings of a smoother.
/// #     pub struct SmootherSettings {
/// #         /// Where the response has fallen by 3 dB.
/// #         [live] cutoff_hz: f64 = 20.0;
/// #         /// Poles.
/// #         order: u32 = 2;
/// #     }
/// # }
/// fn is_order(setting: LiveId<SmootherSettings>) -> bool {
///     setting == SmootherSettings::order
/// }
/// ```
///
/// Nor does a name that no setting has:
///
/// ```compile_fail,E0599
/// # use haptograph_engine::settings::LiveId;
/// # haptograph_engine::settings! {
/// #     /// Settings of a smoother.
/// #     pub struct SmootherSettings {
/// #         /// Where the response has fallen by 3 dB.
/// #         [live] cutoff_hz: f64 = 20.0;
/// #         /// Poles.
/// #         order: u32 = 2;
/// #     }
/// # }
/// fn is_cutoff(setting: LiveId<SmootherSettings>) -> bool {
///     setting == SmootherSettings::cutof_hz
/// }
/// ```
///
/// A setting of other settings does not compile:
///
/// ```compile_fail,E0308
/// # use haptograph_engine::settings::LiveId;
/// # haptograph_engine::settings! {
/// #     /// Settings of a smoother.
/// #     pub struct SmootherSettings {
/// #         /// Where the response has fallen by 3 dB.
/// #         [live] cutoff_hz: f64 = 20.0;
/// #         /// Poles.
/// #         order: u32 = 2;
/// #     }
/// # }
/// # haptograph_engine::settings! { /** Others. */ pub struct OtherSettings {} }
/// fn is_cutoff(setting: LiveId<OtherSettings>) -> bool {
///     setting == SmootherSettings::cutoff_hz
/// }
/// ```
pub type LiveId<S> = TypedId<fn() -> S>;

/// The type of a [`LiveId`]. A parameter that is a pointer to a function lets it stand in patterns, whatever the settings.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct TypedId<T> {
    index: usize,
    settings: PhantomData<T>,
}

impl<T> std::fmt::Debug for TypedId<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "LiveId({})", self.index)
    }
}

impl<S: Settings> LiveId<S> {
    /// The handle of the live setting of this name, for a program whose settings these are not. In a constant a wrong name is
    /// a compile error.
    ///
    /// # Panics
    /// If no setting has this name, or the setting is not live.
    pub const fn named(name: &str) -> Self {
        let mut index = 0;
        while index < S::FIELDS.len() {
            if same(S::FIELDS[index].name, name) {
                assert!(
                    S::FIELDS[index].is(Flag::live),
                    "this setting is not live: its declaration needs `[live]`"
                );
                return Self { index, settings: PhantomData };
            }
            index += 1;
        }
        panic!("no setting has this name")
    }

    /// Name in graph files.
    pub fn name(self) -> &'static str {
        S::FIELDS.get(self.index).map_or("", |field| field.name)
    }
}

impl<S> LiveId<S> {
    /// One number of the setting, which is a list.
    pub const fn item(self, item: usize) -> SettingId {
        SettingId { index: self.index, item: Some(item) }
    }

    /// The handle of a setting of the list of `S`.
    pub(crate) const fn at(setting: SettingId) -> Self {
        Self { index: setting.index, settings: PhantomData }
    }
}

impl<S> From<LiveId<S>> for SettingId {
    fn from(setting: LiveId<S>) -> Self {
        Self::at(setting.index)
    }
}

impl SettingId {
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
    fn a_live_setting_has_the_place_of_its_declaration() {
        assert_eq!((Toy::low.index, Toy::high.index), (0, 2));
        assert_eq!((Toy::low.name(), Toy::high.name()), ("low", "high"));
        assert_eq!(crate::settings::count(Toy::FIELDS, Flag::live), 2);
        let specs = Toy::specs();
        assert_eq!(specs.iter().map(|spec| spec.name).collect::<Vec<_>>(), ["low", "order", "high"]);
        assert_eq!(specs.iter().map(|spec| spec.live).collect::<Vec<_>>(), [true, false, true]);
    }

    #[test]
    #[should_panic(expected = "not live")]
    fn what_is_not_live_has_no_handle() {
        let _ = LiveId::<Toy>::named("order");
    }

    #[test]
    #[should_panic(expected = "no setting has this name")]
    fn a_wrong_name_has_no_handle() {
        let _ = LiveId::<Toy>::named("lo");
    }
}
