//! How far pages of the studio reach: which files they can name, and what those can do that come over a network.
#![cfg(target_os = "linux")]

mod common;

use common::{PATIENCE, Page};
use haptograph_studio::{Options, Studio};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpStream};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use tungstenite::Message;

const LAN: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(name)
}

/// A folder `graph` with a copy of the TexturePad, and beside it a folder `other` with a surface.
fn place() -> tempfile::TempDir {
    let place = tempfile::tempdir().expect("a folder");
    for (from, to) in [
        ("texturepad.ron", "graph/texturepad.ron"),
        ("surfaces/t2-canvas.ron", "graph/surfaces/t2-canvas.ron"),
        ("surfaces/t3-tile.ron", "other/t3-tile.ron"),
    ] {
        let to = place.path().join(to);
        std::fs::create_dir_all(to.parent().expect("a folder")).expect("made");
        std::fs::copy(shipped(from), to).expect("copied");
    }
    place
}

fn options(place: &Path) -> Options {
    Options {
        graph: place.join("graph/texturepad.ron"),
        set: Vec::new(),
        endpoints: None,
        port: 0,
        out: place.join("out"),
        surfaces: Vec::new(),
        lan: None,
        learner: None,
    }
}

fn open(options: &Options) -> Studio {
    Studio::open(options, &haptograph_nodes::registry()).expect("a studio")
}

fn surface(page: &mut Page, path: impl AsRef<Path>) -> Value {
    let value = format!("{:?}", path.as_ref().to_string_lossy());
    page.request(json!({ "type": "parameter", "name": "surface", "value": value }))
}

fn text_of(page: &Page) -> String {
    page.graph["text"].as_str().expect("a text").to_owned()
}

fn codes(reply: &Value) -> Vec<&str> {
    let found = reply["diagnostics"].as_array().expect("a list");
    found.iter().filter_map(|one| one["code"].as_str()).collect()
}

#[test]
fn a_page_names_no_file_outside_its_folders_whether_it_is_there_or_not() {
    let place = place();
    let at = |name: &str| place.path().join(name);
    symlink(at("other/t3-tile.ron"), at("graph/surfaces/link.ron")).expect("a link");
    symlink(at("other"), at("graph/surfaces/folder")).expect("a link");
    symlink("/", at("graph/root")).expect("a link");
    let studio = open(&options(place.path()));
    let mut page = Page::at(&studio, studio.address());
    let listed = page.graph["surfaces"].to_string();
    assert!(listed.contains("canvas") && !listed.contains("link.ron"), "{listed}");
    let text = text_of(&page);
    for path in [
        &*at("other/t3-tile.ron").to_string_lossy(),
        "../other/t3-tile.ron",
        "surfaces/../../other/t3-tile.ron",
        "surfaces/link.ron",
        "surfaces/folder/t3-tile.ron",
        "root/etc/passwd",
        "../other/none.ron",
        "/etc/passwd",
        "/etc/none",
        "/proc/self/environ",
        "/proc/self/root/etc/passwd",
        "/dev/zero",
        "/dev/stdin",
    ] {
        let reply = surface(&mut page, path);
        assert_eq!((&reply["ok"], codes(&reply)), (&json!(false), vec!["E0112"]), "{path}: {reply}");
        assert!(!reply.to_string().contains("root:"), "{reply}");
        // Paths in a text are relative to its file.
        let included = text.replace("\"std/texture.ron\"", &format!("\"std/texture.ron\", {path:?}"));
        let named = text.replace("\"surfaces/t2-canvas.ron\"", &format!("{path:?}"));
        assert!(included != text && named != text);
        for edited in [included, named] {
            for way in ["check", "apply", "save"] {
                let reply = page.request(json!({ "type": way, "text": edited }));
                assert!(reply["ok"] == false && codes(&reply).contains(&"E0112"), "{way} {path}: {reply}");
            }
        }
    }
    assert_eq!(std::fs::read_to_string(at("graph/texturepad.ron")).expect("it is there"), text);
    page.wait(|said| said["type"] == "status" && said["state"] == "running");
    assert_eq!(surface(&mut page, "surfaces/../surfaces/t2-canvas.ron")["ok"], true);
}

#[test]
fn pipes_and_folders_within_are_refused_without_waiting() {
    let place = place();
    let pipe = place.path().join("graph/surfaces/pipe.ron");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo");
    assert!(made.success());
    let studio = open(&options(place.path()));
    let mut page = Page::at(&studio, studio.address());
    let text = text_of(&page);
    for path in ["surfaces/pipe.ron", "surfaces"] {
        let named = text.replace("surfaces/t2-canvas.ron", path);
        let reply = page.request(json!({ "type": "apply", "text": named }));
        assert!(reply["ok"] == false && codes(&reply) != ["E0112"], "{path}: {reply}");
    }
}

#[test]
fn a_surface_is_named_from_the_folder_of_the_graph_quoted_or_not_and_a_missing_one_is_missing() {
    let place = place();
    let studio = open(&options(place.path()));
    let mut page = Page::at(&studio, studio.address());
    let mut set =
        |value: &str| page.request(json!({ "type": "parameter", "name": "surface", "value": value }));
    assert_eq!(set("surfaces/t2-canvas.ron")["ok"], true);
    for value in ["surfaces/none.ron", "\"surfaces/none.ron\""] {
        let reply = set(value);
        let message = &reply["diagnostics"][0]["message"];
        assert!(
            !codes(&reply).is_empty()
                && codes(&reply) != ["E0112"]
                && message.to_string().contains("graph/surfaces/none.ron"),
            "{reply}"
        );
    }
    assert_eq!(codes(&set("../other/t3-tile.ron")), ["E0112"]);
}

#[test]
fn only_reports_of_this_studio_are_seen_and_no_link_is_followed() {
    let place = place();
    let at = |name: &str| place.path().join(name);
    std::fs::create_dir_all(at("out/secret")).expect("made");
    std::fs::write(at("out/secret/report.html"), "private").expect("written");
    symlink(at("out/secret"), at("out/texturepad-strokes-1")).expect("a link");
    let studio = open(&Options { lan: Some(LAN), ..options(place.path()) });
    let mut page = Page::at(&studio, studio.address());
    page.say(&json!({ "type": "record", "on": true }));
    page.wait(|said| said["type"] == "graph");
    page.stroke(100.0, 1.0, 0.0);
    page.say(&json!({ "type": "record", "on": false }));
    let kept = page.wait(|said| said["type"] == "recording");
    assert_eq!(kept["report"], "texturepad-strokes-2", "{kept}");
    let doors = [studio.address(), SocketAddr::new(LAN, studio.address().port())];
    let all = |folder: &str| {
        let path = format!("/report/{folder}?token={}", studio.token());
        doors.map(|door| status(door, &path, &format!("Host: {door}")))
    };
    assert_eq!(all("texturepad-strokes-2"), ["200", "200"]);
    for other in ["secret", "texturepad-strokes-1", "none", "..", "%2e%2e%2fout%2fsecret"] {
        assert_eq!(all(other), ["404", "404"], "{other}");
    }
    let report = at("out/texturepad-strokes-2/report.html");
    std::fs::remove_file(&report).expect("it is there");
    symlink(at("out/secret/report.html"), &report).expect("a link");
    assert_eq!(all("texturepad-strokes-2"), ["404", "404"]);
}

#[test]
fn folders_of_surfaces_and_what_the_file_names_itself_can_be_read() {
    let place = place();
    let other = place.path().join("other/t3-tile.ron");
    // By --set, and so by whoever opens the studio.
    let set = vec![("surface".to_owned(), format!("{:?}", other.to_string_lossy()))];
    let studio = open(&Options { set, ..options(place.path()) });
    let mut page = Page::at(&studio, studio.address());
    assert_eq!(surface(&mut page, "surfaces/t2-canvas.ron")["ok"], true);
    assert_eq!(surface(&mut page, &other)["ok"], true, "the same file again");
    std::fs::copy(&other, place.path().join("other/another.ron")).expect("copied");
    assert_eq!(codes(&surface(&mut page, place.path().join("other/another.ron"))), ["E0112"]);
    drop((page, studio));
    let surfaces = vec![place.path().join("other")];
    let studio = open(&Options { surfaces, ..options(place.path()) });
    let mut page = Page::at(&studio, studio.address());
    let listed = page.graph["surfaces"].as_array().expect("a list").clone();
    assert_eq!(listed.len(), 3);
    for surface in listed {
        let value = surface["path"].clone();
        let reply = page.request(json!({ "type": "parameter", "name": "surface", "value": value }));
        assert_eq!(reply["ok"], true, "{reply}");
    }
    let surfaces = vec![place.path().join("none")];
    let none = Options { surfaces, ..options(place.path()) };
    assert!(Studio::open(&none, &haptograph_nodes::registry()).is_err());
}

/// The status of a plain request with these headers.
fn status(address: SocketAddr, path: &str, headers: &str) -> String {
    let answer = answer(address, path, headers);
    answer.split(' ').nth(1).unwrap_or_default().to_owned()
}

/// The whole answer.
fn answer(address: SocketAddr, path: &str, headers: &str) -> String {
    let mut stream = TcpStream::connect(address).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
    write!(stream, "GET {path} HTTP/1.1\r\n{headers}\r\nConnection: close\r\n\r\n").expect("sent");
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

fn open_gallery(place: &Path) -> Studio {
    // What a program carries has no links on the way.
    let graph = shipped("").canonicalize().expect("it ships");
    let options = Options { graph, lan: Some(LAN), ..options(place) };
    let saved = place.join("saved");
    Studio::open_gallery(&options, &haptograph_nodes::registry(), saved).expect("a studio")
}

#[test]
fn a_page_of_this_machine_chooses_from_the_gallery_and_saves_copies() {
    let place = tempfile::tempdir().expect("a folder");
    let studio = open_gallery(place.path());
    let (here, token) = (studio.address(), studio.token().to_owned());
    let at = |address: SocketAddr, path: &str| answer(address, path, &format!("Host: {address}"));
    let get = |path: &str| at(here, path);
    assert!(
        get("/").starts_with("HTTP/1.1 403") && get("/studio.html?graph=click").starts_with("HTTP/1.1 403")
    );
    assert!(get(&format!("/?token={token}")).contains("gallery.js"));
    let cards = get("/gallery.json");
    assert!(cards.contains("\"name\":\"grating\"") && cards.contains("pictures/grating.svg"), "{cards}");
    assert!(get("/pictures/grating.svg").contains("simulated"));
    assert!(get("/pictures/none.svg").starts_with("HTTP/1.1 404"));
    let mut first = Page::of(&studio);
    assert_eq!(first.graph["name"], "texturepad");
    // A page of the network sees what runs.
    let far = SocketAddr::new(LAN, here.port());
    assert!(at(far, &format!("/?token={token}&graph=grating")).contains("app.js"));
    assert!(first.request(json!({ "type": "check", "text": text_of(&first) }))["ok"].is_boolean());
    assert!(get(&format!("/studio.html?token={token}&graph=none")).starts_with("HTTP/1.1 409"));
    assert!(get(&format!("/studio.html?token={token}&graph=grating")).contains("app.js"));
    // The others reconnect.
    while first.socket.read().is_ok() {}
    let mut page = Page::of(&studio);
    assert_eq!(page.graph["name"], "grating");
    let saved = place.path().join("saved/cookbook/grating.ron");
    assert_eq!(page.graph["path"], saved.display().to_string());
    let original = std::fs::read_to_string(shipped("cookbook/grating.ron")).expect("it ships");
    let changed = format!("// mine\n{original}");
    let reply = page.request(json!({ "type": "save", "text": changed }));
    assert_eq!(reply["ok"], true, "{reply}");
    assert_eq!(std::fs::read_to_string(&saved).expect("written"), changed);
    assert_eq!(std::fs::read_to_string(shipped("cookbook/grating.ron")).expect("it ships"), original);
    let copy = Options { graph: saved.clone(), ..options(place.path()) };
    assert_eq!(Page::of(&open(&copy)).graph["text"], changed);
    // Another time the copy that is there is not lost.
    drop(studio);
    let studio = open_gallery(place.path());
    let (here, token) = (studio.address(), studio.token().to_owned());
    answer(here, &format!("/studio.html?token={token}&graph=grating"), &format!("Host: {here}"));
    let mut page = Page::of(&studio);
    assert_eq!(page.request(json!({ "type": "save", "text": original }))["ok"], false);
    assert_eq!(std::fs::read_to_string(&saved).expect("written"), changed);
}

#[test]
fn a_page_of_the_network_is_let_in_by_that_address_alone() {
    let place = place();
    let studio = open(&Options { lan: Some(LAN), ..options(place.path()) });
    let (here, token) = (studio.address(), studio.token());
    let lan = SocketAddr::new(LAN, here.port());
    assert_eq!(studio.lan_url(), Some(format!("http://{lan}/?token={token}")));
    let page = format!("/?token={token}");
    let page = page.as_str();
    for (address, path, headers, expected) in [
        (lan, page, format!("Host: {lan}"), "200"),
        (here, page, format!("Host: {here}"), "200"),
        (lan, "/", format!("Host: {lan}"), "403"),
        (lan, page, format!("Host: {here}"), "403"),
        (lan, page, format!("Host: localhost:{}", here.port()), "403"),
        (lan, page, format!("Host: evil.example:{}", here.port()), "403"),
        (here, page, format!("Host: {lan}"), "403"),
        (lan, page, format!("Host: {lan}\r\nOrigin: http://evil.example"), "403"),
        (lan, page, format!("Host: {lan}\r\nOrigin: http://{here}"), "403"),
        (here, page, format!("Host: {here}\r\nOrigin: http://{lan}"), "403"),
    ] {
        assert_eq!(status(address, path, &headers), expected, "{address} {path} {headers}");
    }
    let nowhere = SocketAddr::new(Ipv4Addr::new(127, 0, 0, 3).into(), here.port());
    assert!(TcpStream::connect(nowhere).is_err(), "no other address");
    drop(studio);
    let studio = open(&options(place.path()));
    assert_eq!(studio.lan_url(), None);
    assert!(TcpStream::connect(SocketAddr::new(LAN, studio.address().port())).is_err());
}

#[test]
fn a_page_of_the_network_has_the_pad_and_the_settings_and_nothing_that_lasts() {
    let place = place();
    let studio = open(&Options { lan: Some(LAN), ..options(place.path()) });
    let mut page = Page::at(&studio, SocketAddr::new(LAN, studio.address().port()));
    assert_eq!(page.hello["from"], "network");
    for what in ["edit", "save", "record", "surfaces"] {
        assert_eq!(page.hello["can"][what], false, "{what}");
    }
    let text = text_of(&page);
    let edited = text.replace("nodes: {", "nodes: { ");
    let learn = json!({ "type": "learn", "name": "x.csv", "csv": "" });
    let recording = json!({
        "format": 1, "haptograph": "", "graph": "", "text": "", "set": [], "rate_hz": 48000.0, "frames": 9, "moves": [], "turns": [],
    });
    for message in [
        json!({ "type": "check", "request": 1, "text": edited }),
        json!({ "type": "apply", "text": edited }),
        json!({ "type": "save", "text": edited }),
        json!({ "type": "replay", "recording": recording }),
        learn,
    ] {
        let reply = page.request(message);
        let why = reply["error"].as_str().unwrap_or_default();
        assert!(reply["ok"] == false && why.contains("network"), "{reply}");
    }
    page.say(&json!({ "type": "record", "on": true }));
    page.wait(|said| said["type"] == "refused");
    assert_eq!(std::fs::read_to_string(place.path().join("graph/texturepad.ron")).expect("there"), text);
    assert!(!place.path().join("out").exists());
    // The pad, the settings and STOP are its own.
    let pointer =
        [[1_u8, 0, 1, 0, 0, 0, 0, 0].as_slice(), &[0; 8], &[0; 8], &1_f32.to_le_bytes(), &[0; 8]].concat();
    page.socket.send(Message::binary(pointer)).expect("heard");
    page.wait(|said| said["type"] == "status" && said["pointer"]["count"] == 1);
    let gain = page.request(json!({ "type": "parameter", "name": "gain", "value": "0.1" }));
    assert_eq!(gain["ok"], true, "{gain}");
    // It changes no device, and asks nobody at the terminal to.
    let hand = page.request(json!({ "type": "parameter", "name": "hand", "value": "\"/dev/input/event0\"" }));
    assert_eq!(hand["ok"], false, "{hand}");
    assert!(studio.proposal().is_none());
    let mut here = Page::at(&studio, studio.address());
    assert_eq!((&here.hello["from"], &here.hello["can"]["edit"]), (&json!("machine"), &json!(true)));
    page.say(&json!({ "type": "stop" }));
    here.wait(|said| said["type"] == "status" && said["state"] == "stopped");
}
