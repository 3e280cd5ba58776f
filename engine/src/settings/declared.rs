//! The declaration of a field of settings, and what is done with each field.

use super::{Fields, Reading, Setting, SettingRole, SettingSpec, same};

/// A field of [`Settings`](super::Settings), from its declaration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeclaredField {
    /// The name.
    pub name: &'static str,
    /// Description, from the doc comment.
    pub doc: &'static str,
    /// Smallest and largest value, of each number of a list.
    pub range: Option<(f64, f64)>,
    /// The flags.
    pub flags: &'static [Flag],
}

/// A flag of a setting, written in brackets before its name in [`settings!`](crate::settings!).
#[expect(non_camel_case_types, reason = "written as in the declaration")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flag {
    /// The setting can change while the graph runs.
    live,
    /// It has to stay below half the rate of its node, in the file and when it changes.
    below_nyquist,
    /// It is the limit of an actuator sink, which a remote edit must not raise.
    limit,
    /// It is the file in the run's folder that a sink writes.
    output_file,
}

impl DeclaredField {
    /// True if it has this flag, in constants too.
    pub const fn is(&self, flag: Flag) -> bool {
        let mut at = 0;
        while at < self.flags.len() {
            if self.flags[at] as u8 == flag as u8 {
                return true;
            }
            at += 1;
        }
        false
    }

    const fn role(&self) -> SettingRole {
        match (self.is(Flag::limit), self.is(Flag::output_file)) {
            (true, _) => SettingRole::Limit,
            (_, true) => SettingRole::OutputFile,
            _ => SettingRole::Plain,
        }
    }
}

/// The number of fields with this flag, in constants too.
pub(crate) const fn count(fields: &[DeclaredField], flag: Flag) -> usize {
    let (mut at, mut count) = (0, 0);
    while at < fields.len() {
        count += fields[at].is(flag) as usize;
        at += 1;
    }
    count
}

/// The field of this name. For [`settings!`](crate::settings!).
#[doc(hidden)]
pub const fn declared(fields: &'static [DeclaredField], name: &str) -> &'static DeclaredField {
    let mut at = 0;
    while !same(fields[at].name, name) {
        at += 1;
    }
    &fields[at]
}

/// What is done with each field of settings.
pub trait EachField {
    /// Visits a field of the type `T`; gives its value, if there is one.
    fn field<T: Setting>(&mut self, declared: &'static DeclaredField, default: Option<T>) -> Option<T>;
}

/// Lists the specifications of the fields.
#[derive(Default)]
pub(crate) struct Specs(pub Vec<SettingSpec>);

impl EachField for Specs {
    fn field<T: Setting>(&mut self, declared: &'static DeclaredField, default: Option<T>) -> Option<T> {
        let DeclaredField { name, doc, range, .. } = *declared;
        self.0.push(SettingSpec {
            live: declared.is(Flag::live),
            below_nyquist: declared.is(Flag::below_nyquist),
            role: declared.role(),
            ..SettingSpec::new(name, doc.to_owned(), default.as_ref(), range)
        });
        None
    }
}

/// Takes the fields out of those that a graph file gives.
pub(crate) struct Take<'a, 'b> {
    pub fields: &'a mut Fields,
    pub reading: &'a mut Reading<'b>,
}

impl EachField for Take<'_, '_> {
    fn field<T: Setting>(&mut self, declared: &'static DeclaredField, default: Option<T>) -> Option<T> {
        self.fields.setting(declared.name, default, declared.range, self.reading)
    }
}
