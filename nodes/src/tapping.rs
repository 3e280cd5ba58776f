//! Tapping (4.3.2): detection of a tap with its speed, and the recorded transient for that speed.

pub mod node;
pub mod onset;
pub mod transient;
