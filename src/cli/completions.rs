//! `haptograph completions`: completion scripts for shells.

use super::{Failure, print, program};
use crate::engine::registry::Registry;
use clap_complete::Shell;

/// Print completions for a shell
///
/// bash: `haptograph completions bash > ~/.local/share/bash-completion/completions/haptograph`; zsh:
/// `haptograph completions zsh > FOLDER/_haptograph`, where FOLDER is in `$fpath`; fish: `haptograph
/// completions fish > ~/.config/fish/completions/haptograph.fish`.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The shell
    shell: Shell,
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut program(), "haptograph", &mut text);
    print(&String::from_utf8_lossy(&text))
}
