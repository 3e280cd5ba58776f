//! Includes the WebAssembly engines if `studio/build-site` has built them; without these no site can be exported.

#![allow(clippy::print_stdout)]

use std::path::Path;

fn main() {
    // A new file of the page is embedded, too.
    println!("cargo:rerun-if-changed=page");
    let folder = std::env::var_os("OUT_DIR").expect("cargo gives a folder");
    for name in ["engine.wasm", "whole.wasm"] {
        println!("cargo:rerun-if-changed={name}");
        let module = match Path::new(name).exists() {
            true => std::fs::read(name).expect("the module can be read"),
            false => Vec::new(),
        };
        std::fs::write(Path::new(&folder).join(name), module).expect("the module can be copied");
    }
}
