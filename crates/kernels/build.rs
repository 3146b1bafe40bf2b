//! Writes the Rust side of the structs and numbers that kernels share with their callers (`glsl/shared.rs`).

use std::path::Path;
use std::{env, fs};

#[path = "../../glsl/shared.rs"]
#[expect(dead_code, reason = "the GLSL side is for the build of the modules")]
mod shared;

fn main() {
    println!("cargo:rerun-if-changed=../../glsl/shared.rs");
    println!("cargo:rerun-if-changed=build.rs");
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let text = format!("// Written by build.rs.\n\n{}", shared::rust());
    fs::write(Path::new(&out).join("shared.rs"), text).expect("OUT_DIR is writable");
}
