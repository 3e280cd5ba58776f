//! Runs a transcript of calls on the engine that is compiled for this machine, in the order of a page's module, and
//! writes the played samples as little-endian doubles: `transcript GRAPH <calls >samples`. The WebAssembly module must
//! give the same samples (`studio/tests/engine.mjs`).
//!
//! A call is two numbers of 32 bits, a kind and a count: kind 0 runs `count` frames, kind 1 takes a binary message of
//! `count` bytes, kind 2 a JSON message.

use haptograph_studio::page::{Engine, Message, Opened};
use std::io::{Read, Write};
use std::time::Duration;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let graph = std::env::args_os().nth(1).ok_or("name a graph")?;
    let opened = Opened { file: graph.into(), set: Vec::new() };
    let mut engine = Engine::open(opened, &haptograph_nodes::registry())?;
    let mut calls = Vec::new();
    std::io::stdin().read_to_end(&mut calls)?;
    let (mut calls, mut out) = (&calls[..], std::io::BufWriter::new(std::io::stdout()));
    while let Some((head, rest)) = calls.split_first_chunk::<8>() {
        let [what, count] =
            [&head[..4], &head[4..]].map(|four| u32::from_le_bytes(four.try_into().unwrap_or_default()));
        let length = if what == 0 { 0 } else { count as usize };
        let (bytes, rest) = rest.split_at_checked(length).ok_or("the transcript is cut short")?;
        calls = rest;
        match what {
            0 => {
                for sample in engine.process(count as usize) {
                    out.write_all(&sample.to_le_bytes())?;
                }
                engine.publish(Duration::from_millis(10), Duration::ZERO);
                while engine.next_message(0).is_some() {}
            }
            1 => engine.hear(0, &Message::Binary(bytes.to_vec())),
            _ => engine.hear(0, &Message::Text(String::from_utf8(bytes.to_vec())?)),
        }
    }
    Ok(())
}
