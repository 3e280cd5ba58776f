//! Arithmetic on signals, component by component.

pub mod calculus;
pub mod curve;
pub mod events;
pub mod expression;
pub mod limits;
pub mod products;
pub mod routing;
pub mod scaling;
pub mod sums;
pub mod threshold;
pub mod vectors;
