//! The `haptograph` command with the built-in kinds of nodes and devices.

use std::process::ExitCode;

fn main() -> ExitCode {
    haptograph::cli::main(&haptograph::nodes::registry())
}
