//! Friction of a tool on a surface: forces in the tangent plane, against the motion.
//!
//! `dahl` is the stick-slip law of the thesis (4.3.1) with its passive variant, the default; `viscous_coulomb` is the law
//! of the public toolkit (A.3).

pub(crate) mod dahl;
pub mod nodes;
pub(crate) mod viscous_coulomb;
