//! Simulated bodies: hands, tools, devices and objects that run where no hardware is. Whatever comes from here is
//! labelled simulated wherever it is shown.

pub mod drawing;
pub mod ground;
pub mod hand;
pub mod haptuator;
pub mod script;
pub mod stroke;
pub mod tablet;
pub mod tablet_node;
pub mod wobble;
