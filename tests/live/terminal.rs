//! A live run on a terminal, played by `script`.

use super::*;

const GRAPH: &str = r#"Graph(format: 1, parameters: { "gain": 0.5 }, clocks: { "servo": Driver(rate_hz: 1000) }, nodes: {
    "one": Constant(clock: "servo", value: 1, quantity: "current"),
    "out": ActuatorSink(current: "one", endpoint: "a", gain: Param("gain"), limit: (peak_a: 2, continuous_a: 1.5)),
}, endpoints: { "simulated": { "a": SimulatedHaptuator() } })"#;

/// What a terminal of 100 columns got, and what was typed into it at intervals.
fn typed(keys: &[&str]) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("g.ron"), GRAPH).unwrap();
    let run = format!("stty cols 100; {} run g.ron --live", env!("CARGO_BIN_EXE_haptograph"));
    let child = Command::new("script")
        .args(["-qefc", &run, "said"])
        .current_dir(&folder)
        .env("TERM", "xterm")
        .env("SHELL", "/bin/sh")
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn();
    let Ok(mut child) = child else {
        skip("there is no `script` to play a terminal");
        return None;
    };
    let said = || fs::read(folder.path().join("said")).unwrap_or_default();
    let said = || String::from_utf8_lossy(&said()).into_owned();
    let start = Instant::now();
    let wait_for = |words: &str| {
        while !said().contains(words) {
            assert!(start.elapsed() < Duration::from_secs(100), "no {words}: {}", said());
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    wait_for("rms of");
    let mut keyboard = child.stdin.take().unwrap();
    for pair in keys.chunks(2) {
        keyboard.write_all(pair[0].as_bytes()).unwrap();
        wait_for(pair[1]);
    }
    assert!(child.wait().unwrap().success(), "{}", said());
    Some(said())
}

#[test]
fn a_block_stays_in_place_and_what_is_typed_is_edited_and_remembered() {
    let up = "\x1b[A";
    let Some(said) = typed(&[
        "set gaim\x7fn=0.25\r",
        "set last: ",
        "help\r",
        "shows what was set",
        &format!("{up}{up}\x7f\x7f75\r"),
        "gain=0.75 (typed)",
        "history\r",
        "gain=0.25 (typed)",
        "stop\r",
        "look at ",
    ]) else {
        return;
    };
    assert!(said.contains("> set gain=0.25") && said.contains("> set gain=0.75"), "{said}");
    // Each time it is drawn, what was drawn before is taken away.
    let drawn = said.matches("rms of 1.5, peak").count();
    let erased = said.matches("\x1b[J").count();
    assert!(drawn > 3 && erased >= drawn, "{drawn} {erased}");
    assert!(said.contains("] 0.") && said.contains("of 2"), "{said}");
}
