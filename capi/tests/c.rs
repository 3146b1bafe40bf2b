//! The programs in `examples/c` and `examples/cpp`: compiled with warnings as errors, linked to the library, run. The
//! header declares the exports of the library.
#![cfg(target_os = "linux")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Once;

use thirdbounce_simulate::{RenderOptions, Scene, with_truth};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Folder with the library. A test cannot depend on a C library, so it is built here once, of what the tests of this run have built:
/// other features or packages would compile most of it again. `make test` says in THIRDBOUNCE_TESTED what it builds.
fn library() -> PathBuf {
    static BUILT: Once = Once::new();
    let test = std::env::current_exe().expect("a test has a path");
    let folder = test.ancestors().nth(2).expect("a test is in `deps`").to_path_buf();
    BUILT.call_once(|| {
        let mut build = Command::new(env!("CARGO"));
        // With `--test`, dependencies have the features that they have in tests.
        build.args(["build", "--locked", "--quiet", "--lib", "--test", "c"]);
        let tested = std::env::var("THIRDBOUNCE_TESTED");
        build.args(tested.as_deref().unwrap_or("-p thirdbounce -p thirdbounce-capi").split_whitespace());
        if folder.ends_with("release") {
            build.arg("--release");
        }
        run(build.arg("--target-dir").arg(folder.join("..")).current_dir(root()));
    });
    folder
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let [out, errors] =
        [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    assert!(output.status.success(), "{command:?}\n{out}{errors}");
    out
}

/// Compiles an example with `flags`, and runs it in `folder`.
fn example(source: &str, flags: &[&str], environment: &[(&str, &str)]) -> (tempfile::TempDir, String) {
    example_with(source, flags, environment, &["last.pgm"])
}

fn example_with(
    source: &str,
    flags: &[&str],
    environment: &[(&str, &str)],
    arguments: &[&str],
) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("program");
    let (compiler, standard) =
        if source.ends_with(".c") { ("cc", "-std=c11") } else { ("c++", "-std=c++17") };
    // The link has the library's soname.
    let soname =
        format!("libthirdbounce.so.{}.{}", env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"));
    std::os::unix::fs::symlink(library().join("libthirdbounce.so"), folder.path().join(soname))
        .expect("a link");
    run(Command::new(compiler)
        .args([standard, "-Wall", "-Wextra", "-Wshadow", "-Werror", "-pedantic", "-O1", "-g", "-I"])
        .arg(root().join("include"))
        .args(flags)
        .arg(root().join("examples").join(source))
        .arg("-L")
        .arg(library())
        .args(if source.ends_with("vulkan.c") { &["-lvulkan"][..] } else { &[] })
        .args(["-lthirdbounce", "-lpthread", "-lm", "-o"])
        .arg(&program));
    let mut command = Command::new(&program);
    command.args(arguments).current_dir(folder.path()).env("LD_LIBRARY_PATH", folder.path());
    let text = run(command.envs(environment.iter().copied()));
    (folder, text)
}

fn captures(flags: &[&str], environment: &[(&str, &str)]) {
    let (folder, text) = example("c/capture.c", flags, environment);
    let frames = text.lines().filter(|l| l.starts_with("frame ") && !l.contains(" 0 pixels")).count();
    assert!(frames == 4 && text.contains("progress of every frame"), "{text}");
    // The first frame is cold.
    assert!(text.contains("surface, cold\n") && text.contains("surface, warm\n"), "{text}");
    let picture = std::fs::read(folder.path().join("last.pgm")).expect("a picture");
    assert!(picture.starts_with(b"P5 32 32 255\n") && picture.len() == 13 + 32 * 32);
    assert!(picture[13..].contains(&255), "the brightest pixel is white");
}

fn lends(flags: &[&str], environment: &[(&str, &str)]) {
    let (folder, text) = example("c/vulkan.c", flags, environment);
    let frames = text.lines().filter(|l| l.contains("pixels of surface") && l.ends_with("maps done"));
    assert_eq!(frames.filter(|l| !l.contains(" 0 pixels")).count(), 2, "{text}");
    let picture = std::fs::read(folder.path().join("last.pgm")).expect("a picture");
    assert!(picture.len() == 13 + 32 * 32 && picture[13..].contains(&255));
}

fn cancels(flags: &[&str], environment: &[(&str, &str)]) {
    let (_folder, text) = example("cpp/cancel.cpp", flags, environment);
    for words in [
        "3 counts for 64 pairs",
        "NaN",
        "nothing to wait for",
        "no setting \"no_such\"",
        "available 1000 B",
        "`laser_xyz` of tb_scan is NULL; `sensor_xyz` is set",
        "the size of tb_vulkan is 0",
        "`counts` is NULL",
        "cancelled",
        "as it should be",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
}

/// A thread submits partial scans while another one waits.
fn feeds(flags: &[&str], environment: &[(&str, &str)]) {
    let (_folder, text) = example("cpp/camera.cpp", flags, environment);
    assert!(text.contains("every frame was shown or dropped"), "{text}");
}

#[test]
fn a_cpp_program_feeds_parts_of_a_scan() {
    feeds(&[], &[]);
}

/// As a program with CMake finds the installed package.
#[test]
fn a_cpp_program_finds_the_package_and_lists_devices() {
    let folder = tempfile::tempdir().expect("a folder");
    let prefix = folder.path().join("usr");
    for part in ["lib/cmake/thirdbounce", "include"] {
        std::fs::create_dir_all(prefix.join(part)).expect("a folder");
    }
    let copy = |from: PathBuf, to: &str| std::fs::copy(from, prefix.join(to)).expect("a copy");
    copy(library().join("libthirdbounce.so"), "lib/libthirdbounce.so");
    let soname =
        format!("libthirdbounce.so.{}.{}", env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"));
    std::os::unix::fs::symlink("libthirdbounce.so", prefix.join("lib").join(soname)).expect("a link");
    for header in ["thirdbounce.h", "thirdbounce.hpp"] {
        copy(root().join("include").join(header), &format!("include/{header}"));
    }
    let config = "lib/cmake/thirdbounce/thirdbounceConfig.cmake";
    copy(root().join("capi/cmake/thirdbounceConfig.cmake"), config);
    let version = std::fs::read_to_string(root().join("capi/cmake/thirdbounceConfigVersion.cmake.in"))
        .expect("text")
        .replace("@VERSION@", env!("CARGO_PKG_VERSION"));
    std::fs::write(prefix.join("lib/cmake/thirdbounce/thirdbounceConfigVersion.cmake"), version)
        .expect("a file");
    let (source, project) = (folder.path().join("list.cpp"), folder.path().join("CMakeLists.txt"));
    let program = "#include <cstdio>\n#include <thirdbounce.hpp>\nint main() {\n  for (const auto &d : thirdbounce::devices()) std::printf(\"%s|%s|%s\\n\", d.name, d.kind, d.uuid);\n  tb_device_info none{};\n  none.size = sizeof none;\n  return tb_device_info_at(1000, &none) == TB_ERROR_OPTIONS ? 0 : 1;\n}\n";
    std::fs::write(&source, program).expect("a file");
    let lines = "cmake_minimum_required(VERSION 3.13)\nproject(list CXX)\nset(CMAKE_CXX_STANDARD 17)\nfind_package(thirdbounce 0.1 REQUIRED)\nadd_executable(list list.cpp)\ntarget_link_libraries(list thirdbounce::thirdbounce)\n";
    std::fs::write(&project, lines).expect("a file");
    let build = folder.path().join("build");
    if Command::new("cmake").arg("--version").output().is_ok_and(|o| o.status.success()) {
        let prefix = format!("-DCMAKE_PREFIX_PATH={}", prefix.display());
        run(Command::new("cmake").arg("-S").arg(folder.path()).arg("-B").arg(&build).arg(prefix));
        run(Command::new("cmake").arg("--build").arg(&build));
    } else {
        eprintln!("skipped: the package is not found with CMake, as that is not installed");
        std::fs::create_dir(&build).expect("a folder");
        run(Command::new("c++")
            .args(["-std=c++17", "-Wall", "-Wextra", "-Werror", "-I"])
            .arg(prefix.join("include"))
            .arg(&source)
            .arg("-L")
            .arg(prefix.join("lib"))
            .args(["-lthirdbounce", "-o"])
            .arg(build.join("list")));
    }
    let text = run(Command::new(build.join("list")).env("LD_LIBRARY_PATH", prefix.join("lib")));
    let first: Vec<&str> = text.lines().next().expect("a device").split('|').collect();
    assert!(!first[0].is_empty() && !first[1].is_empty() && first[2].len() == 32, "{text}");
}

#[test]
fn a_c_program_captures() {
    captures(&[], &[]);
}

/// A small capture of a letter as `capture.npz` in a folder, and its truth.
fn letter(folder: &Path) -> (PathBuf, engine::Truth) {
    let file = folder.join("capture.npz");
    let scene = Scene { scan: 12, bin_width: 0.02, ..Scene::named("letter:T").expect("a scene") };
    let options = RenderOptions { noise: 0.05, ..RenderOptions::default() };
    let (capture, truth) = with_truth(&scene, &options, 16).expect("a capture");
    engine::capture::write(&capture, &file).expect("a file");
    (file, truth)
}

fn is_the_letter(folder: &Path, text: &str, truth: &engine::Truth) {
    assert!(text.contains(" pixels of surface in result") && !text.contains("\n0 pixels"), "{text}");
    let maps = engine::export::npz::read_maps(&folder.join("result/maps.npz")).expect("maps");
    let metrics = engine::evaluate(&maps, truth, None).expect("figures");
    assert!(metrics.iou > Some(0.4) && metrics.depth_mae < Some(0.05), "{metrics:?}");
    assert!(folder.join("result/maps.mat").exists());
}

#[test]
fn a_c_program_goes_from_a_file_to_maps() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, truth) = letter(folder.path());
    let arguments = [file.to_str().expect("a path"), "result"];
    let (folder, text) = example_with("c/file.c", &[], &[], &arguments);
    is_the_letter(folder.path(), &text, &truth);
}

/// The commands of the page, in a folder with the parts of a clone. `make library` only links: the library is there.
#[test]
fn three_commands_lead_from_a_clone_to_maps() {
    let clone = tempfile::tempdir().expect("a folder");
    let link = |to: PathBuf, name: &str| {
        std::os::unix::fs::symlink(to, clone.path().join(name)).expect("a link");
    };
    for name in ["include", "examples"] {
        link(root().join(name).canonicalize().expect("a folder"), name);
    }
    std::fs::create_dir_all(clone.path().join("target/release")).expect("a folder");
    link(library().join("libthirdbounce.so"), "target/release/libthirdbounce.so");
    let (_, truth) = letter(clone.path());
    let page = std::fs::read_to_string(root().join("docs/rust-c-vulkan.md")).expect("the page");
    let lines = page.lines().map(str::trim_start).skip_while(|line| !line.starts_with("make library"));
    let commands: Vec<&str> = lines.take_while(|line| !line.is_empty()).collect();
    assert_eq!(commands.len(), 3, "{commands:?}");
    let made = run(Command::new("make")
        .args(["--dry-run", "--no-print-directory", "library"])
        .env_remove("CARGO_TARGET_DIR")
        .current_dir(root()));
    assert!(made.contains("cargo build --release --locked --package thirdbounce-capi\n"), "{made}");
    let links = made.lines().find(|line| line.starts_with("ln ")).expect("a link of the soname");
    let script = [links, commands[1], commands[2]].join(" && ");
    let text = run(Command::new("sh").args(["-c", &script]).current_dir(clone.path()));
    is_the_letter(clone.path(), &text, &truth);
}

#[test]
fn a_c_program_lends_its_own_vulkan() {
    lends(&[], &[]);
}

#[test]
fn a_cpp_program_cancels() {
    cancels(&[], &[]);
}

/// The library itself is not instrumented, which requires a nightly compiler: the sanitizers check the programs, and
/// the library's accesses to their memory through C functions. The thread sanitizer does not see the library's locks
/// and ignores its internals.
#[test]
#[ignore = "`make sanitize` runs it"]
fn the_sanitizers_have_nothing_to_say() {
    let quiet = [
        // Drivers keep memory until the process exits.
        ("ASAN_OPTIONS", "detect_leaks=0"),
        ("UBSAN_OPTIONS", "halt_on_error=1"),
        ("TSAN_OPTIONS", "ignore_noninstrumented_modules=1"),
    ];
    for flags in ["-fsanitize=address,undefined", "-fsanitize=thread"] {
        captures(&[flags], &quiet);
        lends(&[flags], &quiet);
        cancels(&[flags], &quiet);
        feeds(&[flags], &quiet);
    }
}

#[test]
fn the_header_declares_what_the_library_exports() {
    let names = |text: &str, before: &str| -> BTreeSet<String> {
        let parts = text.split(before).skip(1);
        parts.filter_map(|p| p.split_once('(')).map(|(name, _)| name.trim().to_string()).collect()
    };
    let sources = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).expect("sources");
    let exported: BTreeSet<String> = sources
        .map(|file| std::fs::read_to_string(file.expect("a file").path()).expect("text"))
        .flat_map(|text| names(&text, "extern \"C\" fn "))
        .filter(|name| name.starts_with("tb_"))
        .collect();
    let header = std::fs::read_to_string(root().join("include/thirdbounce.h")).expect("the header");
    let code: String = header.lines().filter(|l| !l.trim_start().starts_with(['*', '/'])).collect();
    let declared: BTreeSet<String> = code
        .split(|c: char| !c.is_alphanumeric() && c != '_' && c != '(')
        .filter_map(|word| word.split_once('('))
        .map(|(name, _)| name.to_string())
        .filter(|name| name.starts_with("tb_"))
        .collect();
    assert_eq!(declared, exported, "`make header` writes the header anew");
}
