//! What is known of the hand from what the sensors say.

pub mod contact_speed;
pub mod speed;
pub mod speed_node;
pub mod study;
