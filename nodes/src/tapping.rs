//! Tapping (4.3.2): detection of a tap with its speed, and the recorded transient for that speed.

pub(crate) mod node;
pub(crate) mod onset;
pub(crate) mod transient;
