//! The module that a page of a graph loads.

#![expect(unused_crate_dependencies, reason = "it is the library's calls")]

use haptograph_wasm as _;
