//! Simulated bodies: hands, tools, devices and objects that run where no hardware is. Whatever comes from here is
//! labelled simulated wherever it is shown.

pub mod drawing;
pub mod force_sensor;
pub mod ground;
pub mod hand;
pub mod haptuator;
pub mod knock;
pub mod omni;
pub mod pen_brake;
pub mod pen_object;
pub mod script;
pub mod stroke;
pub mod tablet;
pub mod tablet_node;
pub mod wobble;
