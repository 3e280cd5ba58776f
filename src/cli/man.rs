//! `haptograph man`: the manual, made of what `--help` says.

use super::output::{Force, Output};
use super::{Failure, program, say};
use crate::engine::registry::Registry;
use std::fs;
use std::path::PathBuf;

/// Print the manual page of a command, or write all of them
///
/// `haptograph man run | man -l -` shows one.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The command; where it is not given, the page is that of haptograph itself
    command: Option<String>,
    /// Write the pages of all commands into this folder, as haptograph-COMMAND.1
    #[arg(long, value_name = "DIR", conflicts_with = "command")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

pub fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let mut all = program();
    all.build();
    match (&arguments.out, &arguments.command) {
        (Some(folder), _) => {
            fs::create_dir_all(folder).map_err(|error| Failure::file("make the folder", folder, &error))?;
            let commands = all
                .get_subcommands()
                .filter(|command| command.get_name() != "help");
            for command in commands.chain([&all]) {
                let name = page_name(command);
                let output = Output::claim(&folder.join(format!("{name}.1")), arguments.force)?;
                output.write(&page(command)?)?;
            }
            Ok(())
        }
        (None, None) => say(&page(&all)?),
        (None, Some(name)) => match all.find_subcommand(name) {
            Some(command) => say(&page(command)?),
            None => Err(Failure::Message(format!(
                "there is no command `{name}`; `haptograph --help` lists them"
            ))),
        },
    }
}

/// `haptograph-run`; of haptograph itself its name alone.
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
