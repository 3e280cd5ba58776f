//! The page of a study's analysis: which figures a phase has.

use crate::cli::beside::table;
use crate::engine::document::value::Name;
use crate::learning::evaluate::Merge;
use crate::report::plot::Plot;
use crate::report::study::{Interval, Psychometric, Section, intervals, map, scree, tree};
use haptograph_study::analyse::{Analysis, BesideRow, LevelRow, MeanRow, ThresholdRow};
use haptograph_study::document::{Line, Phase, Study};

/// Above the thesis's numbers.
const SAME: &str = "Numbers that the thesis prints, where they mean the same as one's own.";
/// Below a figure of ratings.
const INTERVALS: &str = "Means with their 95 % intervals over people.";
/// Below one of comparisons.
const MARKS: &str = "Means with their 95 % intervals over people. Different from the reference by Tukey's test, p < 0.05: \
                     * as in the thesis, † with repeated measures, each person against themselves.";

/// The page as HTML.
pub(super) fn page(study: &Study, analysis: &Analysis, beside: &[BesideRow]) -> String {
    let phases = study.phases.0.iter();
    let mut sections: Vec<Section> =
        phases.map(|(name, phase)| section(study, (&name.text, phase), analysis)).collect();
    sections.retain(|section| !section.plots.is_empty());
    if !beside.is_empty() {
        let (title, text) = ("Beside the thesis".to_owned(), SAME.to_owned());
        sections.push(Section { title, text, table: Some(table(beside)), ..Section::default() });
    }
    let warnings: Vec<String> = analysis.left_out.iter().map(|why| format!("Not computed: {why}")).collect();
    crate::report::study::page("Analysis", &study.about, analysis.simulated, &warnings, sections)
}

fn section(study: &Study, (name, phase): (&str, &Phase), analysis: &Analysis) -> Section {
    let means: Vec<&MeanRow> = analysis.means.iter().filter(|row| row.phase == name).collect();
    let reference = if let Phase::Compare(of) = phase { Some(study.reference(of)) } else { None };
    let mut plots: Vec<Plot> = ratings(study, &means, reference, analysis);
    plots.extend(space(name, analysis));
    plots.extend(thresholds(name, analysis));
    Section { title: name.to_owned(), plots, ..Section::default() }
}

/// A figure for each scale; with a reference, versions that differ from it are marked.
fn ratings(study: &Study, means: &[&MeanRow], reference: Option<&str>, analysis: &Analysis) -> Vec<Plot> {
    let interval = |row: &&MeanRow| Interval {
        row: row.surface.clone(),
        series: row.version.clone(),
        mean: row.mean,
        ends: row.low.zip(row.high),
        mark: reference.map_or_else(String::new, |reference| {
            analysis.marks(&row.phase, &row.surface, [&row.version, reference])
        }),
    };
    let figure = |(scale, line): &(Name, Line)| {
        let own = means.iter().filter(|row| row.scale == scale.text);
        let mut own: Vec<Interval> = own.map(interval).collect();
        // The reference is the first of a surface.
        own.sort_by_key(|of| (of.row.clone(), Some(&*of.series) != reference));
        let means = if reference.is_some() { MARKS } else { INTERVALS };
        let caption = format!("0: {}, 1: {}. {means}", line.from, line.to);
        (!own.is_empty()).then(|| Plot { caption, ..intervals(&scale.text, "Mean rating", &own) })
    };
    study.scales.0.iter().filter_map(figure).collect()
}

/// Scree, maps and tree of a phase of pairs.
fn space(phase: &str, analysis: &Analysis) -> Vec<Plot> {
    let places: Vec<_> = analysis.maps.places.iter().filter(|row| row.phase == phase).collect();
    if places.is_empty() {
        return Vec::new();
    }
    let stimuli: Vec<(String, String)> = places
        .iter()
        .map(|row| {
            let version = row.stimulus.rsplit_once(", ").map_or("", |(_, version)| version);
            (row.stimulus.clone(), version.to_owned())
        })
        .collect();
    let stress: Vec<f64> =
        analysis.maps.scree.iter().filter(|row| row.phase == phase).map(|row| row.stress).collect();
    let merges = analysis.maps.merges.iter().filter(|row| row.phase == phase);
    let merges: Vec<Merge> =
        merges.map(|row| Merge { groups: (row.first, row.second), distance: row.distance }).collect();
    let on = |axis: usize| places.iter().map(move |row| [Some(row.x), row.y, row.z][axis].unwrap_or(0.0));
    let labels = ["Dimension 1", "Dimension 2", "Dimension 3"];
    let seen = |axis: usize| {
        let points: Vec<(f64, f64)> = on(0).zip(on(axis)).collect();
        let caption =
            "Stimuli that lie close to each other were judged alike. The axes have no meaning of their own."
                .to_owned();
        Plot { caption, ..map(&stimuli, &points, [labels[0], labels[axis]]) }
    };
    let third = places.iter().any(|row| row.z.is_some()).then(|| seen(2));
    [scree(&stress), seen(1)].into_iter().chain(third).chain([tree(&stimuli, &merges)]).collect()
}

/// The psychometric function of a phase, and the threshold of each person.
fn thresholds(phase: &str, analysis: &Analysis) -> Vec<Plot> {
    let rows = || analysis.thresholds.iter().filter(|row| row.phase == phase);
    let Some(all) = rows().find(|row| row.participant.is_empty()) else { return Vec::new() };
    let levels = analysis.levels.iter().filter(|row| row.phase == phase && row.participant.is_empty());
    let points = pooled(&levels.collect::<Vec<_>>());
    let end = 1.05 * points.iter().fold(0.0_f64, |end, (level, _)| end.max(*level));
    let curve = |row: &ThresholdRow| -> Vec<(f64, f64)> {
        (0..=200).map(|at| f64::from(at) / 200.0 * end).map(|level| (level, row.at(level))).collect()
    };
    let figure = Psychometric {
        points,
        curve: curve(all),
        of_people: rows().filter(|row| !row.participant.is_empty()).map(curve).collect(),
        threshold: (all.low, all.threshold, all.high),
        share: all.at(all.threshold),
    };
    let each: Vec<Interval> = rows()
        .map(|row| Interval {
            row: if row.participant.is_empty() { "all".to_owned() } else { row.participant.clone() },
            mean: row.threshold,
            ends: Some((row.low, row.high)),
            ..Interval::default()
        })
        .collect();
    let fit = |plot: Plot| {
        let reach = each.iter().filter_map(|of| of.ends).fold(0.0_f64, |reach, (_, high)| reach.max(high));
        Plot { x: crate::report::plot::Axis { range: Some((0.0, 1.05 * reach)), ..plot.x }, ..plot }
    };
    let people = Plot {
        caption: "Thresholds with their 95 % intervals.".to_owned(),
        ..intervals("Thresholds", "Threshold, difference from the standard", &each)
    };
    vec![figure.plot("Psychometric function"), fit(people)]
}

/// Levels and shares of right answers; neighbouring levels together until they have a tenth of the trials, as those of a staircase are many.
fn pooled(levels: &[&LevelRow]) -> Vec<(f64, f64)> {
    let enough = levels.iter().map(|row| row.trials).sum::<u32>() / 10;
    let (mut points, mut sum) = (Vec::new(), (0.0, 0, 0));
    for (at, row) in levels.iter().enumerate() {
        sum = (sum.0 + row.level * f64::from(row.trials), sum.1 + row.trials, sum.2 + row.right);
        if sum.1 >= enough.max(1) || at + 1 == levels.len() {
            let trials = f64::from(sum.1);
            points.push((sum.0 / trials, f64::from(sum.2) / trials));
            sum = (0.0, 0, 0);
        }
    }
    points
}
