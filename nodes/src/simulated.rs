//! Simulated hands, tools, devices and objects, for runs without hardware. All of their signals are
//! labelled simulated wherever they are shown.

pub(crate) mod accelerometer;
pub(crate) mod acting;
pub(crate) mod arm;
pub(crate) mod bristles;
pub mod compensation;
pub(crate) mod drawing;
pub(crate) mod force_sensor;
pub mod ground;
pub(crate) mod habit;
pub(crate) mod hand;
pub mod haptuator;
pub mod input;
pub(crate) mod knock;
pub mod material;
pub(crate) mod omni;
pub(crate) mod orientation;
pub(crate) mod pen;
pub mod pen_brake;
pub(crate) mod pen_object;
pub(crate) mod recorder;
pub(crate) mod script;
pub(crate) mod sensor_models;
pub mod static_resolution;
pub(crate) mod stroke;
pub(crate) mod tablet;
pub(crate) mod tablet_node;
pub(crate) mod terrain;
pub(crate) mod tool;
pub mod touchable;
pub(crate) mod tracker;
pub(crate) mod wobble;
