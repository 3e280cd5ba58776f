//! Everything a person looks at: plots, drawings of graphs, and the page a run leaves behind. All of it is SVG and
//! HTML that needs no network and no font of its own, is whole without its script, and follows the reader's light or dark
//! theme.

pub mod asked;
pub mod drawing;
pub mod evaluation;
pub mod facts;
pub mod figures;
pub mod headlines;
pub mod holdout;
pub mod identification;
pub mod inks;
mod layout;
pub mod learning;
mod loci;
mod map_figures;
pub mod page;
mod player;
pub mod plot;
mod raster;
pub mod record;
pub mod reference;
mod responses;
pub mod scale;
pub mod sound;
pub mod spectra;
mod svg;
mod swatch;
pub mod sweep;
mod texture_map;
pub mod theme;
pub mod thinning;

pub use swatch::swatch;
