//! Debian's `libshaderc-dev` ships `libshaderc_combined.a` without glslang and SPIRV-Tools inside, so a
//! program linked against it alone has undefined symbols. This names the archives that hold them. On a
//! system without these files nothing is printed and the shaderc crate's own choice stands.
use std::path::Path;

const ARCHIVES: [&str; 10] = [
    "shaderc_combined",
    "glslang",
    "MachineIndependent",
    "GenericCodeGen",
    "OSDependent",
    "OGLCompiler",
    "HLSL",
    "SPIRV",
    "SPIRV-Tools-opt",
    "SPIRV-Tools",
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let triple = std::env::var("HOST").unwrap_or_default().replace("-unknown", "");
    let folder = format!("/usr/lib/{triple}");
    if !ARCHIVES.iter().all(|name| Path::new(&format!("{folder}/lib{name}.a")).exists()) {
        return;
    }
    println!("cargo:rustc-link-search=native={folder}");
    for name in ARCHIVES {
        println!("cargo:rustc-link-lib=static={name}");
    }
    println!("cargo:rustc-link-lib=dylib=stdc++");
}
