//! The `haptograph` command.
fn main() {}
