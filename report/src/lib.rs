//! Plots, drawings of graphs, and pages of runs, as SVG and HTML. They load nothing from the network, need no
//! font of their own, are complete without their script, and follow the reader's light or dark theme.

#![cfg_attr(not(test), warn(unreachable_pub))]

pub mod drawing;
pub mod evaluation;
pub mod facts;
pub mod figures;
pub mod headlines;
pub mod holdout;
pub mod identification;
pub(crate) mod inks;
mod layout;
pub mod learning;
mod loci;
mod map_figures;
pub mod page;
pub mod pair;
mod player;
pub mod plot;
pub mod plot_request;
pub mod plotted;
mod raster;
pub mod record;
pub mod reference;
mod responses;
pub mod scale;
pub mod sound;
pub(crate) mod spectra;
pub mod study;
mod svg;
mod swatch;
pub mod sweep;
pub mod table;
mod texture_map;
pub mod theme;
pub(crate) mod thinning;

pub use swatch::swatch;
