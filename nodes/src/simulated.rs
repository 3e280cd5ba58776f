//! Simulated bodies: hands, tools, devices and objects that run where no hardware is. Whatever comes from here is
//! labelled simulated wherever it is shown.

pub mod stroke;
pub mod tablet;
pub mod wobble;
