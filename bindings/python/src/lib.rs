//! The native part of the Python package: arrays in, library calls on a separate thread, arrays out. The public classes
//! and functions, with their documentation, are in `python/haptograph`.

#![warn(unreachable_pub)]

/// A dictionary: `dict!(py; name: value, other: value)`.
macro_rules! dict {
    ($py:expr; $($name:ident: $value:expr),+) => {{
        let told = pyo3::types::PyDict::new($py);
        $(told.set_item(stringify!($name), $value)?;)+
        told
    }};
}

mod batches;
mod errors;
mod evaluation;
mod graphs;
mod making;
mod patterns;
mod players;
mod prototypes;
mod recordings;
mod runs;
mod surfaces;
mod work;

/// The native module, which only the package itself uses.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use crate::batches::{batch, manifest, merge};
    #[pymodule_export]
    use crate::evaluation::{evaluate, identify, sweep};
    #[pymodule_export]
    use crate::graphs::Graph;
    #[pymodule_export]
    use crate::making::{lsf, make, warped_axis};
    #[pymodule_export]
    use crate::patterns::export;
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
