//! The analysis once more, as a script for R.

use super::rated;
use crate::document::{End, Phase, Study};

const SCRIPT: &str = include_str!("analysis.R");

impl Study {
    /// A script for base R that repeats the analyses of variance, comparisons, ABX, correlations and regressions, from the tables in the folder
    /// above its own.
    pub fn r_script(&self) -> String {
        let phases = self.phases.0.iter().filter_map(|(name, phase)| {
            let more = match phase {
                Phase::Rate(_) => "kind = \"rate\"".to_owned(),
                Phase::Compare(_) => "kind = \"compare\"".to_owned(),
                Phase::TwoAlternative(of) if of.abx => "kind = \"abx\"".to_owned(),
                Phase::Pairs(pairs) => {
                    let from = if pairs.same_is == End::From { "TRUE" } else { "FALSE" };
                    format!("kind = \"pairs\", same_is_from = {from}, ratings = {}", quoted(rated(self)))
                }
                _ => return None,
            };
            Some(format!("    list(name = {}, {more})", quoted(&name.text)))
        });
        let phases = format!("phases <- list(\n{}\n)", phases.collect::<Vec<_>>().join(",\n"));
        SCRIPT.replacen("PHASES", &phases, 1)
    }
}

/// A text of R, in ASCII whatever the reader's encoding.
fn quoted(text: &str) -> String {
    let letter = |c: char| match c {
        '"' | '\\' => format!("\\{c}"),
        c if c.is_ascii() => c.to_string(),
        c => format!("\\U{:08x}", u32::from(c)),
    };
    format!("\"{}\"", text.chars().map(letter).collect::<String>())
}
