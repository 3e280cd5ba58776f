//! Includes the WebAssembly engine if `studio/build-site` has built it; without the engine no site can be exported.

#![allow(clippy::print_stdout)]

use std::path::Path;

fn main() {
    let built = Path::new("engine.wasm");
    println!("cargo:rerun-if-changed={}", built.display());
    let module = match built.exists() {
        true => std::fs::read(built).expect("the module can be read"),
        false => Vec::new(),
    };
    let folder = std::env::var_os("OUT_DIR").expect("cargo gives a folder");
    std::fs::write(Path::new(&folder).join("engine.wasm"), module).expect("the module can be copied");
}
