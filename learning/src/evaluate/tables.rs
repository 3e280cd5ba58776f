//! Tables of spectral differences between recordings and the vibrations of virtual textures along the
//! recordings' speed and force (thesis 2.5.2 and 2.5.3).

use crate::metrics::{
    Deviations, ErrorStatistics, MetricError, PairErrors, Pooling, WindowSettings, WindowedSpectra,
};
use crate::recording::ProcessedRecording;
use haptograph_signal::statistics::{mean, standard_deviation};
use haptograph_surfaces::TextureModel;
use haptograph_surfaces::rendering::{SynthesisError, SynthesisSettings, Trajectory, synthesise};

/// Settings of a table.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TableSettings {
    /// Windows of the metric; `None` for 25.6 ms.
    pub windows: Option<WindowSettings>,
    /// Set over which deviations are pooled.
    pub pooling: Pooling,
    /// Synthesis settings of the textures.
    pub synthesis: SynthesisSettings,
}

impl TableSettings {
    fn windows_at(&self, rate_hz: f64) -> WindowSettings {
        self.windows.unwrap_or_else(|| WindowSettings::comparison_at(rate_hz))
    }
}

/// Test recordings of one material.
#[derive(Debug, Clone)]
pub struct TestSet<'a> {
    /// The material.
    pub name: String,
    /// The recordings; three in the thesis.
    pub recordings: Vec<&'a ProcessedRecording>,
}

/// Spectral differences, one row per virtual texture (or person), one column per material.
#[derive(Debug, Clone, PartialEq)]
pub struct DifferenceTable {
    /// Names of the rows.
    pub rows: Vec<String>,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Spectral differences by row, then column, averaged over the column's recordings; `None` without a
    /// texture.
    pub differences: Vec<Vec<Option<f64>>>,
    /// Set over which the deviations were pooled.
    pub pooling: Pooling,
    /// The window errors of each difference, by the column's recordings.
    pub errors: Vec<Vec<Option<Vec<ErrorStatistics>>>>,
}

/// Error of a table.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum TableError {
    #[error("cannot compare recording {recording} (from 0) of {material}: {source}")]
    Recording { material: String, recording: usize, source: MetricError },
    #[error("cannot render the texture in row {row} along the recordings of {material}: {source}")]
    Synthesis { row: String, material: String, source: SynthesisError },
    #[error("cannot compare the rendering of row {row} with the recordings of {material}: {source}")]
    Comparison { row: String, material: String, source: MetricError },
}

/// The spectra of one test recording, and the trajectory to render textures along.
#[derive(Debug)]
pub struct Reference {
    material: String,
    spectra: WindowedSpectra,
    trajectory: Trajectory,
}

impl Reference {
    /// The reference of recording `index` (from 0) of a material.
    ///
    /// # Errors
    /// [`TableError::Recording`].
    pub fn new(
        material: &str,
        index: usize,
        recording: &ProcessedRecording,
        settings: &TableSettings,
    ) -> Result<Self, TableError> {
        let signals = recording.signals();
        let windows = settings.windows_at(signals.rate_hz);
        let spectra = WindowedSpectra::new(&signals.acceleration_m_s2, signals.rate_hz, &windows);
        let failed =
            |source| TableError::Recording { material: material.to_owned(), recording: index, source };
        Ok(Self {
            material: material.to_owned(),
            spectra: spectra.map_err(failed)?,
            trajectory: recording.trajectory(),
        })
    }

    /// The errors of a texture against the recording.
    ///
    /// # Errors
    /// [`TableError::Synthesis`] and [`TableError::Comparison`].
    pub(crate) fn errors(
        &self,
        row: &str,
        texture: &TextureModel,
        settings: &TableSettings,
    ) -> Result<ErrorStatistics, TableError> {
        let (row, material) = (|| row.to_owned(), || self.material.clone());
        let vibration = synthesise(texture, &self.trajectory, &settings.synthesis)
            .map_err(|source| TableError::Synthesis { row: row(), material: material(), source })?;
        WindowedSpectra::new(&vibration, texture.rate_hz(), &settings.windows_at(texture.rate_hz()))
            .and_then(|spectra| PairErrors::new(&self.spectra, &spectra))
            .map(|errors| errors.statistics())
            .map_err(|source| TableError::Comparison { row: row(), material: material(), source })
    }
}

fn pool(cells: &[Vec<Option<Vec<ErrorStatistics>>>]) -> Deviations {
    let all = cells.iter().flatten().flatten().flatten();
    all.fold(ErrorStatistics::default(), |all, pair| all.merged(pair)).deviations()
}

fn difference(pairs: &[ErrorStatistics], pooled: Deviations, pooling: Pooling) -> f64 {
    let differences: Vec<f64> = pairs
        .iter()
        .map(|pair| {
            pair.spectral_difference(&match pooling {
                Pooling::Pair => pair.deviations(),
                Pooling::All => pooled,
            })
        })
        .collect();
    mean(&differences)
}

impl DifferenceTable {
    /// The table of these errors, by row, then column.
    pub(crate) fn of_errors(
        rows: Vec<String>,
        columns: Vec<String>,
        errors: Vec<Vec<Option<Vec<ErrorStatistics>>>>,
        pooling: Pooling,
    ) -> Self {
        let pooled = pool(&errors);
        let cell = |cell: &Option<Vec<ErrorStatistics>>| {
            cell.as_ref().map(|pairs| difference(pairs, pooled, pooling))
        };
        Self {
            rows,
            columns,
            differences: errors.iter().map(|row| row.iter().map(cell).collect()).collect(),
            pooling,
            errors,
        }
    }

    /// The table of the same errors with other deviations.
    pub fn pooled(&self, pooling: Pooling) -> Self {
        Self::of_errors(self.rows.clone(), self.columns.clone(), self.errors.clone(), pooling)
    }

    /// The difference between each texture and its own material, for rows and columns in the same order.
    pub fn diagonal(&self) -> Vec<f64> {
        (0..self.rows.len().min(self.columns.len())).filter_map(|i| self.differences[i][i]).collect()
    }

    /// Mean plus two sample standard deviations of the diagonal, the thesis's threshold of similarity (4.72
    /// there).
    pub fn baseline(&self) -> f64 {
        let diagonal = self.diagonal();
        mean(&diagonal) + 2.0 * standard_deviation(&diagonal)
    }

    /// True if a cell is the smallest of its row.
    pub fn is_least_of_row(&self, row: usize, column: usize) -> bool {
        let least = self.differences[row].iter().flatten().copied().fold(f64::INFINITY, f64::min);
        self.differences[row][column] == Some(least)
    }

    /// True if a cell is the smallest of its column.
    pub fn is_least_of_column(&self, row: usize, column: usize) -> bool {
        let least = self.differences.iter().filter_map(|row| row[column]).fold(f64::INFINITY, f64::min);
        self.differences[row][column] == Some(least)
    }

    /// True if every texture is nearest to its own material, and every material to its own texture.
    pub fn diagonal_is_least(&self) -> bool {
        let count = self.rows.len().min(self.columns.len());
        (0..count).all(|i| self.is_least_of_row(i, i) && self.is_least_of_column(i, i))
    }

    /// The smallest margin between a texture's own material and another cell of its row or column: the
    /// difference (negative if the other is nearer), and row and column of the other cell. `None` for a
    /// single material.
    pub fn smallest_margin(&self) -> Option<(f64, usize, usize)> {
        let count = self.rows.len().min(self.columns.len());
        let own = |i: usize| self.differences[i][i];
        let others = (0..count).flat_map(|i| (0..count).filter(move |j| *j != i).map(move |j| (i, j)));
        let margins = others.filter_map(|(i, j)| {
            let other = self.differences[i][j]?;
            Some((other - own(i)?.max(own(j)?), i, j))
        });
        margins.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Mean and sample standard deviation of each row, as in Table 2.2; a single value has no deviation.
    pub fn row_statistics(&self) -> Vec<(f64, Option<f64>)> {
        let statistics = |row: &Vec<Option<f64>>| {
            let values: Vec<f64> = row.iter().copied().flatten().collect();
            let deviation = (values.len() > 1).then(|| standard_deviation(&values));
            (mean(&values), deviation)
        };
        self.differences.iter().map(statistics).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::texture::learn_texture;
    use crate::recording::tests::synthetic::drag;

    /// Three materials with different resonances.
    fn recording(material: usize, seed: u64) -> ProcessedRecording {
        let steps: Vec<_> =
            (0..9).map(|i| (0.15, 0.05 + 0.05 * ((i * 2) % 3) as f64, 0.5 + 0.5 * (i / 3) as f64)).collect();
        drag(&steps, 0.3, seed, |speed, force| {
            let angle = 0.3 + 0.5 * material as f64;
            (vec![-1.8 * angle.cos(), 0.81], (1.0 + material as f64) * speed * force)
        })
    }

    fn table(pooling: Pooling) -> DifferenceTable {
        let names: Vec<String> = ["low", "middle", "high"].map(String::from).to_vec();
        let learned =
            |material| learn_texture(&[recording(material, 10)], &Default::default(), &|_| ()).unwrap().0;
        let textures: Vec<TextureModel> = (0..3).map(learned).collect();
        let recordings: Vec<Vec<_>> =
            (0..3).map(|m| (0..2).map(|seed| recording(m, seed)).collect()).collect();
        let settings = TableSettings::default();
        let references: Vec<Vec<Reference>> = recordings
            .iter()
            .map(|recordings| {
                let references = recordings.iter().map(|it| Reference::new("a", 0, it, &settings));
                references.collect::<Result<_, _>>().unwrap()
            })
            .collect();
        let cell = |row, column: usize| {
            let errors = references[column].iter().map(|of| of.errors("row", row, &settings));
            Some(errors.collect::<Result<_, _>>().unwrap())
        };
        let errors = textures.iter().map(|texture| (0..3).map(|column| cell(texture, column)).collect());
        DifferenceTable::of_errors(names.clone(), names, errors.collect(), pooling)
    }

    #[test]
    fn every_texture_is_nearest_to_its_own_material() {
        for pooling in [Pooling::Pair, Pooling::All] {
            let table = table(pooling);
            let (margin, row, column) = table.smallest_margin().unwrap();
            assert!(margin > 0.0 && row != column, "{margin}");
            assert!(table.diagonal_is_least(), "{table:?}");
            assert!(table.baseline() > table.diagonal()[0]);
            for other in [Pooling::Pair, Pooling::All] {
                assert_eq!(table.pooled(other) == table, other == pooling);
                assert_eq!(table.pooled(other).pooled(pooling), table);
            }
        }
    }

    #[test]
    fn baseline_and_statistics_are_those_of_the_thesis() {
        let rows = [
            [4.50, 5.33, 6.29, 7.11, 7.48, 6.41],
            [5.46, 3.81, 4.54, 5.79, 5.52, 5.12],
            [6.04, 4.81, 3.91, 4.92, 4.68, 4.28],
            [6.62, 6.21, 5.11, 4.44, 4.47, 4.96],
            [7.13, 5.64, 5.13, 4.53, 4.04, 5.57],
            [6.05, 5.27, 4.27, 5.05, 4.95, 4.23],
        ];
        let names: Vec<String> = (1..=6).map(|i| format!("T{i}")).collect();
        let differences = rows.iter().map(|row| row.iter().copied().map(Some).collect()).collect();
        let table = DifferenceTable {
            rows: names.clone(),
            columns: names,
            differences,
            pooling: Pooling::Pair,
            errors: vec![],
        };
        assert!((table.baseline() - 4.72).abs() < 0.005, "{}", table.baseline());
        assert!(table.diagonal_is_least());
        assert!(!table.is_least_of_row(0, 1) && !table.is_least_of_column(0, 1));
        let below =
            table.differences.iter().flatten().flatten().filter(|d| **d < table.baseline()).count() - 6;
        assert_eq!(below, 6, "six cells off the diagonal lie below the baseline");
        // The experimenter's row of Table 2.2 is this diagonal.
        let diagonal = table.diagonal().into_iter().map(Some).collect();
        let people = DifferenceTable { rows: vec!["Exp".into()], differences: vec![diagonal], ..table };
        let (mean, deviation) = people.row_statistics()[0];
        assert!((mean - 4.155).abs() < 1e-3 && (deviation.unwrap() - 0.282).abs() < 1e-3);
        let alone = DifferenceTable { differences: vec![vec![Some(4.0), None]], ..people };
        assert_eq!(alone.row_statistics(), [(4.0, None)]);
    }
}
