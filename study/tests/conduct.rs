//! Sessions on a clock of the test's own: what each step asks for, and when.

use haptograph_engine::registry::Registry;
use haptograph_study::check::{Checked, StudyError};
use haptograph_study::conduct::{Answer, Conduct, Conductor, PAUSE_S, Said, Step};
use haptograph_study::data::{Folder, Row};
use std::fs;
use std::path::{Path, PathBuf};

fn registry() -> Registry {
    haptograph_nodes::registry()
}

fn load(folder: &Path, text: &str) -> Result<Checked, StudyError> {
    let graphs = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../graphs");
    let path = folder.join("study.ron");
    fs::write(&path, text.replace("GRAPHS", &graphs.display().to_string())).expect("written");
    let study = Checked::load(&path, None)?;
    study.check_graph(&registry())?;
    Ok(study)
}

/// A session of one participant whose first trial waits to be presented, at 10 s.
fn session(folder: &Path, text: &str) -> Conductor {
    let study = load(folder, text).expect("right");
    let data = Folder::open(&folder.join("data"), &study.identity(None)).expect("a folder");
    let (graph, _) = Conductor::first(&study, &registry()).expect("a graph");
    let mut session = Conductor::open(study, data, &graph).expect("a session");
    for said in [Said::Begin { code: "P1".into(), group: "all".into() }, Said::Agree, Said::Ready] {
        session.hear(said, 10.0).expect("possible");
    }
    session
}

fn rows(folder: &Path) -> Vec<Row> {
    Folder::existing(&folder.join("data")).expect("a folder").rows().expect("a table")
}

const OMNI: &str = r#"Study(format: 1, graph: "GRAPHS/omni.ron", seed: 1,
    surfaces: { "tile": (file: "GRAPHS/surfaces/t3-tile.ron") },
    versions: { "a": {}, "b": { "texture": 0.0 } },
    scales: { "roughness": (ask: "How rough?", from: "smooth", to: "rough") },
    phases: { "rating": Rate(repeats: 2, opens_when: {
        "taps": (port: "taps so far", at_least: 5), "dragged": (port: "way so far", at_least_cm: 50),
    }) })"#;

fn presented(session: &mut Conductor, now_s: f64) {
    let step = session.tick(now_s, (false, false)).expect("it goes on");
    assert!(matches!(step, Step::Present(_)), "{step:?}");
}

#[test]
fn a_stimulus_begins_at_the_same_time_whatever_it_took_to_load() {
    for took_s in [0.01, 0.3, PAUSE_S] {
        let folder = tempfile::tempdir().expect("a folder");
        let mut session = session(folder.path(), OMNI);
        presented(&mut session, 20.0);
        assert!(!session.is_felt_at(20.0 + PAUSE_S), "nothing is felt before a run has begun");
        session.began(20.0 + took_s);
        assert!(!session.is_felt_at(20.0 + PAUSE_S - 1e-6) && session.is_felt_at(20.0 + PAUSE_S), "{took_s}");
    }
}

#[test]
fn four_taps_or_half_a_metre_less_a_millimetre_open_no_answer_and_an_interruption_takes_nothing_away() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = session(folder.path(), OMNI);
    presented(&mut session, 20.0);
    // What was felt before it began does not count.
    session.take("way so far", (1, "m"), &[0.0, 9.0], 20.1);
    session.began(20.1);
    let open = |session: &Conductor, now_s: f64| session.participant_view(now_s)["open"] == true;
    let answer = || Said::Answer(Answer { trial: 1, rating: Some(0.5), ..Answer::default() });
    session.take("taps so far", (1, "1"), &[0.0, 4.0], 21.0);
    session.take("way so far", (1, "m"), &[0.0, 0.499], 21.0);
    session.tick(21.0, (true, true)).expect("it goes on");
    assert!(!open(&session, 21.0) && session.hear(answer(), 21.0).is_err());
    session.interrupt("STOP of the participant", 22.0);
    assert_eq!(session.hear(Said::Ready, 22.9), Ok(Step::None), "a press that was meant for another button");
    assert_eq!(session.hear(Said::Ready, 23.1), Ok(Step::Silence));
    presented(&mut session, 23.1);
    session.began(23.2);
    // The graph counts from zero again.
    session.take("taps so far", (1, "1"), &[0.0, 1.0], 24.0);
    session.tick(24.0, (true, true)).expect("it goes on");
    assert!(!open(&session, 24.0), "the way is not reached");
    session.take("way so far", (1, "m"), &[0.0, 0.001], 24.5);
    session.tick(24.5, (true, true)).expect("it goes on");
    assert!(open(&session, 24.5));
    session.hear(answer(), 25.0).expect("kept");
    let [row] = &rows(folder.path())[..] else { panic!("one answer") };
    // From 20.6 to 22.0 and from 23.7 to 24.5.
    assert_eq!((row.trial, row.attempt, row.exploration_s, row.response_s), (1, 1, 2.2, 0.5));
    // A second press answers no trial that was not seen.
    session.hear(answer(), 25.1).expect("passed over");
    assert_eq!(rows(folder.path()).len(), 1);
}

#[test]
fn a_stimulus_that_was_not_touched_is_not_felt() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron", surfaces: { "tile": (file: "GRAPHS/surfaces/t3-tile.ron") },
        versions: { "a": {}, "b": { "gain": 0.5 } }, phases: { "choice": TwoAlternative(ask: "Which?") })"#;
    let mut session = session(folder.path(), text);
    presented(&mut session, 20.0);
    session.began(20.0);
    session.tick(21.0, (true, true)).expect("it goes on");
    let step = session.hear(Said::Feel { place: 1 }, 22.0).expect("possible");
    assert!(matches!(step, Step::Present(_)));
    session.began(22.0);
    session.tick(30.0, (true, false)).expect("it goes on");
    let view = session.participant_view(30.0);
    assert_eq!((&view["open"], view["turns"]["felt"].to_string().as_str()), (&false.into(), "[true,false]"));
    session.tick(31.0, (true, true)).expect("it goes on");
    assert_eq!(session.participant_view(31.0)["open"], true);
}

#[test]
fn a_b_and_x_take_turns_and_the_answer_says_which_one_x_is() {
    for choice in [0, 1] {
        let folder = tempfile::tempdir().expect("a folder");
        let text = r#"Study(format: 1, graph: "GRAPHS/texturepad.ron", surfaces: { "tile": (file: "GRAPHS/surfaces/t3-tile.ron") },
            versions: { "a": {}, "b": { "gain": 0.5 } }, measures: ["speed.speed"],
            phases: { "x": TwoAlternative(abx: true, ask: "Which one is X?") })"#;
        let study = load(folder.path(), text).expect("right");
        let trial = study.study.trials("P1", 0).remove(0);
        assert_eq!(study.study.duration_s(std::slice::from_ref(&trial)), 15.0);
        let mut session = session(folder.path(), text);
        let gain = |step: Step| match step {
            Step::Present(of) => of.set.iter().any(|(name, _)| name == "gain"),
            other => panic!("{other:?}"),
        };
        let mut gains = vec![gain(session.tick(20.0, (false, false)).expect("it goes on"))];
        for place in [1, 2] {
            let now_s = 20.0 + 10.0 * place as f64;
            session.began(now_s - 10.0);
            session.take("speed.speed", (1, "m/s"), &[0.1], now_s - 1.0);
            session.tick(now_s - 1.0, (true, true)).expect("it goes on");
            assert_eq!(session.participant_view(now_s)["open"], false, "X was not felt");
            gains.push(gain(session.hear(Said::Feel { place }, now_s).expect("possible")));
        }
        // X is what stands at A or at B.
        let x_at = usize::from(trial.is_swapped);
        assert_eq!((gains[0] == gains[1], gains[2]), (false, gains[x_at]));
        assert_eq!(session.hear(Said::Feel { place: 3 }, 41.0), Ok(Step::None), "there are three");
        session.began(41.0);
        session.take("speed.speed", (1, "m/s"), &[0.3], 49.0);
        session.tick(50.0, (true, true)).expect("it goes on");
        let view = session.participant_view(50.0);
        assert_eq!(
            (&view["open"], view["turns"]["felt"].to_string().as_str()),
            (&true.into(), "[true,true,true]")
        );
        let beyond = Said::Answer(Answer { trial: 1, choice: Some(2), ..Answer::default() });
        assert!(session.hear(beyond, 50.0).is_err(), "X is A or B");
        session
            .hear(Said::Answer(Answer { trial: 1, choice: Some(choice), ..Answer::default() }), 51.0)
            .expect("kept");
        let row = rows(folder.path()).remove(0);
        assert_eq!(row.is_right, Some(choice == x_at));
        assert_eq!(row.is_right, Some(row.choice == format!("{}, {}", row.first_surface, row.first_version)));
        let measures =
            Folder::existing(&folder.path().join("data")).expect("a folder").measures().expect("measures");
        let x = measures.iter().find(|of| of.name == "X: speed.speed mean").expect("of X");
        assert_eq!(x.value, 0.3);
    }
}

#[test]
fn limits_that_differ_between_versions_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = r#"Graph(format: 1, parameters: { "most": 0.2, "rms": 0.1 }, clocks: { "c": Driver(rate_hz: 1000) }, nodes: {
        "one": Constant(clock: "c", value: 0.1, quantity: "current"),
        "out": ActuatorSink(current: "one", endpoint: "coil", limit: (peak_a: Param("most"), continuous_a: Param("rms"))),
    }, endpoints: { "simulated": { "coil": SimulatedHaptuator() } })"#;
    fs::write(folder.path().join("g.ron"), graph).expect("written");
    for (setting, is_right) in [("", true), ("\"most\": 0.3", false), ("\"rms\": 0.05", false)] {
        let text = format!(
            r#"Study(format: 1, graph: "g.ron", surfaces: {{}}, phases: {{ "a": Practice(), "b": Practice(settings: {{ {setting} }}) }})"#
        );
        assert_eq!(load(folder.path(), &text).is_ok(), is_right, "{setting}");
    }
}
