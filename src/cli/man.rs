//! `haptograph man`: manual pages generated from the help texts.

use super::placing::{Force, Output};
use super::{Failure, make_folder, print, program};
use crate::engine::registry::Registry;
use crate::engine::settings::closest;
use std::path::PathBuf;

/// Print the manual page of a command, or write all of them
///
/// `haptograph man run | man -l -` displays one page, `haptograph man surface show` prints that of a nested
/// command.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The command, and a nested command; default: the page of haptograph itself
    command: Vec<String>,
    /// Write the pages of all commands into this folder, as haptograph-COMMAND.1
    #[arg(long, value_name = "DIR", conflicts_with = "command")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let mut all = program();
    all.build();
    match &arguments.out {
        Some(folder) => {
            make_folder(folder)?;
            for command in with_inner(&all) {
                let name = page_name(command);
                let output = Output::claim(&folder.join(format!("{name}.1")), arguments.force)?;
                output.write(&page(command)?)?;
            }
            Ok(())
        }
        None => print(&page(find(&all, &arguments.command)?)?),
    }
}

/// The command reached by a path of names.
fn find<'c>(all: &'c clap::Command, names: &[String]) -> Result<&'c clap::Command, Failure> {
    names.iter().try_fold(all, |outer, name| {
        outer.find_subcommand(name).ok_or_else(|| {
            let known: Vec<&str> = without_help(outer).map(clap::Command::get_name).collect();
            let command = outer.get_bin_name().unwrap_or_else(|| outer.get_name());
            let help = match (closest(name, known.iter().copied()), known.is_empty()) {
                (Some(near), _) => format!("did you mean `{near}`?"),
                (None, false) => format!("there are {}", known.join(", ")),
                (None, true) => "it has no nested commands".to_owned(),
            };
            Failure::Message(format!("`{command}` has no command `{name}`; {help}"))
        })
    })
}

fn without_help(command: &clap::Command) -> impl Iterator<Item = &clap::Command> {
    command.get_subcommands().filter(|inner| inner.get_name() != "help")
}

/// A command and all nested commands.
fn with_inner(command: &clap::Command) -> Vec<&clap::Command> {
    let inner = without_help(command).flat_map(with_inner);
    std::iter::once(command).chain(inner).collect()
}

/// `haptograph-run`; `haptograph` for the program itself.
fn page_name(command: &clap::Command) -> &str {
    command.get_display_name().unwrap_or_else(|| command.get_name())
}

fn page(command: &clap::Command) -> Result<String, Failure> {
    let mut text = Vec::new();
    clap_mangen::Man::new(command.clone())
        .render(&mut text)
        .map_err(|error| Failure::Message(format!("cannot write the manual: {error}")))?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}
