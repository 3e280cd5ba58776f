//! Arithmetic on signals, component by component.

pub(crate) mod calculus;
pub(crate) mod curve;
pub(crate) mod events;
pub(crate) mod expression;
pub(crate) mod limits;
pub(crate) mod products;
pub(crate) mod routing;
pub(crate) mod scaling;
pub(crate) mod sums;
pub(crate) mod threshold;
pub(crate) mod vectors;
