//! Settings of nodes in Python, declared by a class and read from a graph like those of all nodes.

use haptograph::engine::settings::{Fields, Reading, Setting, SettingSpec};
use pyo3::prelude::*;

/// A value of a setting. Types are tried in this order, because a Python bool is an int, and an int a float.
#[derive(Debug, Clone, FromPyObject, IntoPyObject)]
pub(super) enum Value {
    Flag(bool),
    Whole(u64),
    Number(f64),
    Text(String),
    Numbers(Vec<f64>),
}

/// Name, value, whether a graph has to give it, range, documentation.
pub(super) type GivenSetting = (String, Value, bool, Option<(f64, f64)>, String);

/// A setting as a class declares it.
pub(super) struct Declared {
    pub name: &'static str,
    /// The default, or any value of the type.
    value: Value,
    is_required: bool,
    range: Option<(f64, f64)>,
    doc: String,
}

impl Declared {
    pub(super) fn of((name, value, is_required, range, doc): GivenSetting) -> Self {
        Self { name: name.leak(), value, is_required, range, doc }
    }

    pub(super) fn spec(&self) -> SettingSpec {
        match &self.value {
            Value::Flag(value) => self.spec_of(value),
            Value::Whole(value) => self.spec_of(value),
            Value::Number(value) => self.spec_of(value),
            Value::Text(value) => self.spec_of(value),
            Value::Numbers(value) => self.spec_of(value),
        }
    }

    fn spec_of<T: Setting>(&self, value: &T) -> SettingSpec {
        let default = Some(value).filter(|_| !self.is_required);
        SettingSpec::new(self.name, self.doc.clone(), default, self.range)
    }

    /// Takes the setting out of the fields of a node.
    pub(super) fn take(&self, fields: &mut Fields, reading: &mut Reading<'_>) -> Option<Value> {
        match &self.value {
            Value::Flag(value) => self.take_as(value, fields, reading).map(Value::Flag),
            Value::Whole(value) => self.take_as(value, fields, reading).map(Value::Whole),
            Value::Number(value) => self.take_as(value, fields, reading).map(Value::Number),
            Value::Text(value) => self.take_as(value, fields, reading).map(Value::Text),
            Value::Numbers(value) => self.take_as(value, fields, reading).map(Value::Numbers),
        }
    }

    fn take_as<T: Setting + Clone>(
        &self,
        value: &T,
        fields: &mut Fields,
        reading: &mut Reading<'_>,
    ) -> Option<T> {
        let default = (!self.is_required).then(|| value.clone());
        fields.setting(self.name, default, self.range, reading)
    }
}
