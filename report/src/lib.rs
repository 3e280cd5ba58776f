//! Everything a person looks at: plots, drawings of graphs, and the page a run leaves behind. All of it is SVG and
//! HTML that needs no network, no script and no font of its own, and follows the reader's light or dark theme.

pub mod asked;
pub mod drawing;
pub mod evaluation;
pub mod figures;
pub mod holdout;
mod layout;
pub mod learning;
mod loci;
mod map_figures;
pub mod page;
pub mod plot;
mod raster;
pub mod record;
pub mod reference;
mod responses;
mod scale;
mod svg;
mod swatch;
pub mod sweep;
pub mod theme;
pub mod thinning;

pub use swatch::swatch;
