//! The `haptograph` command with the kinds of nodes and devices that come with it.

use std::process::ExitCode;

fn main() -> ExitCode {
    haptograph::cli::main(&haptograph::nodes::registry())
}
