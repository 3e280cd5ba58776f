use super::*;
use crate::learning::tests::{drag, learned};
use haptograph_learning::evaluate::{MapSettings, RecordingName, Study, StudySettings, Take};
use haptograph_surfaces::rendering::RandomWalk;

#[test]
fn the_page_shows_both_tables_the_map_and_every_surface() {
    let mut takes = vec![];
    for (material, ring) in [("low", 1.7), ("high", -0.5)] {
        for (person, take) in [("anna", 1), ("anna", 2), ("ben", 3)] {
            let name =
                RecordingName { material: material.into(), person: person.into(), take: take.to_string() };
            takes.push(Take { name, recording: drag(take, ring) });
        }
    }
    let walk = RandomWalk { seconds: 1.0, ..RandomWalk::default() };
    let settings =
        StudySettings { map: MapSettings { walk, ..MapSettings::default() }, ..StudySettings::default() };
    let found = Study::of(&takes).unwrap().evaluate(&settings, &|_| ()).unwrap();
    let page = page("A <study>", &found, &[learned("high", -0.5), learned("low", 1.7)]);
    for shown in [
        "A &lt;study&gt;",
        "virtual low",
        "Largest expected difference to the own material",
        "<th>mean</th>",
        "Textures placed by their spectral differences",
        "Tree of spectral differences",
        "low.anna.1",
        "<summary>high</summary>",
        "class=\"badge\">simulated",
    ] {
        assert!(page.contains(shown), "{shown} is missing");
    }
    assert!(!page.contains("NaN"));
    let at = |pooling: &str| page.find(pooling).unwrap();
    assert!(at("windows of all compared pairs") < at("windows of the compared pair"));
}
