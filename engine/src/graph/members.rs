//! The names of the outputs that the settings of a node name.

use super::context::Context;
use super::findings::Places;
use super::given::refused_port_name;
use crate::diagnostic::Diagnostic;
use crate::document::value::{Name, Shape};
use crate::node::{MAX_MEMBERS, NodeEntry, NodeSpec, OutputCount};
use crate::settings::Fields;

/// The members of a node's family of outputs, and true if an error of them was reported. No members if a setting cannot be
/// read, which is reported when the node is built.
pub(super) fn of(cx: &mut Context<'_>, entry: &NodeEntry, fields: &Fields) -> (Option<Vec<String>>, bool) {
    let spec = entry.spec;
    let Some(OutputCount::NamedBy(setting)) = spec.outputs.last().map(|port| port.count) else {
        return (Some(Vec::new()), false);
    };
    // They are read again when the node is built, which reports their errors.
    let (errors, files) = (cx.diagnostics.len(), cx.files.len());
    let members = cx.reading(|reading| entry.members(fields, reading));
    cx.diagnostics.truncate(errors);
    cx.files.truncate(files);
    let Some(members) = members else {
        return (None, false);
    };
    let members = Places::of(fields).or_report(cx, members);
    let named = members.filter(|members| !refuse(cx, spec, setting, fields, members));
    let broken = named.is_none();
    (named, broken)
}

/// Reports names that outputs cannot have; true if there is one.
fn refuse(
    cx: &mut Context<'_>,
    spec: &NodeSpec,
    setting: &'static str,
    fields: &Fields,
    members: &[String],
) -> bool {
    let written = fields.given(setting);
    let all = written.map_or(fields.span, |value| value.span);
    if members.len() > MAX_MEMBERS {
        let message =
            format!("a node has at most {MAX_MEMBERS} outputs of `{setting}`, found {}", members.len());
        cx.report(Diagnostic::error("E0415", all, message).help("divide it into several nodes"));
        return true;
    }
    let before = cx.diagnostics.len();
    let family = spec.family().unwrap_or(spec.outputs.len());
    for (place, text) in members.iter().enumerate() {
        let span = match written.map(|value| &value.shape) {
            Some(Shape::List(names)) => names.get(place).map_or(all, |name| name.span),
            _ => all,
        };
        let name = Name { span, text: text.clone() };
        let is_known =
            members[..place].contains(text) || spec.outputs[..family].iter().any(|port| port.name == *text);
        let refused = match is_known {
            true => Some(doubled(&name)),
            false => refused_port_name(&name, "output"),
        };
        refused.into_iter().for_each(|refused| cx.report(refused));
    }
    cx.diagnostics.len() > before
}

fn doubled(name: &Name) -> Diagnostic {
    let message = format!("there are two outputs `{}`", name.text);
    Diagnostic::error("E0105", name.span, message)
        .label("named again here")
        .help("give each output of the node a name of its own")
}
