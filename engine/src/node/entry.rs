//! Registered node kinds, their types erased.

use super::{
    ActuatorKind, AnyProcessor, BuildContext, BuildError, Declared, FileContext, FileKind, FileSink, Limit,
    NodeKind, NodeSpec, ScriptedKind,
};
use crate::scripted;
use crate::settings::{
    Fields, Flag, Reading, SettingId, SettingRole, SettingSpec, Settings, check_at, count,
};
use std::borrow::Cow;

/// A registered node kind, its types erased.
#[derive(Clone, Copy)]
pub struct NodeEntry {
    /// Ports and documentation.
    pub spec: &'static NodeSpec,
    settings: fn() -> &'static [SettingSpec],
    pub(crate) build: Build,
    /// The members of the family of outputs, if there is one.
    members: Option<Members>,
}

/// Takes the settings and names the members of a family of outputs; `None` after a reported error of a setting.
type Members = fn(&mut Fields, &mut Reading<'_>) -> Option<Result<Vec<String>, BuildError>>;

/// How a registered node is built from its fields. Each variant reports errors and returns `None`.
#[derive(Clone, Copy)]
pub(crate) enum Build {
    Processor(Read<BuildContext, Measured>),
    Actuator(Read<(), (f64, Limit)>),
    File(Read<FileContext, Box<dyn FileSink>>),
    /// Reads a device; its outputs are the device's channels of the same names. The function reads its settings.
    Source(fn(&mut Fields, &mut Reading<'_>) -> bool),
    /// Processes, and is described while the program runs.
    Scripted(&'static dyn ScriptedKind),
}

impl Build {
    /// The first half of building what processes; nothing of other nodes.
    pub(crate) fn read_processor(
        self,
        fields: &mut Fields,
        reading: &mut Reading<'_>,
    ) -> Option<Finish<BuildContext, Measured>> {
        match self {
            Self::Processor(read) => read(fields, reading),
            Self::Scripted(kind) => scripted::read(kind, fields, reading),
            _ => None,
        }
    }
}

/// The first half of building: fields to settings.
pub(crate) type Read<Context, T> = fn(&mut Fields, &mut Reading<'_>) -> Option<Finish<Context, T>>;

/// Memory of a processor, bytes ([`NodeKind::memory_bytes`]), and the function that builds it.
pub(crate) type Measured = (u64, Finish<BuildContext, Advised>);

/// A processor and the warnings about its settings.
pub(crate) type Advised = (Box<dyn AnyProcessor>, Vec<BuildError>);

/// The second half of building, after clock and connections are known.
pub(crate) type Finish<Context, T> = Box<dyn FnOnce(&Context) -> Result<T, BuildError>>;

/// Builds a processor, once its settings fit the rate.
pub(crate) fn build<K: NodeKind>(
    settings: K::Settings,
    cx: &BuildContext,
) -> Result<Box<dyn AnyProcessor>, BuildError> {
    check_at(&settings, cx.rate.hz())?;
    Ok(K::build(settings, cx)?.into_processor())
}

impl NodeEntry {
    /// Erases the types of a node that processes.
    pub fn processor<K: NodeKind>() -> Self {
        let family = const { K::SPEC.family() };
        let members: Members = |fields, reading| Some(K::members(&K::Settings::take_from(fields, reading)?));
        Self {
            spec: &const { K::SPEC },
            settings: K::Settings::specs,
            members: family.map(|_| members),
            build: Build::Processor(|fields, reading| {
                let settings = K::Settings::take_from(fields, reading)?;
                Some(Box::new(|cx| {
                    let bytes = K::memory_bytes(&settings, cx);
                    let finish: Finish<BuildContext, Advised> = Box::new(|cx| {
                        let advice = K::advice(&settings, cx);
                        Ok((build::<K>(settings, cx)?, advice))
                    });
                    Ok((bytes, finish))
                }))
            }),
        }
    }

    /// A node that processes and is described while the program runs. It is slow, and no live run takes it.
    pub fn scripted(kind: &'static dyn ScriptedKind) -> Self {
        Self {
            spec: without_family(kind.spec()),
            settings: || &[],
            build: Build::Scripted(kind),
            members: None,
        }
    }

    /// Erases the types of a sink that drives a device through the engine's limiter. Its settings have one that is
    /// marked `[limit]`; without it, this does not compile.
    pub fn actuator<K: ActuatorKind>() -> Self {
        const {
            assert!(
                count(K::Settings::FIELDS, Flag::limit) > 0,
                "an actuator sink has a setting that is marked `[limit]`"
            );
        }
        const { without_family(&K::SPEC) };
        Self {
            spec: &const { K::SPEC },
            settings: K::Settings::specs,
            build: Build::Actuator(|fields, reading| {
                let settings = K::Settings::take_from(fields, reading)?;
                Some(Box::new(move |()| K::limit(&settings)))
            }),
            members: None,
        }
    }

    /// Erases the types of a sink that writes a file.
    pub fn file<K: FileKind>() -> Self {
        const { without_family(&K::SPEC) };
        Self {
            spec: &const { K::SPEC },
            settings: K::Settings::specs,
            build: Build::File(|fields, reading| {
                let settings = K::Settings::take_from(fields, reading)?;
                Some(Box::new(|cx| K::build(settings, cx)))
            }),
            members: None,
        }
    }

    /// Erases the types of a source that reads a device.
    pub fn source<K: Declared>() -> Self {
        Self {
            spec: const { without_family(&K::SPEC) },
            settings: K::Settings::specs,
            build: Build::Source(|fields, reading| K::Settings::take_from(fields, reading).is_some()),
            members: None,
        }
    }

    /// The names of the members of its family of outputs, none without a family; `None` if a setting cannot be read.
    pub(crate) fn members(
        &self,
        fields: &Fields,
        reading: &mut Reading<'_>,
    ) -> Option<Result<Vec<String>, BuildError>> {
        match self.members {
            Some(members) => members(&mut fields.clone(), reading),
            None => Some(Ok(Vec::new())),
        }
    }

    /// Its settings.
    pub fn settings(&self) -> Vec<SettingSpec> {
        self.specs().into_owned()
    }

    /// The same without a copy, as far as it is known before the program runs.
    pub(crate) fn specs(&self) -> Cow<'static, [SettingSpec]> {
        match self.build {
            Build::Scripted(kind) => kind.settings().into(),
            _ => (self.settings)().into(),
        }
    }

    /// Its setting of a role.
    pub fn setting_for(&self, role: SettingRole) -> Option<SettingSpec> {
        self.specs().iter().find(|spec| spec.role == role).cloned()
    }

    /// Its live settings, with the handles that [`Processor::set`](super::Processor::set) takes.
    pub fn live_settings(&self) -> impl Iterator<Item = (SettingId, SettingSpec)> {
        let settings = self.settings().into_iter().enumerate();
        settings.filter(|(_, spec)| spec.live).map(|(index, spec)| (SettingId::at(index), spec))
    }

    /// True if the kind is described while the program runs; its nodes run offline only.
    pub(crate) fn is_scripted(&self) -> bool {
        matches!(self.build, Build::Scripted(_))
    }

    /// True if an `endpoint` field binds the node to a device.
    pub fn has_endpoint(&self) -> bool {
        matches!(self.build, Build::Actuator(_) | Build::Source(_))
    }

    /// True if the node is an actuator sink.
    pub fn is_actuator(&self) -> bool {
        matches!(self.build, Build::Actuator(_))
    }

    /// True if the node is a file sink. A file sink has no clock.
    pub fn is_file(&self) -> bool {
        matches!(self.build, Build::File(_))
    }
}

/// Only what processes has a family of outputs.
const fn without_family(spec: &'static NodeSpec) -> &'static NodeSpec {
    assert!(spec.family().is_none(), "only a node that processes has a family of outputs");
    spec
}

impl std::fmt::Debug for NodeEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "NodeEntry({})", self.spec.name)
    }
}
