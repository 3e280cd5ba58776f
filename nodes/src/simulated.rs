//! Simulated hands, tools, devices and objects, for runs without hardware. All of their signals are
//! labelled simulated wherever they are shown.

pub mod accelerometer;
pub mod acting;
pub mod arm;
pub mod compensation;
pub mod drawing;
pub mod force_sensor;
pub mod ground;
pub mod habit;
pub mod hand;
pub mod haptuator;
pub mod input;
pub mod knock;
pub mod material;
pub mod omni;
pub(crate) mod orientation;
pub mod pen;
pub mod pen_brake;
pub mod pen_object;
pub mod recorder;
pub mod script;
pub mod sensor_models;
pub mod static_resolution;
pub mod stroke;
pub mod tablet;
pub mod tablet_node;
pub mod terrain;
pub mod tool;
pub mod touchable;
pub mod tracker;
pub mod wobble;
