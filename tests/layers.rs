//! Holds the modules of each crate in layers; the compiler holds the crates: none may use one that, by whatever way, uses it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A module's place in the crate: `solve::plan::buffers` as its parts.
type Module = Vec<String>;

/// Uses of modules: from, to, and where in the source.
type Uses = BTreeMap<(String, String), String>;

struct Source {
    module: Module,
    file: PathBuf,
    /// Without comments and unit tests.
    text: String,
}

fn sources(folder: &Path, into: &mut Vec<Source>, root: &Path) {
    for entry in fs::read_dir(folder).expect("the source is there") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, into, root);
            continue;
        }
        let file = path.strip_prefix(root).expect("below the root").with_extension("");
        let parts = file.iter().map(|p| p.to_string_lossy().into_owned());
        let mut module: Module = parts.skip_while(|p| p != "src").skip(1).collect();
        if ["mod", "lib", "main"].contains(&module.last().map_or("", String::as_str)) {
            module.pop();
        }
        if path.extension().is_none_or(|e| e != "rs") || path.ends_with("tests.rs") {
            continue;
        }
        let text = fs::read_to_string(&path).expect("text");
        let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
        let code: Vec<&str> = text.lines().map(|l| l.split("//").next().unwrap_or_default()).collect();
        into.push(Source { module, file, text: code.join("\n") });
    }
}

/// The sources of each crate.
fn all() -> Vec<Vec<Source>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates = fs::read_dir(root.join("crates")).expect("the crates are there");
    let mut folders: Vec<_> = crates.map(|e| e.expect("an entry").path()).collect();
    folders.extend([root.to_path_buf(), root.join("capi"), root.join("python")]);
    let of_crate = |folder: PathBuf| {
        let mut all = Vec::new();
        sources(&folder.join("src"), &mut all, root);
        all
    };
    let all: Vec<_> = folders.into_iter().map(of_crate).collect();
    assert!(all.len() > 9 && all.iter().map(Vec::len).sum::<usize>() > 300, "the source was not found");
    all
}

/// The paths of a text from `at` on, a group `{a, b::c}` as one path each; and where they end.
fn paths(text: &str, mut at: usize, before: &Module, into: &mut Vec<Module>) -> usize {
    let mut path = before.clone();
    loop {
        let rest = &text[at..];
        let word = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        if word > 0 {
            path.push(rest[..word].into());
            at += word;
        } else if rest.starts_with('{') {
            at += 1;
            while !text[at..].starts_with('}') {
                at = paths(text, at, &path, into);
                at += text[at..].find(|c: char| !c.is_whitespace() && c != ',').unwrap_or(text.len() - at);
                if text[at..].starts_with("as ") {
                    at += text[at..].find([',', '}']).unwrap_or(text.len() - at);
                    at +=
                        text[at..].find(|c: char| !c.is_whitespace() && c != ',').unwrap_or(text.len() - at);
                }
            }
            return at + 1;
        } else if rest.starts_with('*') {
            path.push("*".into());
            at += 1;
        }
        if !text[at..].starts_with("::") {
            into.push(path);
            return at;
        }
        at += 2;
    }
}

/// Every path of a source that begins at the crate, the module or the one above, from the crate's root on.
fn used(source: &Source) -> Vec<Module> {
    let mut found = Vec::new();
    for start in ["crate", "super", "self"] {
        for (at, _) in source.text.match_indices(&format!("{start}::")) {
            let before = source.text[..at].chars().next_back().unwrap_or(' ');
            if !before.is_alphanumeric() && before != '_' && before != ':' && before != '$' {
                paths(&source.text, at, &vec![], &mut found);
            }
        }
    }
    let absolute = |path: Module| {
        let mut base = source.module.clone();
        let mut rest = path.into_iter().peekable();
        while let Some(part) = rest.next_if(|p| ["crate", "super", "self"].contains(&p.as_str())) {
            match part.as_str() {
                "super" => drop(base.pop()),
                "self" => {}
                _ => base.clear(),
            }
        }
        base.extend(rest);
        base
    };
    found.into_iter().map(absolute).collect()
}

/// What a module passes on under its own name: `pub use plan::Plan` in `solve` makes `solve::Plan` one of `plan`.
fn passed_on(all: &[Source], parent: &[String]) -> BTreeMap<String, String> {
    let mut names = BTreeMap::new();
    for source in all.iter().filter(|s| s.module == parent) {
        for (at, _) in source.text.match_indices("use ") {
            // The end of another word is none.
            if source.text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
                continue;
            }
            let mut found = Vec::new();
            paths(&source.text, at + 4, &vec![], &mut found);
            for path in found.into_iter().filter(|p| p.len() > 1) {
                let first = usize::from(path[0] == "self");
                names.insert(path[path.len() - 1].clone(), path[first].clone());
            }
        }
    }
    names
}

/// Who uses whom among the modules right below `parent`.
fn uses(all: &[Source], parent: &[String]) -> Uses {
    let depth = parent.len();
    let children: BTreeSet<String> = all
        .iter()
        .filter(|s| s.module.len() > depth && s.module.starts_with(parent))
        .map(|s| s.module[depth].clone())
        .collect();
    let passed_on = passed_on(all, parent);
    let mut uses = Uses::new();
    for source in all.iter().filter(|s| s.module.len() > depth && s.module.starts_with(parent)) {
        let from = &source.module[depth];
        for path in used(source).into_iter().filter(|p| p.len() > depth && p.starts_with(parent)) {
            let name = passed_on.get(&path[depth]).filter(|_| !children.contains(&path[depth]));
            let to = name.unwrap_or(&path[depth]);
            if children.contains(to) && to != from {
                let place = format!("{}: {}", source.file.display(), path.join("::"));
                uses.entry((from.clone(), to.clone())).or_insert(place);
            }
        }
    }
    uses
}

/// Pairs of modules that use each other, by whatever way.
fn circles(uses: &Uses) -> Vec<String> {
    let mut reach: BTreeSet<(String, String)> = uses.keys().cloned().collect();
    loop {
        let further: Vec<_> = reach
            .iter()
            .flat_map(|(a, b)| {
                uses.keys().filter(move |(c, _)| c == b).map(move |(_, d)| (a.clone(), d.clone()))
            })
            .filter(|step| !reach.contains(step))
            .collect();
        if further.is_empty() {
            break;
        }
        reach.extend(further);
    }
    let back = |(a, b): &(String, String)| reach.contains(&(b.clone(), a.clone()));
    uses.iter()
        .filter(|(step, _)| back(step))
        .map(|((a, b), place)| format!("{a} -> {b}  ({place})"))
        .collect()
}

/// Crates that a program with the default features of thirdbounce compiles, at most.
const MOST_CRATES: usize = 80;

#[test]
fn a_program_that_embeds_the_engine_compiles_few_crates() {
    let arguments = [
        "tree",
        "--locked",
        "--offline",
        "--package",
        "thirdbounce",
        "--edges",
        "normal",
        "--prefix",
        "none",
    ];
    let tree = Command::new(env!("CARGO")).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    let tree = tree.expect("cargo runs");
    assert!(tree.status.success(), "{}", String::from_utf8_lossy(&tree.stderr));
    let text = String::from_utf8_lossy(&tree.stdout);
    let crates: BTreeSet<_> = text.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    assert!(crates.len() > 20 && crates.len() <= MOST_CRATES, "{}: {crates:#?}", crates.len());
}

/// Files that a pattern of the page names: a file, a folder with all below it, or either with one `*`.
fn matching(pattern: &str, into: &mut BTreeSet<PathBuf>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let Some((before, after)) = pattern.split_once('*') else {
        let path = root.join(pattern);
        if path.is_file() {
            into.insert(path);
        } else {
            for entry in fs::read_dir(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())) {
                let entry = entry.expect("an entry").path();
                matching(entry.strip_prefix(root).expect("below the root").to_str().expect("text"), into);
            }
        }
        return;
    };
    let (folder, start) = before.rsplit_once('/').expect("a folder");
    for entry in fs::read_dir(root.join(folder)).expect("the folder is there") {
        let name = entry.expect("an entry").file_name().to_string_lossy().into_owned();
        match after.starts_with('/') {
            true => matching(&format!("{folder}/{name}{after}"), into),
            false if name.starts_with(start) && name.ends_with(after) => {
                matching(&format!("{folder}/{name}"), into);
            }
            false => {}
        }
    }
}

/// Lines of a file without comments, blank lines and unit tests.
fn code_lines(file: &Path) -> usize {
    let text = fs::read_to_string(file).expect("text");
    let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//")).count()
}

/// Sizes on the page may be off by this share.
const SIZE_MARGIN: f64 = 0.02;

#[test]
fn the_page_shows_the_sizes_of_the_three_circles() {
    let page =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("ARCHITECTURE.md")).expect("text");
    let table = page.split("## ").find(|part| part.starts_with("Three circles")).expect("the section");
    let rows: Vec<_> = table.lines().filter(|line| line.starts_with("| ") && line.contains('`')).collect();
    assert_eq!(rows.len(), 3, "{table}");
    let mut circle = BTreeSet::new();
    for row in rows {
        let [_, name, parts, files, lines, _] = row.split('|').collect::<Vec<_>>()[..] else {
            panic!("{row}")
        };
        let (with, without) = parts.split_once("without").unwrap_or((parts, ""));
        let of = |text: &str| {
            let mut all = BTreeSet::new();
            text.split('`').skip(1).step_by(2).for_each(|pattern| matching(pattern, &mut all));
            all
        };
        let left_out = of(without);
        circle.extend(of(with).difference(&left_out).cloned());
        let is_code = |file: &&PathBuf| {
            let ends = ["rs", "comp", "glsl"].iter().any(|end| file.extension().is_some_and(|e| e == *end));
            ends && !file.ends_with("tests.rs")
        };
        let counted = [
            circle.iter().filter(is_code).count(),
            circle.iter().filter(is_code).map(|file| code_lines(file)).sum::<usize>(),
        ];
        let stated =
            [files, lines].map(|text| text.trim().replace(',', "").parse::<f64>().expect("a number"));
        let is_near = |i: usize| (stated[i] - counted[i] as f64).abs() <= SIZE_MARGIN * counted[i] as f64;
        assert!(is_near(0) && is_near(1), "{name}has {} files, {} lines", counted[0], counted[1]);
    }
}

/// Names of types with several definitions, at most.
const MOST_SHARED_NAMES: usize = 1;

#[test]
fn few_names_of_types_have_several_meanings() {
    let mut times: BTreeMap<String, usize> = BTreeMap::new();
    for source in all().iter().flatten() {
        for line in source.text.lines() {
            let mut words = line.split_whitespace().skip_while(|w| w.starts_with("pub") || *w == "unsafe");
            if words.next().is_some_and(|word| ["struct", "enum", "trait", "union"].contains(&word)) {
                let name = words.next().unwrap_or_default();
                let name = name.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
                if !name.is_empty() {
                    *times.entry(name.into()).or_default() += 1;
                }
            }
        }
    }
    let shared: Vec<_> = times.iter().filter(|(_, times)| **times > 1).collect();
    assert!(times.len() > 400 && shared.len() <= MOST_SHARED_NAMES, "{}: {shared:?}", shared.len());
}

/// Uses of items that are defined in a folder's `mod.rs` by modules of the folder, at most: these point up.
const MOST_UPWARD_USES: usize = 4;

/// Whether a source defines an item of this name.
fn defines(source: &Source, name: &str) -> bool {
    let kinds = ["struct", "enum", "trait", "type", "fn", "const", "static"];
    let is_word = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    kinds.iter().any(|kind| {
        let item = format!("{kind} {name}");
        let mut places = source.text.match_indices(&item);
        // A lifetime is no keyword: &'static Item.
        places.any(|(at, _)| !source.text[..at].ends_with('\'') && is_word(&source.text[at + item.len()..]))
    })
}

#[test]
fn few_modules_use_the_folder_around_them() {
    let mut upward = BTreeSet::new();
    for all in all() {
        for source in &all {
            for path in used(source) {
                for depth in (1..source.module.len()).filter(|d| path.len() > *d) {
                    let folder = &source.module[..depth];
                    let is_module = all.iter().any(|s| s.module.starts_with(&path[..depth + 1]));
                    let of_folder = |s: &&Source| s.module == folder && defines(s, &path[depth]);
                    if path.starts_with(folder) && !is_module && all.iter().any(|s| of_folder(&s)) {
                        upward.insert((source.file.clone(), folder.join("::")));
                    }
                }
            }
        }
    }
    assert!(upward.len() <= MOST_UPWARD_USES, "{}: {upward:#?}", upward.len());
}

/// Unsafe code is where Vulkan is called, and where C calls.
#[test]
fn unsafe_code_stays_in_its_place() {
    let unsafe_code = |s: &Source| s.text.contains("unsafe ");
    let all = all();
    let allowed = |s: &Source| ["crates/gpu", "capi"].iter().any(|folder| s.file.starts_with(folder));
    let outside: Vec<_> = all.iter().flatten().filter(|s| unsafe_code(s) && !allowed(s)).collect();
    assert!(outside.is_empty(), "{:?}", outside.iter().map(|s| &s.file).collect::<Vec<_>>());
    assert!(all.iter().flatten().any(unsafe_code), "it is seen where it is");
}

#[test]
fn no_module_uses_one_that_uses_it() {
    let mut circular = BTreeMap::new();
    for all in all() {
        let file = all[0].file.to_string_lossy().into_owned();
        let root = &file[..file.find("src").expect("below src") + 3];
        let parents: BTreeSet<Module> =
            all.iter().flat_map(|s| (0..s.module.len()).map(|n| s.module[..n].to_vec())).collect();
        for parent in parents {
            let found = circles(&uses(&all, &parent));
            if !found.is_empty() {
                let parts = [root].into_iter().chain(parent.iter().map(String::as_str));
                circular.insert(parts.collect::<Vec<_>>().join("/"), found.join("\n"));
            }
        }
    }
    assert!(circular.is_empty(), "modules that use each other: {circular:#?}");
}

#[test]
fn uses_are_seen_however_they_are_written() {
    let source = |module: &[&str], text: &str| Source {
        module: module.iter().map(|m| m.to_string()).collect(),
        file: module.join("/").into(),
        text: text.into(),
    };
    let all = [
        source(&["solve"], "mod plan;\npub use plan::{Plan, Level as Step};\npub use self::drive::run;"),
        source(&["solve", "plan"], "use super::run;"),
        source(&["solve", "drive", "clock"], "fn f(p: &crate::solve::Plan) {}"),
        source(&["gpu"], "use crate::{Error, solve::{plan::Plan, drive}};"),
        source(&[], "mod gpu;\nstruct Cause { what: String }"),
        source(&["error"], "fn f() { supercrate::gpu::x(); super::gpu::x() }"),
    ];
    let steps = |parent: &[String]| {
        uses(&all, parent).into_keys().map(|(a, b)| format!("{a} {b}")).collect::<Vec<_>>()
    };
    assert_eq!(steps(&[]), ["error gpu", "gpu solve"]);
    assert_eq!(steps(&["solve".into()]), ["drive plan", "plan drive"]);
    assert_eq!(circles(&uses(&all, &[])), Vec::<String>::new());
    assert_eq!(circles(&uses(&all, &["solve".into()])).len(), 2);
}

/// Packages that cargo links for a choice of packages, each with its features.
fn linked(edges: &str, chosen: &[&str]) -> BTreeMap<String, BTreeSet<String>> {
    let tree = ["tree", "--locked", "--offline", "--prefix", "none", "--format", "{p}|{f}", "--edges", edges];
    let output =
        Command::new(env!("CARGO")).args(tree).args(chosen).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    let output = output.expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        if let Some((package, features)) = line.split_once('|') {
            let features = features.trim_end_matches(" (*)").trim_end();
            found.entry(package.into()).or_default().insert(features.into());
        }
    }
    found
}

/// What `make build` built serves `pip install ./python` and the tests: all link the same packages with the same features.
#[test]
fn the_python_package_and_the_tests_take_over_what_the_command_built() {
    let command = linked("normal,build", &[]);
    let python = linked("normal,build", &["--package=thirdbounce-python"]);
    let tested = [
        "--package=thirdbounce",
        "--package=thirdbounce-command",
        "--package=thirdbounce-benchmark",
        "--package=thirdbounce-live",
        "--package=thirdbounce-tags",
        "--package=thirdbounce-track",
        "--package=thirdbounce-capi",
    ];
    let tests = linked("normal,build,dev", &tested);
    for (other, manifest) in [(python, "python"), (tests, "tests/fixtures")] {
        let both: Vec<&String> = other.keys().filter(|package| command.contains_key(*package)).collect();
        assert!(both.len() > 80, "{both:?}");
        for package in both {
            assert_eq!(command[package], other[package], "{package}: see {manifest}/Cargo.toml");
        }
    }
}

/// The library alone is checked for lints with crates that the walk over the whole workspace checked.
#[test]
fn lints_of_the_library_alone_take_over_those_of_the_workspace() {
    let all = linked("normal,build,dev", &["--workspace"]);
    let alone = linked("normal,build", &["--package=thirdbounce", "--package=public-api"]);
    // Parts of this workspace are compiled for their features.
    let others: Vec<_> = alone.iter().filter(|(package, _)| !package.contains("(/")).collect();
    assert!(others.len() > 60, "{others:?}");
    for (package, features) in others {
        assert!(features.is_subset(&all[package]), "{package}: {features:?}: see public-api/Cargo.toml");
    }
}
