//! The page that learning a surface leaves behind.
use haptograph_surfaces::Surface;
use haptograph_surfaces::learning::LearningReport;
/// The page.
pub fn page(surface: &Surface, _report: &LearningReport) -> String {
    surface.name.clone()
}
