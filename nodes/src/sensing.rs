//! What is known of the hand from what the sensors say.

pub mod speed;
pub mod speed_node;
