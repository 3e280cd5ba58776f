//! Speed of the tool, and measures of studies, from sensor signals.

pub(crate) mod contact_speed;
pub(crate) mod speed;
pub(crate) mod speed_node;
pub(crate) mod study;
