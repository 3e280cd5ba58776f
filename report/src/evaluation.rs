//! The page of an evaluation: the tables and the map of thesis section 2.5, and the data that each surface
//! was learned from.

use super::headlines::{Headline, cards};
use super::page::{Sheet, figures_of};
use super::scale::fixed;
use super::svg::escape;
use super::table::{Table, grid};
use super::{learning, map_figures};
use haptograph_learning::evaluate::{ConditionLoss, DifferenceTable, Evaluation, PerceptualMap};
use haptograph_learning::learn::LearningReport;
use haptograph_learning::metrics::Pooling;
use haptograph_surfaces::Surface;

/// The page of an evaluation, with the surface of each material and its learning report.
pub fn page(title: &str, found: &Evaluation, learned: &[(Surface, LearningReport)]) -> String {
    let mut sections = vec![("", cards(&headlines(found))), ("Textures and materials", materials(found))];
    if let Some(people) = &found.people_table {
        let about = "Spectral difference between each person's textures and the same recordings of their own material.";
        sections.push(("People", format!("<p>{about}</p>{}", people_table(people).to_html())));
    }
    if let Some(map) = &found.map {
        sections.push(("Map of all textures", map_section(map)));
    }
    sections.push(("Response to force and speed", conditions(&found.losses)));
    sections.push(("The surfaces", surfaces(learned)));
    let about = format!(
        "Textures learned from one recording of each material and person, tested on other recordings by {}.",
        found.expert
    );
    Sheet {
        title,
        about: &about,
        badge: learning::badge(learned.iter().any(|(surface, _)| learning::is_simulated(surface))),
        warnings: &[],
        sections: &sections,
    }
    .to_html()
}

/// Headlines: how many textures are nearest to their own material, and how well the map separates the
/// materials.
fn headlines(found: &Evaluation) -> Vec<Headline> {
    let table = &found.materials_table;
    let textures = table.rows.len().min(table.columns.len());
    let nearest = (0..textures).filter(|i| table.is_least_of_row(*i, *i)).count();
    let mut list = vec![
        Headline::new(
            "Nearest to their own material",
            format!("{nearest} of {textures}"),
            "textures, by spectral difference",
        ),
        Headline::new(
            "Largest expected difference to the own material",
            fixed(table.baseline(), 2),
            "mean + 2 SD of spectral differences",
        ),
    ];
    if let Some(map) = found.map.as_ref().filter(|map| map_figures::has_groups(map)) {
        let purity = format!("{} %", fixed(100.0 * map.k_means_purity, 0));
        list.push(Headline::new("Grouped with their own material", purity, "of the textures on the map"));
    }
    list
}

/// Table 2.1 with the deviations pooled in both ways, the chosen one first.
fn materials(found: &Evaluation) -> String {
    let chosen = &found.materials_table;
    let mut poolings = [Pooling::All, Pooling::Pair];
    poolings.sort_by_key(|pooling| *pooling != chosen.pooling);
    let tables: String = poolings
        .map(|pooling| {
            let over = match pooling {
                Pooling::Pair => "the compared pair",
                Pooling::All => "all compared pairs",
            };
            format!(
                "<h3>Deviations over the windows of {over}</h3>{}",
                materials_table(&chosen.pooled(pooling))
            )
        })
        .concat();
    format!(
        "<p>Spectral difference between the virtual textures (rows), rendered along the test recordings (columns), and these recordings, averaged \
         over a column's recordings. Framed: a texture's own material. Bold: smallest of its row and its column.</p>{tables}"
    )
}

/// The cells are tinted by their values, the diagonal is framed.
fn materials_table(table: &DifferenceTable) -> String {
    let values = || table.differences.iter().flatten().flatten().copied();
    let (least, most) = values().fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    let cell = |row: usize, column: usize| {
        let Some(value) = table.differences[row][column] else {
            return "<td>–</td>".to_owned();
        };
        let tint = 60.0 * (1.0 - (value - least) / (most - least).max(1e-12));
        let best = table.is_least_of_row(row, column) && table.is_least_of_column(row, column);
        let (frame, weight) =
            (if row == column { ";outline:2px solid #2166ac" } else { "" }, if best { "b" } else { "span" });
        format!(
            "<td style=\"background:color-mix(in srgb,#5cc9ae {tint:.0}%,transparent){frame}\"><{weight}>{value:.2}</{weight}></td>"
        )
    };
    let rows = table.rows.iter().enumerate().map(|(row, name)| {
        let cells = (0..table.columns.len()).map(|column| cell(row, column));
        std::iter::once(format!("virtual {}", escape(name))).chain(cells).collect()
    });
    let yes = if table.diagonal_is_least() {
        "Every texture is nearest to its own material, and every material to its own texture."
    } else {
        "Not every texture is nearest to its own material."
    };
    format!(
        "{}<p>{yes} Largest expected difference to the own material (mean + 2 SD of the framed): {:.2}.</p>",
        grid(GRID, head(&table.columns), rows),
        table.baseline()
    )
}

const GRID: &str = " class=\"grid\"";

/// The cells of a header, the first of which is empty.
fn head(names: &[String]) -> impl Iterator<Item = String> {
    std::iter::once(String::new()).chain(names.iter().map(|name| escape(name)))
}

/// Table 2.2.
/// Each person's textures against the same recordings, with the mean and deviation of a row.
pub fn people_table(table: &DifferenceTable) -> Table {
    let shown = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.2}"));
    let statistics = table.row_statistics();
    let rows = table.rows.iter().zip(&table.differences).zip(&statistics);
    let rows = rows.map(|((name, cells), (mean, deviation))| {
        let cells = std::iter::once(name.clone()).chain(cells.iter().map(|cell| shown(*cell)));
        cells.chain([format!("{mean:.2}"), shown(*deviation)]).collect()
    });
    let columns = table.columns.iter().map(String::as_str);
    let head: Vec<&str> = std::iter::once("").chain(columns).chain(["mean", "sd"]).collect();
    Table::new(&head, rows.collect())
}

fn map_section(map: &PerceptualMap) -> String {
    let angle = map.angle_deg.map_or_else(String::new, |angle| {
        format!(" The directions in which roughness and fineness grow are {angle:.0} degrees apart.")
    });
    // With a group per texture there is no grouping.
    let groups = match map_figures::has_groups(map) {
        true => format!(
            " Of the textures, {:.0} % lie in a k-means group (outlined) of mostly their own material, {:.0} % in such a group of the tree.",
            100.0 * map.k_means_purity,
            100.0 * map.tree_purity
        ),
        false => String::new(),
    };
    format!(
        "<p>All textures played along one random walk and placed by their spectral differences.{groups}{angle}</p>{}",
        figures_of(&[
            map_figures::places(map),
            map_figures::scree(&map.scaling.stress),
            map_figures::tree(&map.names, &map.tree)
        ])
    )
}

/// Losses of the reduced conditions, and SD_x of each surface (Eq. 4.5.4).
fn conditions(losses: &[ConditionLoss]) -> String {
    if losses.is_empty() {
        return String::new();
    }
    let rows = losses.iter().map(|one| {
        let difference = one.difference.map_or_else(|| "–".to_owned(), |difference| fixed(difference, 2));
        let (power, centroid) = (fixed(one.loss.power, 3), fixed(one.loss.centroid_hz, 1));
        vec![escape(&one.surface), one.condition.symbol().to_owned(), power, centroid, difference]
    });
    let head = ["surface", "condition", "power ((m/s²)²)", "centroid (Hz)", "SD"].map(str::to_owned);
    format!(
        "<p>Loss of a texture that responds to force only (F), to speed only (S), or to neither (ϕ): variation over time of the windowed \
         power and spectral centroid, and both together in units of their deviation over the surfaces (SD).</p>{}",
        grid(GRID, head.into_iter(), rows)
    )
}

/// Each surface as a folded section under its name.
fn surfaces(learned: &[(Surface, LearningReport)]) -> String {
    let one = |(number, (surface, report)): (usize, &(Surface, LearningReport))| {
        let sections: String = learning::sections(surface, report)
            .iter()
            .map(|(name, content)| match *name {
                "" => content.clone(),
                name => format!("<h3>{name}</h3>{content}"),
            })
            .collect();
        let open = if number == 0 { " open" } else { "" };
        format!("<details{open}><summary>{}</summary>{sections}</details>", escape(&surface.name))
    };
    learned.iter().enumerate().map(one).collect()
}

#[cfg(test)]
mod tests;
