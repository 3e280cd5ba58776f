//! Tapping (4.3.2): the moment of contact with its speed, and the transient that a tap of that speed leaves.

pub mod node;
pub mod onset;
pub mod transient;
