//! Speed of the tool, and measures of studies, from sensor signals.

pub mod contact_speed;
pub mod speed;
pub mod speed_node;
pub mod study;
