//! The page that an evaluation leaves behind.
use haptograph_surfaces::evaluate::{Evaluation, StudySettings};
/// The page.
pub fn page(found: &Evaluation, _settings: &StudySettings) -> String {
    found.expert.clone()
}
