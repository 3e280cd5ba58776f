//! Nodes whose kinds are defined at run time, such as classes of a scripting language.
//!
//! They are registered like all node kinds. Their processors may allocate, lock and take any time, so live runs refuse
//! them: they are for offline prototypes.

use crate::node::{Advised, BuildContext, BuildError, Built, Declared, Finish, Measured, NodeSpec};
use crate::settings::{Fields, NoSettings, Reading, SettingSpec};

/// A kind of node whose ports and settings are known only when the program runs.
///
/// The type is registered by [`NodeEntry::scripted`](crate::node::NodeEntry::scripted), and lives as long as the
/// program.
pub trait ScriptedKind: Send + Sync + 'static {
    /// Ports and documentation.
    fn spec(&'static self) -> &'static NodeSpec;
    /// The settings, in the order of declaration; none of them is live.
    fn settings(&self) -> Vec<SettingSpec>;
    /// Takes its settings out of `fields` and returns the function that builds the processor. On `None` at least one
    /// diagnostic was reported.
    fn read(&'static self, fields: &mut Fields, reading: &mut Reading<'_>) -> Option<ScriptBuild>;
}

/// Stands for all scripted kinds in the types of processors and handles, as every other kind stands for itself: a scripted
/// node is a `Processor<Scripted>`, and finds the handles of its ports in [`NodeSpec::any_inputs`] and
/// [`NodeSpec::any_outputs`].
#[derive(Debug, Clone, Copy)]
pub enum Scripted {}

/// Every scripted kind has its own declaration, in values.
impl Declared for Scripted {
    type Settings = NoSettings;
    const SPEC: NodeSpec =
        NodeSpec { name: "", group: "", doc: "", source: "", inputs: &[], outputs: &[], example: "" };
}

/// Builds the processor of a scripted node when its clock and connections are known.
pub type ScriptBuild = Box<dyn FnOnce(&BuildContext) -> Result<Built<Scripted>, BuildError>>;

/// A graph with a scripted node was to run live.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{node}` is a `{kind}`, which is a script: scripts are not real-time safe and run offline only")]
pub struct OfflineOnly {
    /// Path of the node.
    pub node: String,
    /// The kind.
    pub kind: &'static str,
}

/// The first half of building, as of any node that processes.
pub(crate) fn read(
    kind: &'static dyn ScriptedKind,
    fields: &mut Fields,
    reading: &mut Reading<'_>,
) -> Option<Finish<BuildContext, Measured>> {
    let build = kind.read(fields, reading)?;
    let name = kind.spec().name;
    Some(Box::new(move |_| {
        let finish: Finish<BuildContext, Advised> = Box::new(move |cx| {
            let slow = BuildError::of_node(format!("`{name}` is a script: it is slow and runs offline only"));
            Ok((build(cx)?.into_processor(), vec![slow]))
        });
        Ok((0, finish))
    }))
}
