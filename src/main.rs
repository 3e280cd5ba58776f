//! The `haptograph` command: one file a sub-command under `command/`.

mod command;

use std::process::ExitCode;

fn main() -> ExitCode {
    command::main()
}
