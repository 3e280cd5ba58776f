//! The tables and the map of an evaluation, as text and as JSON.

use super::conclusion;
use crate::cli::beside::{Rows, is_material};
use crate::cli::result::CommandResult;
use crate::cli::table::{facts, significant, table};
use crate::learning::evaluate::{ConditionLoss, DifferenceTable, Evaluation, PerceptualMap};
use crate::learning::metrics::{Pooling, WindowSettings};
use crate::report::evaluation::people_table;
use crate::signal::statistics::{mean, standard_deviation};
use haptograph_study::thesis::published;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::path::PathBuf;

/// The tables and the map of a study.
pub(super) struct Tables {
    pub found: Evaluation,
    /// Number of simulated recordings.
    pub simulated: usize,
    pub recordings: usize,
    pub page: Option<PathBuf>,
}

impl CommandResult for Tables {
    fn text(&self) -> String {
        describe(&self.found) + &conclusion(self.simulated, self.recordings, self.page.as_ref())
    }
}

fn describe(found: &Evaluation) -> String {
    let mut text = format!(
        "Spectral difference between virtual textures (rows, learned from {}'s first take) and recordings (columns, {}'s other takes).\n\
         [own material]  * smallest of its row and column\n\n",
        found.expert, found.expert
    );
    let other = found.materials_table.pooled(other(found.materials_table.pooling));
    for table in [&found.materials_table, &other] {
        let over = match table.pooling {
            Pooling::Pair => "the compared pair",
            Pooling::All => "all compared pairs",
        };
        text += &format!("Deviations over the windows of {over}:\n\n{}\n", materials_table(table));
        let yes = if table.diagonal_is_least() { "yes" } else { "no" };
        text += &facts(&[
            ("baseline (mean + 2 sd of the diagonal)", significant(table.baseline(), 3)),
            ("each texture nearest to its own material", yes.to_owned()),
            ("smallest margin", margin(table)),
        ]);
        text += "\n";
    }
    if let Some(people) = &found.people_table {
        text += "Each person's textures against the same recordings of their own material.\n\n";
        text += &people_table(people).text();
    }
    if let Some(map) = &found.map {
        text += "\nAll textures against each other, played along one random walk and placed on a map.\n\n";
        let scree = |values: &[f64], digits: usize| {
            let values: Vec<String> = values.iter().map(|value| significant(*value, digits)).collect();
            values.join(" ")
        };
        text += &facts(&[
            ("stress in 1, 2, ... dimensions", scree(&map.scaling.stress, 2)),
            ("R² of the distances there", scree(&map.scaling.r_squared, 3)),
            ("purity of k-means groups", significant(map.k_means_purity, 3)),
            ("purity of hierarchical groups", significant(map.tree_purity, 3)),
            (
                "angle of roughness and fineness",
                map.angle_deg
                    .map_or_else(|| "none".to_owned(), |angle| format!("{} degrees", significant(angle, 3))),
            ),
        ]);
    }
    text += &losses(&found.losses);
    if found.centre.is_some() {
        text += &format!("\n{}", facts(&[Centre::fact(found.centre.map(Centre::from).as_ref())]));
    }
    text
}

/// The numbers of sections 2.5 and 4.5.2 that mean the same as those of an evaluation.
pub(super) fn beside(found: &Evaluation) -> Rows {
    let (mut rows, tables) = (Rows::default(), &published()["tables"]);
    let rate_hz = found.learned.first().map(|one| one.texture.rate_hz());
    rows.constant(
        "window",
        rate_hz
            .filter(|rate_hz| *rate_hz == 10_000.0)
            .map(|rate_hz| WindowSettings::comparison_at(rate_hz).samples),
    );
    // Deviations over all tested windows: Eq. 2.5.3.
    let own = found.materials_table.pooled(Pooling::All);
    let (diagonal, expert) = (own.diagonal(), &tables["2.2"]);
    rows.add("Table 2.2", "own material: mean", mean(&diagonal), &expert["mean"][8]);
    rows.add("Table 2.2", "own material: deviation", standard_deviation(&diagonal), &expert["stdev"][8]);
    rows.add("2.5.2", "baseline", own.baseline(), &tables["2.1"]["baseline"]);
    let materials = tables["2.1"]["materials"].as_object();
    let place = |own: &String| {
        let mut printed =
            materials?.iter().map(|(number, name)| format!("{number} {}", name.as_str().unwrap_or_default()));
        printed.position(|printed| is_material(own, &printed))
    };
    for (texture, cells) in own.rows.iter().zip(&own.differences) {
        for (material, cell) in own.columns.iter().zip(cells) {
            if let (Some(row), Some(column)) = (place(texture), place(material)) {
                let what = format!("virtual {texture} on {material}");
                rows.add("Table 2.1", &what, *cell, &tables["2.1"]["values"][row][column]);
            }
        }
    }
    if let Some(people) = found.people_table.as_ref().map(|table| table.pooled(Pooling::All)) {
        let others =
            people.rows.iter().zip(people.row_statistics()).filter(|(name, _)| **name != found.expert);
        let own = range(others.map(|(_, (mean, _))| mean));
        let printed = expert["mean"].as_array().into_iter().flatten().take(8).filter_map(Value::as_f64);
        rows.add("Table 2.2", "mean of each other person", own, &range(printed));
    }
    if let Some(map) = &found.map {
        let (count, printed) = (map.names.len(), &published()["studies"]["2.5"]["map"]);
        rows.add("2.5.4", "textures on the map", count, &printed["signals"]);
        rows.add("2.5.4", "pairs", count * (count - 1) / 2, &printed["pairs"]);
        rows.add("2.5.4", "clusters", found.materials.len(), &printed["clusters"]);
        let angle = map.angle_deg.filter(|_| found.materials_table.pooling == Pooling::All);
        rows.add("2.5.4", "angle of roughness and fineness, degrees", angle, &printed["angle_deg"]);
    }
    Centre::beside(found.centre.map(Centre::from).as_ref(), &mut rows);
    rows
}

/// The least and the largest of some numbers.
fn range(values: impl Iterator<Item = f64> + Clone) -> Value {
    let (least, most) = (values.clone().reduce(f64::min), values.reduce(f64::max));
    least
        .zip(most)
        .map(|(least, most)| format!("{} to {}", significant(least, 3), significant(most, 3)))
        .into()
}

/// The variation that textures lose which respond to force only, speed only, or neither (thesis 4.5.3).
fn losses(losses: &[ConditionLoss]) -> String {
    let row = |one: &ConditionLoss| {
        vec![
            format!("virtual {}", one.surface),
            one.condition.symbol().to_owned(),
            significant(one.loss.power, 3),
            significant(one.loss.centroid_hz, 3),
            one.difference.map_or_else(|| "–".to_owned(), |difference| format!("{difference:.2}")),
        ]
    };
    if losses.is_empty() {
        return String::new();
    }
    let rows: Vec<Vec<String>> = losses.iter().map(row).collect();
    let header = ["", "responds to", "power ((m/s²)²)", "centroid (Hz)", "SD_x"];
    format!(
        "\nVariation that is lost if a texture responds to force only (F), speed only (S) or neither (ϕ).\n\n{}",
        table(&header, &rows)
    )
}

/// The centre of a set of surfaces (thesis 4.5.2).
#[derive(Debug, Serialize)]
pub(crate) struct Centre {
    force_n: f64,
    speed_mm_s: f64,
}

impl From<(f64, f64)> for Centre {
    fn from((speed_m_s, force_n): (f64, f64)) -> Self {
        Self { force_n, speed_mm_s: 1000.0 * speed_m_s }
    }
}

impl Centre {
    /// The thesis's beside it.
    pub(crate) fn beside(centre: Option<&Self>, rows: &mut Rows) {
        let table = &published()["tables"]["4.1"];
        rows.add(
            "Table 4.1",
            "mean speed of models, mm/s",
            centre.map(|at| at.speed_mm_s),
            &table["S_c_mm_s"],
        );
        rows.add("Table 4.1", "mean force of models, N", centre.map(|at| at.force_n), &table["F_c_n"]);
    }

    /// A line of facts.
    pub(crate) fn fact(centre: Option<&Self>) -> (&'static str, String) {
        let number = |value| significant(value, 3);
        let shown = centre.map_or_else(
            || "none: no measured models".to_owned(),
            |at| format!("{} mm/s, {} N", number(at.speed_mm_s), number(at.force_n)),
        );
        ("mean of the measured models up to 2.75 N", shown)
    }
}

/// The smallest difference between a texture's own material and its nearest other material, with both names.
fn margin(table: &DifferenceTable) -> String {
    table.smallest_margin().map_or_else(
        || "none".to_owned(),
        |(margin, row, column)| {
            format!("{margin:.2} (virtual {} on {})", table.rows[row], table.columns[column])
        },
    )
}

fn other(pooling: Pooling) -> Pooling {
    match pooling {
        Pooling::Pair => Pooling::All,
        Pooling::All => Pooling::Pair,
    }
}

fn materials_table(differences: &DifferenceTable) -> String {
    let rows: Vec<Vec<String>> = differences
        .rows
        .iter()
        .enumerate()
        .map(|(row, name)| {
            let cells = differences.differences[row].iter().enumerate().map(|(column, cell)| {
                let least =
                    differences.is_least_of_row(row, column) && differences.is_least_of_column(row, column);
                let star = if least { "*" } else { "" };
                match cell {
                    Some(value) if row == column => format!("{star}[{value:.2}]"),
                    Some(value) => format!("{star}{value:.2} "),
                    None => "–".to_owned(),
                }
            });
            std::iter::once(format!("virtual {name}")).chain(cells).collect()
        })
        .collect();
    let header: Vec<&str> =
        std::iter::once("").chain(differences.columns.iter().map(String::as_str)).collect();
    table(&header, &rows)
}

impl Serialize for Tables {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let found = &self.found;
        json!({
            "materials": found.materials, "people": found.people, "expert": found.expert,
            "simulated": self.simulated > 0, "table": table_json(&found.materials_table),
            "tables": {
                "pooled_over_pair": table_json(&found.materials_table.pooled(Pooling::Pair)),
                "pooled_over_all": table_json(&found.materials_table.pooled(Pooling::All)),
            },

            "people_table": found.people_table.as_ref().map(|table| json!({ "rows": table.rows, "columns": table.columns, "sd": table.differences })),
            "map": found.map.as_ref().map(map_json),
            "losses": found.losses.iter().map(loss_json).collect::<Vec<_>>(),
            "centre": found.centre.map(Centre::from),
        })
        .serialize(serializer)
    }
}

fn table_json(table: &DifferenceTable) -> Value {
    json!({
        "rows": table.rows, "columns": table.columns, "sd": table.differences, "diagonal": table.diagonal(),
        "baseline": table.baseline(), "diagonal_is_least": table.diagonal_is_least(),
        "smallest_margin": table.smallest_margin().map(|(margin, ..)| margin),
    })
}

fn map_json(map: &PerceptualMap) -> Value {
    json!({
        "textures": map.names.iter().map(|(name, _)| name).collect::<Vec<_>>(), "places": map.scaling.places,
        "stress": map.scaling.stress, "r_squared": map.scaling.r_squared, "k_means": map.k_means,
        "k_means_purity": map.k_means_purity, "hierarchical_purity": map.tree_purity, "power": map.power,
        "spectral_centroid_hz": map.spectral_centroid_hz, "angle_deg": map.angle_deg,
    })
}

fn loss_json(one: &ConditionLoss) -> Value {
    json!({
        "texture": one.surface, "condition": one.condition.symbol(), "power_m2_s4": one.loss.power,
        "spectral_centroid_hz": one.loss.centroid_hz, "sd_x": one.difference,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::evaluate::{RecordingName, Study, StudySettings, Take};
    use crate::learning::recording::Gesture;
    use crate::nodes::simulated::material::MaterialName;
    use crate::recorder::{SimulatedTake, record};

    #[test]
    fn cells_of_the_printed_tables_stand_beside_materials_of_their_names() {
        let take = |name: &str, material, seed| {
            let gesture = Gesture::Drag;
            let take = SimulatedTake { material, gesture, from_rest: false, person: 1, seconds: 2.0, seed };
            let recording = record(&take, &Default::default(), &mut |_| ()).unwrap();
            Take { name: RecordingName::parse(name).unwrap(), recording }
        };
        let takes = [
            take("T1.anna.1.npz", MaterialName::T1, 1),
            take("T1.anna.2.npz", MaterialName::T1, 2),
            take("slate.anna.1.npz", MaterialName::T3, 3),
            take("slate.anna.2.npz", MaterialName::T3, 4),
            take("T1.ben.1.npz", MaterialName::T1, 5),
        ];
        let found = Study::of(&takes).unwrap().evaluate(&StudySettings::default(), &|_| ()).unwrap();
        let rows = beside(&found).0;
        let row = |what: &str| rows.iter().find(|row| row.what == what);
        let cell = row("virtual T1 on T1").unwrap();
        assert_eq!((&cell.thesis, cell.source), (&json!(4.5), "Table 2.1"));
        assert_eq!(cell.own, json!(found.materials_table.pooled(Pooling::All).diagonal()[0]));
        assert!(rows.iter().all(|row| !row.what.contains("slate")), "the thesis has no slate");
        assert_eq!(row("baseline").unwrap().thesis, json!(4.72));
        assert_eq!(row("window, samples").unwrap().own, json!(256));
        assert_eq!(row("mean of each other person").unwrap().thesis, json!("4.16 to 4.95"));
        assert_eq!(row("pairs").map(|row| (&row.own, &row.thesis)), Some((&json!(3), &json!(1431))));
    }
}
