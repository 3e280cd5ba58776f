//! A study from its file to its data: orders, conditions, and what an interruption leaves.

#[path = "../../tests/skip/mod.rs"]
mod skip;

use haptograph_learning::evaluate::{Condition, condition_losses};
use haptograph_nodes::registry;
use haptograph_study::analyse::{Analysis, BesideRow, RelationRow};
use haptograph_study::check::{Checked, StudyError};
use haptograph_study::data::{DataError, Folder, Row, Status};
use haptograph_study::document::Phase;
use haptograph_study::people::{People, codes as people_codes};
use haptograph_study::power::EffectPower;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

fn shipped(name: &str) -> Checked {
    let path = Path::new("../graphs/studies").join(name);
    Checked::load(&path, None).expect("a valid study")
}

/// A folder of data of simulated people.
fn opened(path: &Path, study: &Checked, people: &People) -> Result<Folder, DataError> {
    Folder::open(path, &study.identity(Some(people.parameters())))
}

/// A study of the text, beside the shipped graphs.
fn written(folder: &Path, text: &str) -> Result<Checked, StudyError> {
    let graphs = fs::canonicalize("../graphs").expect("a folder");
    let path = folder.join("study.ron");
    fs::write(&path, text.replace("GRAPHS", &graphs.display().to_string())).expect("written");
    Checked::load(&path, None)
}

const GATED: &str = r#"Study(
    format: 1, graph: "GRAPHS/omni.ron", seed: 5,
    surfaces: { "tile": (file: "GRAPHS/surfaces/t3-tile.ron") },
    scales: { "s": (ask: "?", from: "a", to: "b") },
    phases: { "rating": Rate(opens_when: { "gate": (PORT) }) },
)"#;

fn codes(error: StudyError) -> Vec<&'static str> {
    match error {
        StudyError::Study(wrong) => wrong.list.iter().map(|one| one.code).collect(),
        other => panic!("{other}"),
    }
}

#[test]
fn every_shipped_study_runs_on_its_graph() {
    let mut count = 0;
    for entry in fs::read_dir("../graphs/studies").expect("a folder") {
        let path = entry.expect("an entry").path();
        let study = Checked::load(&path, None).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        study.check_graph(&registry()).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        count += 1;
    }
    assert_eq!(count, 5);
}

#[test]
fn the_page_shows_the_first_study_as_it_is() {
    let page = fs::read_to_string("../docs/studies.md").expect("a page");
    let file = fs::read_to_string("../graphs/studies/first.ron").expect("a study");
    let study = &file[file.find("Study(").expect("a study")..];
    assert!(page.contains(study));
    let shown = &page[page.find("People(\n").expect("people")..];
    let folder = tempfile::tempdir().expect("a folder");
    let shown = &shown[..shown.find("```").expect("an end")];
    assert_eq!(people(folder.path(), &shipped("responsiveness.ron"), shown).lapse, 0.02);
}

#[test]
fn the_thesis_s_studies_have_its_numbers_of_trials() {
    let count = |study: &Checked, group, phase: &str| {
        let trials = study.study.trials("7", group);
        trials.iter().filter(|trial| study.study.phases.0[trial.phase].0.text == phase).count()
    };
    let textures = shipped("real-and-virtual.ron");
    assert_eq!(count(&textures, 0, "pairs"), 45);
    assert_eq!(count(&textures, 1, "free exploration"), 10);
    assert_eq!(count(&textures, 1, "adjectives"), 44);
    assert_eq!(count(&textures, 1, "pairs"), 0);
    // Six surfaces stand for fifteen.
    assert_eq!(count(&shipped("responsiveness.ron"), 0, "similarity"), 6 * 4);
    assert_eq!(count(&shipped("components.ron"), 0, "similarity"), 6 * 4);
    assert_eq!(count(&shipped("components.ron"), 1, "similarity"), 0);
}

/// Pearson's chi squared over its degrees of freedom.
fn unevenness(counts: &BTreeMap<impl Ord, usize>) -> f64 {
    let expected = counts.values().sum::<usize>() as f64 / counts.len() as f64;
    let squares: f64 = counts.values().map(|count| (*count as f64 - expected).powi(2) / expected).sum();
    squares / (counts.len() - 1) as f64
}

#[test]
fn orders_are_even_over_people_and_nested_as_written() {
    let (study, pairs) = (shipped("responsiveness.ron"), shipped("real-and-virtual.ron"));
    let (mut surfaces, mut versions, mut sides) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    for person in 0..2_000 {
        let code = format!("P{person}");
        let trials = study.study.trials(&code, 0);
        let own: Vec<_> = trials.iter().filter_map(|trial| trial.second).collect();
        for (place, four) in own.chunks(4).enumerate() {
            let of: BTreeSet<usize> = four.iter().map(|stimulus| stimulus.surface).collect();
            assert_eq!(of.len(), 1, "all versions of a surface before the next");
            *surfaces.entry((place, four[0].surface)).or_insert(0) += 1;
            *versions.entry(four[0].version).or_insert(0) += 1;
        }
        let trials = pairs.study.trials(&code, 0);
        let swapped = trials.iter().filter(|trial| trial.second.is_some() && trial.is_swapped).count();
        assert!((22..=23).contains(&swapped), "{swapped} of 45");
        let first = trials.iter().find(|trial| trial.second.is_some()).expect("pairs");
        *sides.entry(first.is_swapped).or_insert(0) += 1;
    }
    assert_eq!((surfaces.len(), versions.len(), sides.len()), (36, 4, 2));
    for uneven in [unevenness(&surfaces), unevenness(&versions), unevenness(&sides)] {
        assert!(uneven < 4.0, "{uneven}");
    }
}

#[test]
fn an_order_depends_on_the_seed_and_the_code_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = |seed: u64| {
        format!(
            r#"Study(format: 1, graph: "GRAPHS/omni.ron", seed: {seed},
            surfaces: {{ "a": (file: "GRAPHS/surfaces/t3-tile.ron"), "b": (file: "GRAPHS/surfaces/t3-tile.ron"), "c": (file: "GRAPHS/surfaces/t3-tile.ron"), "d": (file: "GRAPHS/surfaces/t3-tile.ron") }},
            scales: {{ "s": (ask: "?", from: "a", to: "b") }},
            phases: {{ "r": Rate(repeats: 3, training: 2, order: [Shuffle(Surface)]) }})"#
        )
    };
    let one = written(folder.path(), &text(1)).expect("valid");
    let two = written(folder.path(), &text(2)).expect("valid");
    assert_eq!(one.study.trials("P1", 0), one.study.trials("P1", 0));
    assert_ne!(one.study.trials("P1", 0), one.study.trials("P2", 0));
    assert_ne!(one.study.trials("P1", 0), two.study.trials("P1", 0));
    let trials = one.study.trials("P1", 0);
    assert_eq!((trials.len(), trials.iter().filter(|trial| trial.is_training).count()), (14, 2));
}

#[test]
fn wrong_studies_are_refused_at_their_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let with = |from: &str, to: &str| written(folder.path(), &GATED.replace(from, to));
    let right = r#"port: "way so far", at_least_cm: 50"#;
    let study = with("PORT", right).expect("valid");
    study.check_graph(&registry()).expect("valid on its graph");
    assert_eq!(codes(with("PORT", r#"port: "way so far", at_least_parsec: 1"#).unwrap_err()), ["E0204"]);
    let of_graph =
        |port: &str| codes(with("PORT", port).expect("names").check_graph(&registry()).unwrap_err());
    assert_eq!(of_graph(r#"port: "way so fra", at_least_cm: 50"#), ["E0203"]);
    assert_eq!(of_graph(r#"port: "way so far", at_least_s: 5"#), ["E0404"]);
    let text = GATED.replace("PORT", right);
    let wrong = |from: &str, to: &str| codes(written(folder.path(), &text.replace(from, to)).unwrap_err());
    assert_eq!(wrong("Rate(", r#"Rate(scales: ["t"], surfaces: ["tiles"], groups: ["g"], "#), ["E0303"; 3]);
    assert_eq!(wrong("Rate(", "Rate(stimuli: [Real], "), ["E0304"]);
    assert_eq!(wrong("Rate(", "Rate(order: [Shuffle(Surface), Fixed(Surface)], "), ["E0304"]);
    assert_eq!(wrong("Rate(", "Rte("), ["E0303"]);
    assert_eq!(wrong("seed: 5", "sead: 5, grahp: 1"), ["E0204", "E0204"]);
}

#[test]
fn more_than_the_thesis_s_actuators_gave_needs_the_experimenter_s_word() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = fs::read_to_string("../graphs/texturepad.ron").expect("a graph");
    let graphs = fs::canonicalize("../graphs").expect("a folder").display().to_string();
    let graph =
        graph.replace("peak_a: 0.5", "peak_a: 0.6").replace("surfaces/", &format!("{graphs}/surfaces/"));
    fs::write(folder.path().join("strong.ron"), graph).expect("written");
    let text = r#"Study(format: 1, graph: "strong.ron", WORD surfaces: { "t": (file: "GRAPHS/surfaces/t3-tile.ron") },
        scales: { "s": (ask: "?", from: "a", to: "b") }, phases: { "r": Rate() })"#;
    let check = |word: &str| {
        written(folder.path(), &text.replace("WORD", word)).expect("valid").check_graph(&registry())
    };
    assert!(matches!(check(""), Err(StudyError::TooStrong { peak, usual: 0.5, .. }) if peak == 0.6));
    check(r#"stronger_because: "the actuator is glued to a heavy tool","#).expect("said why");
}

/// The state of the only trial of a study with this condition, whose simulated hand has so long.
fn status(condition: &str, longest_s: f64) -> (Status, f64) {
    let folder = tempfile::tempdir().expect("a folder");
    let study = written(folder.path(), &GATED.replace("PORT", condition)).expect("valid");
    let data = opened(&folder.path().join("data"), &study, &People::indifferent()).expect("a folder");
    let mut claim = data.claim("S1", "all", true).expect("free");
    let people = People::indifferent();
    study.simulate(&registry(), (&mut claim, 0), &people, Some(longest_s), usize::MAX).expect("it runs");
    let row = claim.rows()[0].clone();
    let measure = data.measures().expect("measures").remove(0);
    (row.status, measure.value)
}

#[test]
fn an_answer_opens_when_its_condition_is_reached_and_not_before() {
    let (reached, way_m) = status(r#"port: "way so far", at_least_cm: 50"#, 60.0);
    assert_eq!(reached, Status::Answered);
    assert!((0.5..0.51).contains(&way_m), "{way_m}");
    // Just before that the hand has dragged 49.9 cm.
    let (missed, way_m) = status(r#"port: "way so far", at_least_cm: 1000"#, 4.0);
    assert_eq!(missed, Status::Forced);
    assert!(way_m < 10.0);
    let (reached, taps) = status(r#"port: "taps so far", at_least: 4"#, 60.0);
    assert_eq!((reached, taps), (Status::Answered, 4.0));
}

fn row(trial: u32, rating: f64) -> Row {
    Row {
        trial,
        phase: "rating".to_owned(),
        rating: Some(rating),
        text: "a,\n\"b\"".to_owned(),
        ..Row::default()
    }
}

#[test]
fn an_interruption_at_any_byte_loses_no_answer_and_doubles_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = shipped("first.ron");
    let data = opened(folder.path(), &study, &People::indifferent()).expect("a folder");
    let mut claim = data.claim("S1", "all", true).expect("free");
    for trial in 1..=3 {
        claim.keep(row(trial, 0.25), &[("way".to_owned(), 1.5, "m".to_owned())]).expect("kept");
    }
    drop(claim);
    let (trials, measures) = (folder.path().join("trials.csv"), folder.path().join("measures.csv"));
    let whole = (fs::read(&trials).expect("trials"), fs::read(&measures).expect("measures"));
    let last = whole.0[..whole.0.len() - 1].iter().rposition(|byte| *byte == b'\n').expect("lines") + 1;
    for cut in last..whole.0.len() {
        fs::write(&trials, &whole.0[..cut]).expect("cut");
        assert_eq!(data.rows().expect("rows").len(), 2, "cut at {cut}");
        let mut claim = data.claim("S1", "all", true).expect("free");
        claim.keep(row(3, 0.5), &[("way".to_owned(), 2.5, "m".to_owned())]).expect("kept");
        let way = data.measures().expect("measures").into_iter().map(|of| (of.trial, of.value));
        assert_eq!(
            way.collect::<Vec<_>>(),
            [(1, 1.5), (2, 1.5), (3, 2.5)],
            "numbers of the new attempt alone"
        );
        let rows = claim.rows();
        let numbers: Vec<(u32, u32)> = rows.iter().map(|row| (row.trial, row.attempt)).collect();
        assert_eq!(numbers, [(1, 1), (2, 1), (3, 1)]);
        assert_eq!(rows[2].rating, Some(0.5));
        assert_eq!(rows[2].text, "a, \"b\"", "a trial is a line");
    }
}

#[test]
fn killed_between_any_two_trials_a_study_goes_on_as_if_nothing_had_happened() {
    let study = shipped("real-and-virtual.ron");
    let run = |most: usize| {
        let folder = tempfile::tempdir().expect("a folder");
        let data = opened(folder.path(), &study, &People::indifferent()).expect("a folder");
        loop {
            // Each time as a new program would.
            let mut claim = data.claim("S1", "E", true).expect("free");
            let people = People::indifferent();
            let done = study.simulate(&registry(), (&mut claim, 1), &people, None, most);
            if done.expect("it runs") == 0 {
                break;
            }
        }
        let rows = data.rows().expect("rows").into_iter();
        rows.map(|row| (row.trial, row.attempt, row.scale, row.rating, row.choice)).collect::<Vec<_>>()
    };
    let whole = run(usize::MAX);
    assert_eq!(whole.len(), 54);
    for most in [1, 7, 53] {
        assert_eq!(run(most), whole);
    }
}

#[test]
fn two_programs_cannot_run_one_participant() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = shipped("first.ron");
    let data = opened(folder.path(), &study, &People::indifferent()).expect("a folder");
    let mut claim = data.claim("S1", "all", true).expect("free");
    assert_eq!(data.claim("S1", "all", true).err(), Some(DataError::Busy { code: "S1".to_owned() }));
    data.claim("S2", "all", true).expect("another one");
    // A computer that shares the folder without locks.
    let header = "participant,group,trial,attempt,status,phase,training,scale,first_surface,first_version,second_surface,\
                  second_version,second_is_left_or_earlier,level,rating,choice,is_right,text,exploration_s,response_s,\
                  simulated,session,time_utc,surface_sha256\n";
    let line = "S1,all,1,1,answered,rating,false,,,,,,false,,0.5,,,,0,0,true,other,now,\n";
    fs::write(folder.path().join("trials.csv"), format!("{header}{line}")).expect("written");
    assert_eq!(claim.keep(row(1, 0.1), &[]), Err(DataError::OtherSession { code: "S1".to_owned() }));
    assert_eq!(data.rows().expect("rows").len(), 1);
}

#[test]
fn a_participant_who_withdraws_leaves_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = shipped("first.ron");
    let data = opened(folder.path(), &study, &People::indifferent()).expect("a folder");
    for code in ["S1", "S2"] {
        let mut claim = data.claim(code, "all", true).expect("free");
        claim.keep(row(1, 0.25), &[("way".to_owned(), 1.5, "m".to_owned())]).expect("kept");
        let signals = folder.path().join("signals").join(code).join("1");
        fs::create_dir_all(&signals).expect("made");
    }
    let analysis = folder.path().join("analysis");
    fs::create_dir_all(&analysis).expect("made");
    ["means.csv", "analysis.html"]
        .iter()
        .for_each(|name| fs::write(analysis.join(name), "S1").expect("written"));
    data.remove("S1").expect("removed");
    assert_eq!(fs::read_dir(&analysis).expect("a folder").count(), 0);
    assert_eq!(data.rows().expect("rows").len(), 1);
    assert!(!folder.path().join("signals/S1").exists() && folder.path().join("signals/S2").exists());
    let tables = ["trials.csv", "measures.csv"].map(|name| fs::read_to_string(folder.path().join(name)));
    assert!(tables.into_iter().all(|text| !text.expect("a table").contains("S1")));
    let left = data.participants().expect("participants").remove(0);
    assert!(!left.withdrawn_utc.is_empty() && left.consent_utc.is_empty());
    assert!(matches!(data.claim("S1", "all", true), Err(DataError::Withdrawn { .. })));
    assert!(matches!(data.remove("S9"), Err(DataError::Unknown { .. })));
    for code in ["", "../x", "a b", &"x".repeat(33)] {
        assert!(matches!(data.claim(code, "all", true), Err(DataError::Code { .. })), "{code}");
    }
}

#[test]
fn a_folder_keeps_to_its_study() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = shipped("first.ron");
    opened(folder.path(), &study, &People::indifferent()).expect("new");
    opened(folder.path(), &study, &People::indifferent()).expect("again");
    assert!(matches!(Folder::open(folder.path(), &study.identity(None)), Err(DataError::Mixed { .. })));
    let other = shipped("components.ron");
    assert!(matches!(
        opened(folder.path(), &other, &People::indifferent()),
        Err(DataError::OtherStudy { .. })
    ));
    let others = People { lapse: 0.5, ..People::indifferent() };
    let mixed = opened(folder.path(), &study, &others);
    assert!(matches!(mixed, Err(DataError::OtherPeople { .. })));
    assert!(matches!(Folder::existing(&folder.path().join("none")), Err(DataError::NoStudy { .. })));
}

fn people(folder: &Path, study: &Checked, text: &str) -> People {
    let path: PathBuf = folder.join("people.ron");
    fs::write(&path, text).expect("written");
    People::load(&path, study).expect("people")
}

#[test]
fn the_analysis_finds_what_simulated_people_prefer() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = shipped("responsiveness.ron");
    let people = people(
        folder.path(),
        &study,
        r#"People(format: 1, noise_sd: 0.05, values: { "similarity": { "silk, phi": -0.3, "silk": 0.1 } })"#,
    );
    let data = opened(&folder.path().join("data"), &study, &People::indifferent()).expect("a folder");
    for code in people_codes(15) {
        let mut claim = data.claim(&code, "all", true).expect("free");
        study.simulate(&registry(), (&mut claim, 0), &people, None, usize::MAX).expect("it runs");
    }
    let analysis = Analysis::of(&data.study().expect("a copy"), &data).expect("analysed");
    assert!(analysis.simulated && analysis.left_out.is_empty(), "{:?}", analysis.left_out);
    let silk =
        analysis.means.iter().find(|row| row.surface == "silk" && row.version == "phi").expect("a mean");
    assert!((silk.mean - 0.3).abs() < 0.1, "{}", silk.mean);
    assert_eq!(silk.people, 15);
    let (low, high) = (silk.low.expect("an end"), silk.high.expect("an end"));
    // t of 14 degrees of freedom: 2.1448.
    assert!((high - low - 2.0 * 2.144_787 * silk.sd / 15_f64.sqrt()).abs() < 1e-6, "{low} {high}");
    assert_eq!(analysis.marks("similarity", "silk", ["phi", "FS"]), "*†");
    assert_eq!(analysis.marks("similarity", "silk", ["F", "FS"]), "");
    let p = |surface: &str, test: &str| {
        let row = analysis.variance.iter().find(|row| row.of == surface && row.test == test).expect("a row");
        assert_eq!(row.df, 3.0);
        row.p
    };
    for test in ["as in the thesis", "repeated measures", "ranks"] {
        assert!(p("silk", test) < 1e-4, "{test}");
    }
    let compared =
        analysis.comparisons.iter().filter(|row| row.test == "repeated measures" && row.surface == "silk");
    let compared: Vec<(&str, &str, f64)> = compared.map(|row| (&*row.from, &*row.to, row.p)).collect();
    assert_eq!(compared.len(), 6);
    for (from, to, p) in compared {
        assert_eq!(p < 1e-3, to == "phi" || from == "phi", "{from} {to} {p}");
    }
    let size = analysis.comparisons.iter().find(|row| row.surface == "silk" && row.d_z.is_some());
    let size = size.expect("a size of the effect");
    assert!(
        size.test == "repeated measures" && size.d_z_low < size.d_z && size.d_z < size.d_z_high,
        "{size:?}"
    );
    for (name, table) in analysis.tables().expect("tables") {
        let mut lines = table.lines();
        assert!(lines.next().is_none_or(|header| header.ends_with(",simulated")), "{name}");
        assert!(lines.all(|line| line.ends_with(",true")), "{name}");
    }
    // Without an effect two versions are the same within a tenth, with one of 0.3 they are not.
    let compare =
        study.study.phases.0.iter().position(|(name, _)| name.text == "similarity").expect("a phase");
    let mut bounded = study.study.clone();
    let Phase::Compare(phase) = &mut bounded.phases.0[compare].1 else { panic!("a comparison") };
    phase.same_within = Some(0.1);
    let analysis = Analysis::of(&bounded, &data).expect("analysed");
    let p = |of: &str, with: &str| {
        analysis.relations.iter().find(|row| (&*row.of, &*row.with) == (of, with)).expect("a test").p
    };
    assert!(p("tile, F", "tile, FS") < 0.05 && p("silk, F", "silk, phi") > 0.9);
}

#[test]
fn a_staircase_of_simulated_people_gives_their_threshold_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron", seed: 3,
        surfaces: { "tile": (file: "GRAPHS/surfaces/t3-tile.ron") },
        phases: {
            "fixed": ConstantStimuli(ask: "Which is stronger?", surface: "tile", parameter: "gain", standard: 0.4,
                levels: [0.42, 0.45, 0.5, 0.6, 0.8], repeats: 40),
            "stairs": Staircase(ask: "Which is stronger?", surface: "tile", parameter: "gain", standard: 0.4,
                limits: (0.4, 1.0), method: UpDown(start: 0.8, steps: [0.1, 0.05, 0.02], reversals: 40), at_most: 200),
        })"#;
    let study = written(folder.path(), text).expect("valid");
    study.check_graph(&registry()).expect("on its graph");
    let people = people(folder.path(), &study, "People(format: 1, threshold: 0.1)");
    let data = opened(&folder.path().join("data"), &study, &People::indifferent()).expect("a folder");
    for code in people_codes(4) {
        let mut claim = data.claim(&code, "all", true).expect("free");
        study.simulate(&registry(), (&mut claim, 0), &people, None, usize::MAX).expect("it runs");
    }
    let analysis = Analysis::of(&study.study, &data).expect("analysed");
    let all: Vec<_> = analysis.thresholds.iter().filter(|row| row.participant.is_empty()).collect();
    assert_eq!(all.len(), 2, "{:?}", analysis.left_out);
    // Half of the differences of 0.1 are known: 75 % right, the middle of the function.
    for row in all {
        assert!((row.threshold - 0.1).abs() < 0.025, "{}: {}", row.phase, row.threshold);
        let answers = analysis.levels.iter().filter(|of| of.phase == row.phase && of.participant.is_empty());
        assert_eq!(answers.map(|of| of.trials).sum::<u32>(), row.trials);
        // Half of what is left between guesses and lapses.
        assert!((row.at(row.threshold) - (0.75 - row.lapse / 2.0)).abs() < 1e-12);
    }
}

#[test]
fn a_removal_can_be_repeated_and_leaves_a_table_that_others_go_on_with() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = shipped("first.ron");
    let data = opened(folder.path(), &study, &People::indifferent()).expect("a folder");
    let mut other = data.claim("S2", "all", true).expect("free");
    data.claim("S1", "all", true).expect("free").keep(row(1, 0.25), &[]).expect("kept");
    let trials = folder.path().join("trials.csv");
    let whole = fs::read(&trials).expect("trials");
    data.remove("S1").expect("removed");
    // As if it had been interrupted before the table of trials.
    fs::write(&trials, whole).expect("written");
    assert_eq!(data.answers().expect("answers").len(), 0, "who has withdrawn is not analysed");
    data.remove("S1").expect("removed again");
    other.keep(row(1, 0.5), &[]).expect("kept");
    let rows = data.answers().expect("answers");
    assert_eq!((rows.len(), &*rows[0].participant), (1, "S2"));
}

#[test]
fn a_participant_keeps_to_a_group_and_a_folder_without_its_study_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = shipped("components.ron");
    let data = opened(folder.path(), &study, &People::indifferent()).expect("a folder");
    drop(data.claim("S1", "1", true).expect("free"));
    assert!(matches!(data.claim("S1", "2", true), Err(DataError::OtherGroup { .. })));
    fs::remove_file(folder.path().join("study.json")).expect("removed");
    let swapped = opened(folder.path(), &shipped("first.ron"), &People::indifferent());
    assert!(matches!(swapped, Err(DataError::OtherStudy { .. })));
}

#[test]
fn what_a_participant_would_meet_first_is_found_by_a_check() {
    let folder = tempfile::tempdir().expect("a folder");
    let with = |phases: &str| {
        let text = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron",
            surfaces: { "tile": (file: "GRAPHS/surfaces/t3-tile.ron"), "broken": (file: "broken.ron"), "rock": (sample: "tray") },
            scales: { "s": (ask: "?", from: "a", to: "b") }, phases: { PHASES })"#;
        written(folder.path(), &text.replace("PHASES", phases))
    };
    let wrong = |phases: &str| codes(with(phases).unwrap_err());
    assert_eq!(wrong(r#""r": Rate(surfaces: ["tile"])"#), ["E0108"]);
    fs::write(folder.path().join("broken.ron"), "Surface(").expect("written");
    let broken = with(r#""r": Rate(surfaces: ["tile"])"#).expect("names").check_graph(&registry());
    assert!(matches!(broken, Err(StudyError::Graph { of, .. }) if of == "broken, virtual"));
    let study = with(r#""r": Rate(stimuli: [Real, Virtual], surfaces: ["tile", "rock"])"#).expect("names");
    assert_eq!(study.study.lacking(&study.study.phases.0[0].1), ["tile", "rock"]);
    let constant =
        r#""c": ConstantStimuli(ask: "?", surface: "rock", parameter: "gain", standard: 1, levels: [2])"#;
    assert_eq!(wrong(constant), ["E0304"]);
    assert_eq!(wrong(r#""r": Rate(surfaces: ["tile", "tile"])"#), ["E0105"]);
    assert_eq!(wrong(r#""q": Questions(questions: { "a": Number(ask: "?", from: 2, to: 1) })"#), ["E0304"]);
    assert_eq!(wrong(r#""a\nb": Rate()"#), ["E0211"]);
    assert_eq!(wrong(""), ["E0304"]);
    // Far more trials than memory holds are counted, not made.
    let many: String = (0..20_000).map(|level| format!("{level}, ")).collect();
    let many = format!(
        r#""c": ConstantStimuli(ask: "?", surface: "tile", parameter: "gain", standard: 1, repeats: 1000, levels: [{many}])"#
    );
    assert_eq!(wrong(&many), ["E0304"]);
    let squares: String = (0..64).map(|at| format!(r#""r{at}": Rate(order: [Latin(Surface)]), "#)).collect();
    // Two virtual surfaces in each of 64 phases: one number serves them all.
    assert_eq!(with(&squares).expect("valid").study.balanced_by(0), Some(2));
}

#[test]
fn the_end_of_a_scale_at_which_two_are_the_same_changes_no_result() {
    let analysis = |end: &str| {
        let folder = tempfile::tempdir().expect("a folder");
        let text = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron",
            surfaces: { "a": (sample: "1"), "b": (sample: "2"), "c": (sample: "3"), "d": (sample: "4"), "e": (sample: "5") },
            scales: { "s": (ask: "?", from: "a", to: "b"), "r": (ask: "?", from: "a", to: "b") },
            phases: { "p": Pairs(scale: "s", same_is: END), "r": Rate(stimuli: [Real], scales: ["r"]) })"#;
        let study = written(folder.path(), &text.replace("END", end)).expect("valid");
        let people = people(
            folder.path(),
            &study,
            r#"People(format: 1, bias_sd: 0.0, noise_sd: 0.02,
                values: { "r": { "a": -0.4, "b": -0.1, "c": 0.0, "d": 0.2, "e": 0.4 } },
                places: { "a, real": [0.0], "b, real": [0.3], "c, real": [0.4], "d, real": [0.6], "e, real": [0.8] })"#,
        );
        let data = opened(&folder.path().join("data"), &study, &People::indifferent()).expect("a folder");
        for code in people_codes(5) {
            let mut claim = data.claim(&code, "all", true).expect("free");
            study.simulate(&registry(), (&mut claim, 0), &people, None, usize::MAX).expect("it runs");
        }
        Analysis::of(&study.study, &data).expect("analysed")
    };
    let (from, to) = (analysis("From"), analysis("To"));
    assert_eq!((from.relations.len(), to.relations.len()), (1, 1), "{:?}", from.left_out);
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    assert!(
        near(from.relations[0].value, to.relations[0].value),
        "{} {}",
        from.relations[0].value,
        to.relations[0].value
    );
    assert_eq!(from.maps.merges.len(), 4, "a tree of five");
    assert!(from.maps.scree.iter().zip(&to.maps.scree).all(|(a, b)| near(a.stress, b.stress)));
}

#[test]
fn a_table_that_a_spreadsheet_saved_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = shipped("first.ron");
    let data = opened(folder.path(), &study, &People::indifferent()).expect("a folder");
    data.claim("S1", "all", true).expect("free").keep(row(1, 0.25), &[]).expect("kept");
    let path = folder.path().join("trials.csv");
    let text = fs::read_to_string(&path).expect("a table");
    let saved = text.replace("false", "FALSE").replace("true", "TRUE").replace('\n', "\r\n");
    fs::write(&path, format!("\u{feff}{saved}")).expect("written");
    let rows = data.rows().expect("rows");
    assert_eq!((rows.len(), rows[0].training, rows[0].simulated), (1, false, true));
    data.claim("S1", "all", true).expect("free").keep(row(2, 0.5), &[]).expect("kept");
    assert_eq!(data.rows().expect("rows").len(), 2);
}

#[test]
fn a_code_without_a_number_has_no_row_of_a_latin_square() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |order: &str| {
        let text = GATED.replace("opens_when: { \"gate\": (PORT) }", order);
        written(folder.path(), &text).expect("valid")
    };
    let latin = of("order: [Latin(Surface)]");
    latin.check_code("P07").expect("a code");
    assert!(matches!(latin.check_code("Anna"), Err(DataError::NoNumber { .. })));
    of("order: [Shuffle(Surface)]").check_code("Anna").expect("a code");
    assert!(matches!(latin.check_code("a\nb1"), Err(DataError::Code { .. })));
}

#[test]
fn the_power_of_simulated_studies_is_that_of_the_noncentral_f() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron", seed: 22,
        surfaces: { "tile": (file: "GRAPHS/surfaces/t3-tile.ron", sample: "tray 1"), "vinyl": (file: "GRAPHS/surfaces/t5-vinyl.ron", sample: "tray 2") },
        versions: { "a": {}, "b": { "gain": 0.5 } },
        scales: { "s": (ask: "?", from: "a", to: "b") },
        phases: { "compared": Compare(scale: "s", training: 1) })"#;
    let study = written(folder.path(), text).expect("valid");
    let people = people(
        folder.path(),
        &study,
        r#"People(format: 1, noise_sd: 0.1, bias_sd: 0.05, values: { "s": { "tile, b": 0.1 } })"#,
    );
    let sizes = [vec![8], vec![15]];
    let stop = AtomicBool::new(false);
    let found = study.power(&people, (&sizes, 1_000), &|_| (), &stop).expect("simulated");
    let again = || study.power(&people, (&sizes, 20), &|_| (), &stop).expect("simulated");
    assert_eq!(again(), again());
    let of = |surface: &str, term: &str| {
        let is_it =
            |row: &&EffectPower| (&*row.of, &*row.test, &*row.term) == (surface, "repeated measures", term);
        &found.iter().find(is_it).expect("an effect").shares
    };
    // R 4.2.2: 1 - pf(qf(0.95, 1, n - 1), 1, n - 1, ncp = n * 0.1^2 / (2 * 0.1^2)) for n = 8 and 15; 5 % without an effect.
    for (surface, powers) in [("tile", [0.408_033_1, 0.721_523_9]), ("vinyl", [0.05, 0.05])] {
        for term in ["version", "a to b"] {
            for (share, power) in of(surface, term).iter().zip(powers) {
                assert!(share.low < power && power < share.high, "{surface}, {term}: {share:?}, {power}");
            }
        }
    }
    let refused = |sizes: &[Vec<usize>], repeat| match study.power(&people, (sizes, repeat), &|_| (), &stop) {
        Err(StudyError::Run(message)) => message,
        other => panic!("{other:?}"),
    };
    assert!(refused(&[vec![10_000]], 10_000).contains("lower --people or --repeat"));
    assert!(refused(&[vec![1_000_000]], 1).contains("lower --people"));
    assert!(refused(&[vec![1]], 3).contains("so few people"));
    stop.store(true, Ordering::Relaxed);
    assert!(refused(&sizes, 10).contains("stopped"));
}

#[test]
fn a_study_takes_its_trials_and_what_their_conditions_ask_for() {
    let minutes = |study: &Checked, group| study.study.duration_s(&study.study.trials("1", group)) / 60.0;
    // 33 trials of 15 s, 24 of them with four conditions of 5 s.
    let study = shipped("responsiveness.ron");
    assert_eq!(minutes(&study, 0), (33.0 * 15.0 + 24.0 * 20.0) / 60.0);
    assert_eq!(study.rendered().len(), 6 * 4);
    // A distance and taps have no time of their own.
    let study = shipped("components.ron");
    assert_eq!(minutes(&study, 0), 48.0 * 15.0 / 60.0);
    // Group 2 rates what group 1 compares.
    assert_eq!(study.rendered().len(), 6 * 4);
}

type Table = BTreeMap<String, BTreeMap<String, f64>>;

/// The numbers of a CSV table by the words of their lines, without the columns that the script does not have.
fn numbers(text: &str) -> Table {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let names = reader.headers().expect("a header").clone();
    let mut table = Table::new();
    for line in reader.records() {
        let line = line.expect("a line");
        let cells = || names.iter().zip(line.iter()).filter(|(name, _)| *name != "simulated");
        let words =
            ["phase", "test", "of", "term", "surface", "from", "to", "kind", "with", "pair", "participant"];
        // A correlation is that of its scales in any order.
        let mut key: Vec<&str> =
            cells().filter(|(name, _)| words.contains(name)).map(|(_, cell)| cell).collect();
        key.sort_unstable();
        let number = |(name, cell): (&str, &str)| Some((name.to_owned(), cell.parse().ok()?));
        assert!(table.insert(key.join("|"), cells().filter_map(number).collect()).is_none(), "{key:?} twice");
    }
    table
}

/// Runs the script for R in a folder of data, and compares all of its numbers with those of the analysis; how many there were.
fn compare_with_r(data: &Folder, locale: &str) -> Option<usize> {
    let study = data.study().expect("a study");
    let analysis = Analysis::of(&study, data).expect("analysed");
    let folder = data.path().join("analysis");
    fs::create_dir_all(&folder).expect("a folder");
    fs::write(folder.join("analysis.R"), study.r_script()).expect("written");
    let run = Command::new("Rscript").arg(folder.join("analysis.R")).env("LC_ALL", locale).output().ok()?;
    let (out, errors) = (String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    // So R prints what a locale does not have.
    let letters = [("<U+00E9>", "é"), ("<U+00DF>", "ß"), ("<U+00E4>", "ä")];
    let out = letters.iter().fold(out.into_owned(), |out, (code, letter)| out.replace(code, letter));
    assert!(run.status.success(), "{errors}");
    assert_eq!(out.contains("# map of "), out.contains("\n# 3 "), "{out}");
    let own: BTreeMap<_, _> = analysis.tables().expect("tables").into_iter().collect();
    let mut count = 0;
    for name in ["variance", "comparisons", "relations", "abx"] {
        let Some((_, text)) = out.split_once(&format!("# {name}\n")) else {
            assert!(!own.contains_key(&*format!("{name}.csv")), "{name}: {out}");
            continue;
        };
        let (theirs, own) =
            (numbers(text.split("\n#").next().unwrap_or("")), numbers(&own[&*format!("{name}.csv")]));
        assert_eq!(own.keys().collect::<Vec<_>>(), theirs.keys().collect::<Vec<_>>(), "{name}");
        for (key, line) in &theirs {
            for (column, value) in line {
                let ours = own[key].get(column).unwrap_or_else(|| panic!("{name}, {key}: no {column}"));
                assert!(
                    (ours - value).abs() <= 1e-6 * value.abs().max(1.0),
                    "{name}, {key}, {column}: {ours} {value}"
                );
                count += 1;
            }
            for column in ["f", "p", "difference", "value", "d_prime", "d_prime_high", "p_of_people"] {
                assert_eq!(
                    own[key].contains_key(column),
                    line.contains_key(column),
                    "{name}, {key}, {column}"
                );
            }
        }
    }
    Some(count)
}

#[test]
fn r_finds_the_same_statistics() {
    let all_of = |study: &Checked, text: &str, odd: bool| {
        let folder = tempfile::tempdir().expect("a folder");
        let people = people(folder.path(), study, text);
        // A space in its path.
        let data = opened(&folder.path().join("the data"), study, &People::indifferent()).expect("a folder");
        let groups = study.study.group_count();
        for (number, code) in people_codes(7 * groups).enumerate() {
            let mut claim = data.claim(&code, study.study.group_name(number % groups), true).expect("free");
            study
                .simulate(&registry(), (&mut claim, number % groups), &people, None, usize::MAX)
                .expect("it runs");
            let again = claim.rows()[claim.rows().len() - 1].clone();
            if odd && number == 2 {
                claim.keep(Row { status: Status::Skipped, rating: None, ..again }, &[]).expect("kept");
            } else if odd && number == 3 {
                claim.keep(Row { rating: Some(0.1), ..again }, &[]).expect("kept");
            }
        }
        if odd {
            data.remove("S006").expect("removed");
            let path = folder.path().join("the data/trials.csv");
            let text = fs::read_to_string(&path).expect("trials");
            fs::write(&path, format!("\u{feff}{text}S001,all,1,2,answe")).expect("written");
        }
        ["C", "C.UTF-8"].map(|locale| compare_with_r(&data, locale))
    };
    let pairs = r#"People(format: 1, values: { "roughness": { "T1": 0.2, "T4": -0.3 } }, places: { "T1, real": [0.2, 0.1],
        "T2, real": [0.5, 0.1], "T3, real": [0.3, 0.6], "T4, virtual": [0.1, 0.9], "T5, real": [0.4, 0.2], "T1, virtual": [0.7, 0.0],
        "T2, virtual": [0.2, 0.8], "T3, virtual": [0.5, 0.5], "T4, real": [0.9, 0.9], "T5, virtual": [0.6, 0.3] })"#;
    let effect = r#"People(format: 1, values: { "similarity": { "silk": 0.2, "tile": -0.1 } })"#;
    let folder = tempfile::tempdir().expect("a folder");
    let odd = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron",
        surfaces: { "caf\u{e9} \"1\"": (file: "GRAPHS/surfaces/t3-tile.ron", sample: "1"), "b": (file: "GRAPHS/surfaces/t3-tile.ron", sample: "2") },
        versions: { "loud, or": {}, "so\u{df}ft": { "gain": 0.1 }, "B": { "gain": 0.2 } }, scales: { "\u{e4}\\n": (ask: "?", from: "a", to: "b") },
        phases: { "r\"a\\te": Rate(stimuli: [Real, Virtual], repeats: 2), "c": Compare(scale: "\u{e4}\\n", repeats: 2) })"#;
    let odd = written(folder.path(), odd).expect("valid");
    let found = [
        all_of(&shipped("responsiveness.ron"), effect, false),
        all_of(&shipped("components.ron"), effect, false),
        all_of(&shipped("real-and-virtual.ron"), pairs, false),
        all_of(&odd, "People(format: 1)", true),
        all_of(
            &abx(folder.path(), 6),
            r#"People(format: 1, values: { "x": { "b": 0.2 } }, noise_sd: 0.1)"#,
            false,
        ),
    ];
    match found.concat().into_iter().collect::<Option<Vec<usize>>>() {
        Some(counts) => assert!(counts.iter().all(|count| *count > 80), "{counts:?}"),
        None => skip::skip("there is no Rscript to compare the statistics with"),
    }
}

#[test]
fn similarity_that_follows_what_a_signal_loses_gives_its_slope_back() {
    let study = shipped("responsiveness.ron");
    let textures = study.study.surfaces.0.iter().map(|(name, of)| {
        let surface = haptograph_surfaces::files::load(of.file.as_ref().expect("a file")).expect("a surface");
        (name.text.as_str(), surface.texture.expect("a texture"))
    });
    let textures: Vec<_> = textures.collect();
    let losses =
        condition_losses(&textures.iter().map(|(name, texture)| (*name, texture)).collect::<Vec<_>>());
    const SLOPE: f64 = 2000.0;
    // The similarity of F falls by a fiftieth for each (m/s²)², that of phi by a hundredth for each unit of SD.
    let values = losses.iter().filter_map(|of| match of.condition {
        Condition::Force => Some(format!("\"{}, F\": {}", of.surface, -of.loss.power / SLOPE)),
        Condition::Neither => Some(format!("\"{}, phi\": {}", of.surface, -0.01 * of.difference?)),
        _ => None,
    });
    let values: String = values.map(|value| value + ", ").collect();
    let folder = tempfile::tempdir().expect("a folder");
    let people = people(
        folder.path(),
        &study,
        &format!(r#"People(format: 1, bias_sd: 0, noise_sd: 0, values: {{ "similarity": {{ {values} }} }})"#),
    );
    let data = opened(&folder.path().join("data"), &study, &People::indifferent()).expect("a folder");
    for code in people_codes(2) {
        let mut claim = data.claim(&code, "all", true).expect("free");
        study.simulate(&registry(), (&mut claim, 0), &people, None, usize::MAX).expect("it runs");
    }
    let mut analysis = Analysis::of(&study.study, &data).expect("analysed");
    analysis.add_responsiveness(&study, &data).expect("added");
    let row = |analysis: &Analysis, version: &str, property: &str| {
        let is_it = |row: &&RelationRow| row.of == version && row.with.starts_with(property);
        analysis.relations.iter().find(is_it).cloned().expect("a row")
    };
    for (version, property, slope) in [("F", "P,", 1.0 / SLOPE), ("phi", "SD", 0.01)] {
        let found = row(&analysis, version, property);
        assert!((found.value / slope - 1.0).abs() < 1e-9, "{found:?}");
        assert!((found.r_squared.expect("R2") - 1.0).abs() < 1e-9 && found.count == 6, "{found:?}");
    }
    // The answers to S are all the same.
    assert!(analysis.left_out.iter().any(|why| why.contains("S on SD")), "{:?}", analysis.left_out);
    let another = Analysis::default().add_responsiveness(&shipped("first.ron"), &data);
    assert!(matches!(another, Err(DataError::OtherStudy { .. })));
    // A surface that has changed since is left out.
    let mut other = study.clone();
    let tile = other.study.surfaces.find("tile").expect("a surface");
    other.study.surfaces.0[tile].1.file = other.study.surfaces.0[0].1.file.clone();
    let mut changed = Analysis::of(&study.study, &data).expect("analysed");
    changed.add_responsiveness(&other, &data).expect("added");
    assert_eq!(row(&changed, "F", "P,").count, 5);
    assert!(changed.left_out.iter().any(|why| why.contains("tile") && why.contains("presented")));
}

#[test]
fn the_thesis_s_numbers_stand_beside_those_that_mean_the_same() {
    let beside = |name: &str, surface: &str| {
        let study = shipped(name);
        let folder = tempfile::tempdir().expect("a folder");
        let data = opened(folder.path(), &study, &People::indifferent()).expect("a folder");
        let groups = study.study.group_count();
        for (number, code) in people_codes(6 * groups).enumerate() {
            let mut claim = data.claim(&code, study.study.group_name(number % groups), true).expect("free");
            let people = People::indifferent();
            study
                .simulate(&registry(), (&mut claim, number % groups), &people, None, usize::MAX)
                .expect("it runs");
        }
        // The toolkit's surface, as a file may be called.
        let table = folder.path().join("trials.csv");
        let text = fs::read_to_string(&table).expect("trials");
        fs::write(&table, text.replace(&format!(",{surface},"), ",abs-plastic,")).expect("written");
        let mut analysis = Analysis::of(&study.study, &data).expect("analysed");
        if name == "components.ron" {
            analysis.add_components(Some(&study), &data).expect("added");
        }
        let rows = analysis.beside_thesis(&study.study).expect("a study of the thesis");
        assert!(rows.iter().all(|row| !row.own.is_null() && !row.thesis.is_null()), "{rows:?}");
        rows
    };
    let thesis = |rows: &[BesideRow], what: &str| {
        rows.iter()
            .find(|row| row.what == what)
            .unwrap_or_else(|| panic!("{what}: {rows:?}"))
            .thesis
            .to_string()
    };
    let rows = beside("real-and-virtual.ron", "none");
    // F and p of two factors on four scales, four coefficients, two R2, six correlations of ten stimuli, without the blank; nothing of
    // the ratings that the thesis discards.
    assert_eq!(rows.len(), 4 * 4 + 4 + 2 + 6);
    assert_eq!(thesis(&rows, "roughness and fineness: r, 10 stimuli"), "-0.98");
    assert!(rows.iter().all(|row| row.phase != "adjectives after pairs"));
    assert_eq!(thesis(&rows, "roughness, surface: F"), "52.18");
    assert_eq!(thesis(&rows, "slipperiness, version: F"), "99.91");
    assert_eq!(thesis(&rows, "dissimilarity on difference of fineness"), "0.366");
    let rows = beside("responsiveness.ron", "plastic");
    // Six surfaces of other names say how many differ, and one has p.
    assert_eq!(rows.len(), 3 + 3);
    assert_eq!(thesis(&rows, "surfaces on which F is less similar than FS, p < 0.05"), "\"11 of 15\"");
    assert_eq!(thesis(&rows, "surfaces on which S is less similar than FS, p < 0.05"), "\"0 of 15\"");
    assert_eq!(thesis(&rows, "abs-plastic, phi against FS: p"), "0.0000875");
    let rows = beside("components.ron", "plastic");
    // R2 and p of thirteen regressions, all of which the simulated surfaces have the parts for.
    assert_eq!(rows.len(), 3 + 3 + 2 * 3 + 2 * 13);
    assert_eq!(thesis(&rows, "hardness, real on spectral centroid of taps, Hz: p"), "7.3e-6");
    assert_eq!(thesis(&rows, "% less, no friction on slipperiness, real: R2"), "0.4");
    assert_eq!(
        thesis(&rows, "surfaces on which no texture is less similar than all, p < 0.05"),
        "\"10 of 15\""
    );
    let table = |number: &str, what: &str| {
        let source = format!("Table {number}");
        rows.iter()
            .find(|row| row.source == source && row.what == what)
            .expect("a correlation")
            .thesis
            .to_string()
    };
    assert_eq!(table("4.3", "slipperiness and roughness: r, 6 stimuli"), "-0.91");
    assert_eq!(table("4.4", "slipperiness and hardness: r, 6 stimuli"), "\"0.21 or 0.24\"");
    let folder = tempfile::tempdir().expect("a folder");
    let study = shipped("first.ron");
    let data = opened(folder.path(), &study, &People::indifferent()).expect("a folder");
    let none = Analysis::of(&study.study, &data).expect("analysed").beside_thesis(&study.study);
    assert!(none.expect_err("no study of the thesis").to_string().contains("thesis: \"3.3\""));
    let wrong = GATED
        .replace("seed: 5", "seed: 5, thesis: \"4.7\"")
        .replace("PORT", r#"port: "way so far", at_least_cm: 50"#);
    assert_eq!(codes(written(folder.path(), &wrong).unwrap_err()), ["E0304"]);
}

#[test]
fn one_of_two_is_chosen_by_its_value_and_a_break_asks_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron", seed: 5,
        surfaces: { "tile": (file: "GRAPHS/surfaces/t3-tile.ron"), "vinyl": (file: "GRAPHS/surfaces/t5-vinyl.ron") },
        versions: { "soft": { "gain": 0.5 }, "loud": {} },
        phases: {
            "more real": TwoAlternative(ask: "Which one is more real?", surfaces: ["tile"], repeats: 4),
            "rest": Break(at_least_s: 30),
            "rougher": TwoAlternative(ask: "Which one is rougher?", stimuli: [Virtual(version: "loud")], across_surfaces: true),
        })"#;
    let study = written(folder.path(), text).expect("valid");
    study.check_graph(&registry()).expect("on its graph");
    let trials = study.study.trials("P1", 0);
    assert_eq!(trials.len(), 4 + 1 + 1);
    assert_eq!(study.study.duration_s(&trials), 5.0 * 15.0 + 30.0);
    assert_eq!(
        trials.iter().filter(|trial| trial.phase == 0 && trial.is_swapped).count(),
        2,
        "sides are even"
    );
    let text_of_people =
        r#"People(format: 1, values: { "more real": { "loud": 0.4 } }, bias_sd: 0.0, noise_sd: 0.1)"#;
    let people = people(folder.path(), &study, text_of_people);
    let data = opened(&folder.path().join("data"), &study, &people).expect("a folder");
    for code in people_codes(12) {
        let mut claim = data.claim(&code, "all", true).expect("free");
        study.simulate(&registry(), (&mut claim, 0), &people, None, 100).expect("simulated");
    }
    let analysis = Analysis::of(&study.study, &data).expect("analysed");
    let [real, rougher] = &analysis.choices[..] else { panic!("{:?}", analysis.choices) };
    assert_eq!(
        (&*real.first, &*real.second, real.answers, real.people),
        ("tile, soft", "tile, loud", 48, 12)
    );
    assert!(real.share_of_first < 0.1 && real.people_for_first == 0 && real.p_of_people < 1e-3, "{real:?}");
    assert_eq!((rougher.answers, rougher.p_of_answers), (12, rougher.p_of_people));
    assert!(rougher.p_of_people > 1e-3, "nobody prefers either: {rougher:?}");
}

/// A study of ABX on two versions of two surfaces.
fn abx(folder: &Path, repeats: u32) -> Checked {
    let text = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron", seed: 5,
        surfaces: { "tile": (file: "GRAPHS/surfaces/t3-tile.ron"), "vinyl": (file: "GRAPHS/surfaces/t5-vinyl.ron") },
        versions: { "a": {}, "b": { "gain": 0.5 } },
        phases: { "x": TwoAlternative(abx: true, ask: "Which one is X?", repeats: REPEATS, training: 1) })"#;
    written(folder, &text.replace("REPEATS", &repeats.to_string())).expect("valid")
}

#[test]
fn x_is_each_of_a_pair_as_often_and_a_as_often_as_b() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = abx(folder.path(), 4);
    study.check_graph(&registry()).expect("on its graph");
    let (mut first, mut at_a) = (BTreeMap::new(), BTreeMap::new());
    for person in 0..1_000 {
        let trials = study.study.trials(&format!("P{person}"), 0);
        let own: Vec<_> = trials.iter().filter(|trial| !trial.is_training).collect();
        assert_eq!((trials.len(), own.len()), (1 + 8, 8));
        for surface in [0, 1] {
            let of = own.iter().filter(|trial| trial.first.expect("X").surface == surface);
            let versions: Vec<_> =
                of.map(|trial| trial.first.expect("X").version.expect("virtual")).collect();
            assert_eq!((versions.len(), versions.iter().sum::<usize>()), (4, 2), "X is each version twice");
        }
        assert_eq!(own.iter().filter(|trial| trial.is_swapped).count(), 4, "X is A in half of the trials");
        *first.entry(own[0].first.expect("X").version).or_insert(0) += 1;
        *at_a.entry((own[0].is_swapped, own[7].is_swapped)).or_insert(0) += 1;
    }
    assert_eq!((first.len(), at_a.len()), (2, 4));
    assert!(unevenness(&first) < 7.0, "{first:?}");
    // Of an odd number one is drawn by lot.
    let odd = abx(folder.path(), 1);
    let first = (0..400)
        .map(|person| odd.study.trials(&format!("P{person}"), 0)[1].first.expect("X").version == Some(0));
    assert!((150..250).contains(&first.filter(|is_first| *is_first).count()));
    // What X is can be seen of a real sample.
    let text = fs::read_to_string(folder.path().join("study.ron")).expect("written");
    assert_eq!(
        codes(
            written(folder.path(), &text.replace("abx: true", "abx: true, stimuli: [Real, Virtual]"))
                .unwrap_err()
        ),
        ["E0304"]
    );
}

#[test]
fn observers_of_abx_give_their_d_prime_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let study = abx(folder.path(), 30);
    // Two units of noise apart on vinyl, and not on tile; bias and gain do not matter.
    let people = people(
        folder.path(),
        &study,
        r#"People(format: 1, bias_sd: 5.0, gain_sd: 1.0, noise_sd: 0.1, values: { "x": { "vinyl, b": 0.2 } })"#,
    );
    let data = opened(&folder.path().join("data"), &study, &people).expect("a folder");
    for code in people_codes(8) {
        let mut claim = data.claim(&code, "all", true).expect("free");
        study.simulate(&registry(), (&mut claim, 0), &people, None, usize::MAX).expect("it runs");
    }
    let rows = data.answers().expect("answers");
    assert!(rows.iter().all(
        |row| row.is_right == Some(row.choice == format!("{}, {}", row.first_surface, row.first_version))
    ));
    let analysis = Analysis::of(&study.study, &data).expect("analysed");
    assert_eq!(analysis.abx.len(), 2 * (8 + 1), "each person and all, for each pair; no training");
    let all: Vec<_> = analysis.abx.iter().filter(|row| row.participant.is_empty()).collect();
    let [tile, vinyl] = &all[..] else { panic!("{all:?}") };
    assert_eq!((&*tile.pair, tile.answers), ("tile, a / tile, b", 240));
    assert!(tile.low < 0.5 && tile.high > 0.5 && tile.p > 0.05, "{tile:?}");
    let (low, high) = (vinyl.d_prime_low.expect("an end"), vinyl.d_prime_high.expect("an end"));
    assert!(low < 2.0 && 2.0 < high && high - low < 1.0, "{vinyl:?}");
    // All eight are right more often than not: 2 / 2^8.
    assert!(
        (vinyl.p_of_people.expect("of people") - 2.0 / 256.0).abs() < 1e-12 && vinyl.p < 1e-9,
        "{vinyl:?}"
    );
    // The power of the test of all answers, of two people in a pair of six: R 4.2.2, binom.test over all outcomes of 12 answers.
    let few = abx(folder.path(), 6);
    let stop = AtomicBool::new(false);
    let effects = few.power(&people, (&[vec![2]], 1_000), &|_| (), &stop).expect("simulated");
    let of = |pair: &str| {
        let is_it = |row: &&EffectPower| row.of == pair && row.test == "sign test of answers";
        effects.iter().find(is_it).expect("an effect").shares[0]
    };
    for (pair, power) in [("vinyl, a / vinyl, b", 0.380_932_0), ("tile, a / tile, b", 0.038_574_2)] {
        let share = of(pair);
        assert!(share.low < power && power < share.high, "{pair}: {share:?}, {power}");
    }
}

#[test]
fn a_threshold_is_found_more_often_by_more_people() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron", seed: 3, surfaces: { "a": (file: "GRAPHS/surfaces/t3-tile.ron") },
        phases: {
            "fixed": ConstantStimuli(ask: "?", surface: "a", parameter: "gain", standard: 0.4, levels: [0.45, 0.5, 0.6, 0.8], repeats: 10),
            "stairs": Staircase(ask: "?", surface: "a", parameter: "gain", standard: 0.4, limits: (0.4, 1.0),
                method: UpDown(start: 0.7, steps: [0.1, 0.05], reversals: 20), at_most: 60),
        })"#;
    let study = written(folder.path(), text).expect("valid");
    let people = people(folder.path(), &study, "People(format: 1, threshold: 0.1)");
    let stop = AtomicBool::new(false);
    let found = study.power(&people, (&[vec![1], vec![24]], 60), &|_| (), &stop).expect("simulated");
    let names: Vec<(&str, &str, &str)> = found.iter().map(|of| (&*of.phase, &*of.of, &*of.term)).collect();
    let of = |phase| [(phase, "threshold", "within 10 %"), (phase, "threshold", "within 25 %")];
    assert_eq!(names, [of("fixed"), of("stairs")].concat());
    for two in found.chunks(2) {
        let [near, wide] = [0, 1].map(|at| (two[at].shares[0].share, two[at].shares[1].share));
        assert!(near.0 < near.1 && near.1 < wide.1 && wide.1 > wide.0 + 0.25 && wide.1 > 0.8, "{two:?}");
    }
}

#[test]
fn a_surface_without_friction_is_left_out_of_its_regression_and_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut study = shipped("components.ron");
    let tile = study.study.surfaces.find("tile").expect("a surface");
    let file = study.study.surfaces.0[tile].1.file.clone().expect("a file");
    let text = fs::read_to_string(file).expect("a surface");
    let text: String = text
        .lines()
        .filter(|line| !line.starts_with("    friction: "))
        .map(|line| format!("{line}\n"))
        .collect();
    let bare = folder.path().join("bare.ron");
    fs::write(&bare, text).expect("written");
    study.study.surfaces.0[tile].1.file = Some(bare);
    let data = opened(&folder.path().join("data"), &study, &People::indifferent()).expect("a folder");
    for code in people_codes(3) {
        let mut claim = data.claim(&code, "1", true).expect("free");
        study
            .simulate(&registry(), (&mut claim, 0), &People::indifferent(), None, usize::MAX)
            .expect("it runs");
    }
    let mut analysis = Analysis::of(&study.study, &data).expect("analysed");
    analysis.add_components(Some(&study), &data).expect("added");
    let count = |of: &str, with: &str| {
        let row = analysis.relations.iter().find(|row| row.of == of && row.with == with);
        row.unwrap_or_else(|| panic!("{:?}", analysis.left_out)).count
    };
    assert_eq!(count("slipperiness, real", "friction coefficient"), 5);
    assert_eq!(count("hardness, real", "tap response, N s/m"), 6);
    assert!(
        analysis.left_out.iter().any(|why| why.contains("friction") && why.contains("tile")),
        "{:?}",
        analysis.left_out
    );
    // Without the study's own file nothing is measured, which is said.
    let mut alone = Analysis::of(&study.study, &data).expect("analysed");
    alone.add_components(None, &data).expect("added");
    assert!(alone.relations.iter().all(|row| row.with != "friction coefficient"));
    assert!(alone.left_out.iter().any(|why| why.contains("--study")));
}
