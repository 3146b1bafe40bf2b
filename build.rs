//! Compiles every kernel and every variant of the table below to SPIR-V, and writes Rust code for the crate to include. The code
//! has a typed value for every module with the host's function of the kernel, for every block that a module binds and for every specialization constant, so a
//! wrong name does not compile. It also has the Rust side of the structs that host and kernels share. The output
//! depends only on the sources.
extern crate shaderc_link;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

#[path = "glsl/shared.rs"]
#[expect(dead_code, reason = "the Rust side is for the crate of the kernels")]
mod shared;
#[path = "glsl/spirv.rs"]
mod spirv;

/// (variant, source in glsl/, macros): modules beside the one that every source is by itself. A variant is a separate module only
/// where it needs other extensions or types; every other choice is a specialization constant.
const VARIANTS: &[(&str, &str, &[&str])] = &[
    ("forward_fixed", "forward", &["ACCUMULATE_FIXED"]),
    ("forward_float", "forward", &["ACCUMULATE_FLOAT"]),
    ("forward_product_fixed", "forward_product", &["ACCUMULATE_FIXED"]),
    ("forward_product_float", "forward_product", &["ACCUMULATE_FLOAT"]),
    ("limit_scattered_atomic_float", "limit_scattered_atomic", &["ACCUMULATE_FLOAT"]),
    ("pulse_fixed", "pulse", &["ACCUMULATE_FIXED"]),
    ("residual_fixed", "residual", &["ACCUMULATE_FIXED"]),
    ("residual_rows_fixed", "residual_rows", &["ACCUMULATE_FIXED"]),
    ("residual_scan_fixed", "residual_scan", &["ACCUMULATE_FIXED"]),
    ("spot_fixed", "spot", &["ACCUMULATE_FIXED"]),
];

/// Sources that make a module only with the macros of a variant.
const ONLY_VARIANTS: [&str; 2] = ["forward", "forward_product"];

/// Every module in order: variant, source, macros.
fn kernels() -> Vec<(String, String, &'static [&'static str])> {
    let files = fs::read_dir("glsl").expect("the kernels").map(|entry| entry.expect("an entry").path());
    let sources = files.filter(|path| path.extension().is_some_and(|end| end == "comp"));
    let stems = sources.map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned());
    let plain = stems
        .filter(|stem| !ONLY_VARIANTS.contains(&stem.as_str()))
        .map(|stem| (stem.clone(), stem, &[][..]));
    let varied =
        VARIANTS.iter().map(|(name, source, macros)| (name.to_string(), source.to_string(), *macros));
    let mut all: Vec<_> = plain.chain(varied).collect();
    all.sort();
    all
}

/// The kernel of a source as a function of the host, as Rust code. Probes of a device's limits have none.
fn host_function(source: &str) -> String {
    if source.starts_with("limit_") {
        "None".into()
    } else {
        format!("Some(thirdbounce_kernels::{source}::<f32>)")
    }
}

/// The passes of `examples/vulkan`.
const EXAMPLES: &[&str] = &["light", "colour"];

/// If this environment variable is set, kernels are compiled without optimisation.
const UNOPTIMISED: &str = "THIRDBOUNCE_UNOPTIMISED";

fn main() {
    println!("cargo:rerun-if-changed=glsl");
    println!("cargo:rerun-if-changed=examples/vulkan");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed={UNOPTIMISED}");
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets OUT_DIR"));
    let compiler = shaderc::Compiler::new().unwrap_or_else(|e| {
        panic!("shaderc does not start ({e}). On Debian: apt-get install libshaderc-dev. On other systems, install cmake, git, python3 and a C++ compiler, so that the shaderc crate can build shaderc")
    });

    let mut rust = String::from("// Written by build.rs.\n\n");
    let kernels = kernels();
    let mut modules = String::new();
    let (mut blocks, mut constants) = (BTreeSet::new(), BTreeSet::new());
    for (name, source, macros) in &kernels {
        let source = format!("{source}.comp");
        let words = compile(&compiler, &Path::new("glsl").join(&source), macros);
        let file = out.join(format!("{name}.spv"));
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        fs::write(&file, bytes).expect("OUT_DIR is writable");
        let module = spirv::reflect(&words);
        let _ = writeln!(
            modules,
            "    /// `glsl/{source}`{}.\n    pub static {}: KernelCode = KernelCode {{\n        name: \"{name}\",\n        host: {},\n        spirv: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.spv\")),\n        bindings: &[",
            if macros.is_empty() { String::new() } else { format!(" with {}", macros.join(", ")) },
            name.to_uppercase(),
            host_function(source.trim_end_matches(".comp")),
        );
        for b in module.bindings {
            let _ = writeln!(
                modules,
                "            Binding {{ block: buffer::{}, slot: {}, view: {}, reads: {}, writes: {} }},",
                b.name.to_uppercase(),
                b.slot,
                b.view,
                b.reads,
                b.writes
            );
            blocks.insert(b.name);
        }
        modules.push_str("        ],\n        constants: &[\n");
        for c in module.constants {
            let _ = writeln!(modules, "            (constant::{}, {}),", c.name, c.id);
            constants.insert(c.name);
        }
        modules.push_str("        ],\n    };\n");
    }
    rust.push_str("/// All compiled modules.\npub static KERNELS: &[&KernelCode] = &[\n");
    for (name, ..) in &kernels {
        let _ = writeln!(rust, "    &kernel::{},", name.to_uppercase());
    }
    rust.push_str("];\n\n/// Compiled modules.\npub mod kernel {\n    use super::{Binding, KernelCode, View, buffer, constant};\n\n");
    rust.push_str(&modules);
    rust.push_str("}\n\n/// Blocks of the kernels. Each binds the buffer of its name unless a schedule binds another.\npub mod buffer {\n    use super::Buffer;\n\n");
    for name in blocks {
        let _ = writeln!(
            rust,
            "    /// Block `{name}`, which binds the buffer of that name.\n    pub const {}: Buffer = Buffer::named(\"{name}\");",
            name.to_uppercase()
        );
    }
    rust.push_str(
        "}\n\n/// Specialization constants of the kernels.\npub mod constant {\n    use super::Constant;\n\n",
    );
    for name in constants {
        let _ = writeln!(
            rust,
            "    /// Specialization constant `{name}`.\n    pub const {name}: Constant = Constant::named(\"{name}\");"
        );
    }
    rust.push_str("}\n");
    fs::write(out.join("kernels.rs"), rust).expect("OUT_DIR is writable");
    for name in EXAMPLES {
        let words = compile(&compiler, &Path::new("examples/vulkan").join(format!("{name}.comp")), &[]);
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        fs::write(out.join(format!("example_{name}.spv")), bytes).expect("OUT_DIR is writable");
    }
}

fn compile(compiler: &shaderc::Compiler, path: &Path, macros: &[&str]) -> Vec<u32> {
    let mut options = shaderc::CompileOptions::new().expect("shaderc gives options");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_target_spirv(shaderc::SpirvVersion::V1_5);
    // GPU-assisted validation needs unoptimised kernels: the layer cannot instrument loops after the optimiser.
    options.set_optimization_level(match env::var_os(UNOPTIMISED) {
        Some(_) => shaderc::OptimizationLevel::Zero,
        None => shaderc::OptimizationLevel::Performance,
    });
    // Keeps the names of blocks and constants: the host binds by name.
    options.set_generate_debug_info();
    options.set_warnings_as_errors();
    for m in macros {
        options.add_macro_definition(m, Some("1"));
    }
    options.set_include_callback(|wanted, _, from, _| {
        let content = if wanted == "shared.glsl" {
            shared::glsl()
        } else if let Some(block) = wanted.strip_suffix("_block.glsl").and_then(shared::block) {
            block
        } else {
            let path = Path::new("glsl/include").join(wanted);
            fs::read_to_string(&path).map_err(|e| format!("{from} includes {}: {e}", path.display()))?
        };
        Ok(shaderc::ResolvedInclude { resolved_name: wanted.to_string(), content })
    });
    let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let artifact = compiler
        .compile_into_spirv(
            &text,
            shaderc::ShaderKind::Compute,
            &path.to_string_lossy(),
            "main",
            Some(&options),
        )
        .unwrap_or_else(|e| panic!("{} {macros:?}: {e}", path.display()));
    artifact.as_binary().to_vec()
}
