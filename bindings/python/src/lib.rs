//! The part of the Python package that is in Rust: arrays in, library calls on a thread of their own, arrays out. What
//! users see, with its documentation, is in `python/haptograph`.

mod batches;
mod errors;
mod graphs;
mod players;
mod prototypes;
mod recordings;
mod runs;
mod surfaces;
mod work;

/// Everything that the package is made of; not for users.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use crate::batches::{batch, merge};
    #[pymodule_export]
    use crate::graphs::Graph;
    #[pymodule_export]
    use crate::players::Player;
    #[pymodule_export]
    use crate::prototypes::NodeClass;
    #[pymodule_export]
    use crate::recordings::{Recording, figures, read, recording};
    #[pymodule_export]
    use crate::surfaces::{Surface, compare, learn, render, resample, update_samples};

    #[pymodule_init]
    fn init(module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        use pyo3::prelude::*;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
