use super::*;

const GRAPH: &str = "Graph(format: 1, clocks: { \"c\": Driver(rate_hz: 1000) }, nodes: {\n    \
                     \"tön\": Sine(clock: \"c\", frequency_h: 5),\n    \"quiet\": Gain(input: \"tön\", gain: 0.5),\n})\n";

/// Responses of the server to these messages.
fn talk(messages: &[Value]) -> Vec<Value> {
    let registry = crate::nodes::registry();
    let mut server = Server { registry: &registry, texts: HashMap::new(), is_shut: false };
    let mut input = Vec::new();
    for message in messages {
        wire::write(&mut input, message).unwrap();
    }
    let mut output = Vec::new();
    server.serve(&mut &input[..], &mut output).unwrap();
    let mut rest = &output[..];
    std::iter::from_fn(|| wire::read(&mut rest).unwrap()).collect()
}

fn open() -> Value {
    let document =
        json!({ "uri": "file:///tmp/a%20b.ron", "languageId": "ron", "version": 1, "text": GRAPH });
    json!({ "jsonrpc": "2.0", "method": "textDocument/didOpen", "params": { "textDocument": document } })
}

fn ask(method: &str, line: u64, character: u64) -> Value {
    json!({
        "jsonrpc": "2.0", "id": 7, "method": method,
        "params": {
            "textDocument": { "uri": "file:///tmp/a%20b.ron" },
            "position": { "line": line, "character": character },
        },
    })
}

fn labels(answer: &Value) -> Vec<&str> {
    let items = answer["result"].as_array().unwrap();
    items.iter().filter_map(|item| item["label"].as_str()).collect()
}

#[test]
fn studies_are_checked_and_completed_too() {
    let text = "// three surfaces\nStudy(format: 1, graph: \"none.ron\",\n    surfaces: {}, phases: { \"a\": Rate(repeat: 2) },\n)\n";
    let document = json!({ "uri": "file:///tmp/a%20b.ron", "languageId": "ron", "version": 1, "text": text });
    let open =
        json!({ "jsonrpc": "2.0", "method": "textDocument/didOpen", "params": { "textDocument": document } });
    let complete = "textDocument/completion";
    let answers = talk(&[open, ask(complete, 2, 38), ask(complete, 2, 27), ask("textDocument/hover", 2, 35)]);
    let findings = answers[0]["params"]["diagnostics"].as_array().unwrap();
    assert!(
        findings.iter().any(|finding| finding["code"] == "E0204" && finding["range"]["start"]["line"] == 2),
        "{findings:?}"
    );
    assert!(labels(&answers[1]).contains(&"repeats"), "{}", answers[1]);
    assert!(
        ["Compare", "Staircase", "Choice", "Pink"].iter().all(|name| labels(&answers[2]).contains(name)),
        "{}",
        answers[2]
    );
    assert!(
        answers[3]["result"]["contents"]["value"].as_str().is_some_and(|said| said.contains("one scale")),
        "{}",
        answers[3]
    );
}

#[test]
fn findings_stand_where_they_are_in_units_of_the_protocol() {
    let answers = talk(&[open()]);
    let findings = answers[0]["params"]["diagnostics"].as_array().unwrap();
    let unknown = findings.iter().find(|finding| finding["code"] == "E0204").unwrap();
    // The field begins after 28 characters of the second line, one of which has two bytes.
    let at = json!({ "line": 1, "character": 28 });
    assert_eq!(unknown["range"]["start"], at, "{unknown}");
    assert!(unknown["message"].as_str().unwrap().contains("frequency_hz"), "{unknown}");
}

#[test]
fn kinds_fields_and_nodes_are_completed_where_they_can_stand() {
    let complete = "textDocument/completion";
    let answers = talk(&[open(), ask(complete, 1, 28), ask(complete, 2, 27), ask(complete, 2, 13)]);
    assert!(labels(&answers[1]).contains(&"frequency_hz"));
    assert!(labels(&answers[2]).contains(&"tön"));
    assert!(labels(&answers[3]).contains(&"LowPass"));
}

#[test]
fn a_connection_is_completed_by_the_outputs_of_the_graph_when_it_was_last_sound() {
    let text = r#"Graph(format: 1, clocks: { "c": Driver(rate_hz: 125) }, nodes: {
        "turn": Sine(clock: "c", frequency_hz: 5),
        "pen": Tablet(clock: "c", endpoint: "pen"),
        "quiet": Gain(input: "pen.force", gain: 0.5),
        "file": CsvSink(inputs: ["turn", "quiet"], file: "x.csv"),
    }, endpoints: { "simulated": { "pen": SimulatedTablet() } })"#;
    let document = json!({ "uri": "file:///tmp/a%20b.ron", "version": 1, "text": text });
    let open = json!({ "method": "textDocument/didOpen", "params": { "textDocument": document } });
    let broken = text.replace("gain: 0.5", "gain: ");
    let change = json!({
        "method": "textDocument/didChange",
        "params": { "textDocument": document, "contentChanges": [{ "text": broken }] },
    });
    // Behind `pen.f` of the fourth line.
    let answers = talk(&[open, change, ask("textDocument/completion", 3, 35)]);
    assert_eq!(answers[0]["params"]["diagnostics"], json!([]));
    assert_ne!(answers[1]["params"]["diagnostics"], json!([]));
    let labels = labels(&answers[2]);
    for output in ["pen.position", "pen.force", "turn", "quiet", "c"] {
        assert!(labels.contains(&output), "{labels:?}");
    }
    assert!(!labels.contains(&"pen"), "it has several outputs: {labels:?}");
    let items = answers[2]["result"].as_array().unwrap();
    let force = items.iter().find(|item| item["label"] == "pen.force").unwrap();
    assert_eq!(force["textEdit"]["newText"], "pen.force");
    assert_eq!(force["textEdit"]["range"]["start"], json!({ "line": 3, "character": 30 }));
    assert!(force["detail"].as_str().unwrap().contains("force"), "{force}");
}

#[test]
fn a_word_is_explained() {
    let hover = "textDocument/hover";
    let answers = talk(&[open(), ask(hover, 2, 14), ask(hover, 2, 36), ask(hover, 0, 0)]);
    let said = |answer: &Value| answer["result"]["contents"]["value"].as_str().unwrap_or("").to_owned();
    assert!(said(&answers[1]).starts_with("Gain (math)"), "{}", answers[1]);
    assert!(said(&answers[2]).starts_with("`gain` of Gain"), "{}", answers[2]);
    assert_eq!(answers[3]["result"], Value::Null);
}

#[test]
fn what_is_not_known_is_refused_and_the_end_is_an_end() {
    let request = |id: u64, method: &str| json!({ "jsonrpc": "2.0", "id": id, "method": method });
    let answers = talk(&[
        request(1, "initialize"),
        request(2, "no/such"),
        request(3, "shutdown"),
        request(4, "textDocument/hover"),
        json!({ "jsonrpc": "2.0", "method": "exit" }),
        request(5, "initialize"),
    ]);
    assert_eq!(answers.len(), 4);
    assert_eq!(answers[0]["result"]["capabilities"]["hoverProvider"], true);
    assert_eq!(answers[1]["error"]["code"], METHOD_NOT_FOUND);
    assert_eq!(answers[3]["error"]["code"], INVALID_REQUEST);
    assert!(wire::read(&mut &b"Content-Length: 99999999999\r\n\r\n"[..]).is_err());
    assert!(wire::read(&mut &b"Content-Length: 2\r\n\r\n{"[..]).is_err());
}
