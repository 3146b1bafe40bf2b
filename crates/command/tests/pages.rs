//! Pages for readers: links lead somewhere, commands are understood, and files that are named are there.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use fixtures::command::{program, stderr, thirdbounce};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All files below a folder that git keeps, by the ends of their names.
fn files(folder: &Path, ends: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()) {
        let name = entry.file_name().expect("a name").to_string_lossy().into_owned();
        if entry.is_dir() && !name.starts_with('.') && !["target", "out", "dist"].contains(&&*name) {
            found.extend(files(&entry, ends));
        } else if entry.is_file() && ends.iter().any(|end| name.ends_with(end)) {
            found.push(entry);
        }
    }
    found.sort();
    found
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).expect("text")
}

/// The lines of a page, and whether each is code.
fn lines(text: &str) -> impl Iterator<Item = (bool, &str)> {
    let mut fenced = false;
    text.lines().map(move |line| {
        let is_fence = line.trim_start().starts_with("```");
        fenced ^= is_fence;
        (fenced || is_fence || line.starts_with("    "), line)
    })
}

/// The anchors of a page's headings, as GitHub makes them.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut times = BTreeMap::new();
    let headings = lines(text).filter(|(is_code, line)| !is_code && line.starts_with('#'));
    headings
        .map(|(_, line)| {
            let words = line.trim_start_matches('#').trim().to_lowercase();
            let kept = words.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            let anchor: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
            let before = times.entry(anchor.clone()).or_insert(0);
            *before += 1;
            if *before == 1 { anchor } else { format!("{anchor}-{}", *before - 1) }
        })
        .collect()
}

/// Targets of the links and pictures of a page.
fn links(text: &str) -> Vec<&str> {
    let prose = lines(text).filter(|(is_code, _)| !is_code);
    prose
        .flat_map(|(_, line)| line.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0)))
        .collect()
}

/// Links of pages that lead nowhere.
fn broken(pages: &[PathBuf]) -> Vec<String> {
    let mut found = Vec::new();
    for page in pages {
        let text = read(page);
        for link in links(&text).into_iter().filter(|l| !l.contains("://") && !l.starts_with("mailto:")) {
            let (path, anchor) =
                link.split_once('#').map_or((link, None), |(path, anchor)| (path, Some(anchor)));
            let target =
                if path.is_empty() { page.clone() } else { page.parent().expect("a folder").join(path) };
            let has = |anchor| {
                target.extension().is_some_and(|e| e == "md") && anchors(&read(&target)).contains(anchor)
            };
            if !target.exists() || !anchor.is_none_or(has) {
                found.push(format!("{}: {link}", page.display()));
            }
        }
    }
    found
}

#[test]
fn links_lead_somewhere() {
    let pages = files(&root(), &[".md"]);
    assert!(pages.len() > 15, "the pages were not found");
    let broken = broken(&pages);
    assert!(broken.is_empty(), "links that lead nowhere:\n{}", broken.join("\n"));
}

/// Packages hold the pages for users, whose links lead to each other or to the web.
#[test]
fn links_of_packaged_pages_lead_somewhere() {
    let folder = tempfile::tempdir().expect("a folder");
    let copy = Command::new("python3").arg(".ci/pages.py").arg(folder.path()).current_dir(root()).output();
    let copied = copy.expect("python3");
    assert!(copied.status.success(), "{}", stderr(&copied));
    let pages = files(folder.path(), &[".md"]);
    assert!(pages.len() > 12 && folder.path().join("docs/demo.png").is_file());
    assert!(pages.iter().map(|page| links(&read(page)).len()).sum::<usize>() > 50, "links stay");
    let broken = broken(&pages);
    assert!(broken.is_empty(), "links that lead nowhere:\n{}", broken.join("\n"));
}

#[test]
fn broken_links_are_seen() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("a file");
    write(
        "a.md",
        "# `--one` of it: twice\n\n## Twice\n\n## Twice\n\n```sh\n# no heading\n```\n\n    [x](none.md)\n",
    );
    write(
        "b.md",
        "[1](a.md) [2](a.md#--one-of-it-twice) [3](a.md#twice-1) [4](https://x/y.md) [5](#6) ![7](p.png)\n[8](none.md) \
         [9](a.md#twice-2) [10](a.md#no-heading) [11](#twice) [`12`](a/..)\n",
    );
    let found = broken(&files(folder.path(), &[".md"]));
    let links: Vec<_> = found.iter().map(|f| f.rsplit(' ').next().expect("a link")).collect();
    assert_eq!(links, ["#6", "p.png", "none.md", "a.md#twice-2", "a.md#no-heading", "#twice", "a/.."]);
}

/// Pages that sources, programs and other pages name in plain text.
#[test]
fn pages_that_are_named_exist() {
    let ends = [
        ".rs", ".md", ".py", ".h", ".hpp", ".toml", ".comp", ".sh", ".c", ".cpp", ".html", "Makefile", "run",
    ];
    let mut named = 0;
    let mut missing = Vec::new();
    for file in files(&root(), &ends) {
        let Ok(text) = fs::read_to_string(&file) else { continue };
        let words = text.split(|c: char| !c.is_ascii_alphanumeric() && !"/.-_".contains(c));
        for word in words.map(|w| w.trim_end_matches('.')).filter(|w| w.ends_with(".md")) {
            let inside = word.trim_start_matches("../");
            if inside.starts_with("docs/") || inside.starts_with("benches/") {
                named += 1;
                if !root().join(inside).is_file() {
                    missing.push(format!("{}: {word}", file.display()));
                }
            }
        }
    }
    assert!(named > 50, "only {named} pages are named");
    assert!(missing.is_empty(), "pages that are named and not there:\n{}", missing.join("\n"));
}

/// The arguments of the calls of thirdbounce in the code of a page, with the line of each.
fn calls(text: &str) -> Vec<(&str, Vec<String>)> {
    let code = lines(text).filter(|(is_code, _)| *is_code).map(|(_, line)| line.trim());
    code.flat_map(|line| split(line).into_iter().map(move |call| (line, call))).collect()
}

/// What a shell would take for calls of thirdbounce: words without quotes, up to a comment, a pipe or a redirection.
fn split(line: &str) -> Vec<Vec<String>> {
    let (mut calls, mut words, mut word, mut quote) = (Vec::new(), Vec::new(), None::<String>, None);
    for c in line.chars().chain(['\n']) {
        match (quote, c) {
            (Some(q), _) if q == c => quote = None,
            (None, '"' | '\'') => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            (None, ' ' | '\n') => words.extend(word.take()),
            (None, '#') if word.is_none() => break,
            (None, '|' | ';' | '&' | '>') if word.is_none() => calls.push(std::mem::take(&mut words)),
            _ => word.get_or_insert_default().push(c),
        }
    }
    calls.push(words);
    calls
        .into_iter()
        .filter_map(|call: Vec<String>| {
            let mut words = call.into_iter().skip_while(|w| w.contains('=') && !w.starts_with('-'));
            let program = words.next()?;
            (program.rsplit('/').next() == Some("thirdbounce")).then(|| words.collect())
        })
        .collect()
}

/// Whether the command understands its arguments. Nothing runs: the host's memory is refused before a verb begins.
fn is_understood(call: &[String]) -> Result<(), String> {
    let mut arguments: Vec<&str> = call.iter().map(String::as_str).collect();
    if ["help", "--help", "--version"].contains(&call.first().map_or("", String::as_str)) {
        let output = thirdbounce(&arguments);
        return if output.status.success() { Ok(()) } else { Err(call.join(" ")) };
    }
    arguments.extend(["--host-memory", "nonsense"]);
    let output = thirdbounce(&arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    let is_parsed = output.status.code() == Some(1) && said.contains("the memory budget is \"nonsense\"");
    if is_parsed { Ok(()) } else { Err(said.into_owned()) }
}

#[test]
fn commands_are_understood() {
    let mut count = 0;
    for page in files(&root(), &[".md"]) {
        let text = read(&page).replace("\\\n", " ");
        for (line, call) in calls(&text) {
            count += 1;
            if let Err(said) = is_understood(&call) {
                panic!("{}: {line}\n{said}", page.display());
            }
        }
    }
    assert!(count > 40, "only {count} calls were found");
}

/// The files that commands of pages read: small captures with truth.
fn inputs(folder: &Path) {
    let run = |arguments: &[&str]| {
        let output =
            Command::new(program()).args(arguments).current_dir(folder).output().expect("the program runs");
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    };
    run(&[
        "simulate",
        "figure",
        "--scan",
        "8",
        "--bin-width",
        "0.02",
        "--out",
        "capture.npz",
        "--truth",
        "truth.npz",
    ]);
    run(&["reconstruct", "capture.npz", "--lateral", "16", "--out", "result", "--quiet"]);
    fs::create_dir(folder.join("scans")).expect("a folder");
    for copy in ["figure.npz", "scans/a.npz", "scans/b.npz"] {
        fs::copy(folder.join("capture.npz"), folder.join(copy)).expect("a copy");
    }
    fs::write(folder.join("list.txt"), "scans/*.npz\n").expect("a file");
}

/// Whether a command takes long, needs a file that pages do not make, or serves until it is stopped.
fn is_left_out(call: &[String], folder: &Path) -> bool {
    let word = |w: &str| call.iter().any(|c| c == w);
    let is_long = ["demo", "benchmark", "live"].contains(&&*call[0]) || word("paper") || word("--check");
    let is_absent = |file: &String| {
        call[0] != "simulate" && !file.starts_with('-') && !file.contains('*') && !folder.join(file).exists()
    };
    is_long || word("-") || word("1") || call.get(1).is_some_and(is_absent)
}

/// Options that shorten a command, where it has no value of its own for them.
fn made_cheaper(call: &[String]) -> Vec<String> {
    let shorter: &[[&str; 2]] = match &*call[0] {
        "simulate" => &[["--scan", "8"]],
        "reconstruct" | "batch" | "profile" if !call.iter().any(|w| w == "--solver" || w == "--compile") => {
            &[["--lateral", "16"], ["--iterations", "2"], ["--model", "cosine"]]
        }
        _ => &[],
    };
    let missing = shorter.iter().filter(|[name, _]| !call.iter().any(|w| w == name));
    missing.flatten().map(|w| w.to_string()).collect()
}

#[test]
fn commands_run() {
    let ran = Mutex::new(BTreeSet::new());
    let pages = Mutex::new(files(&root().join("docs"), &[".md"]));
    let next = || pages.lock().expect("no panic").pop();
    let run_pages = || std::iter::from_fn(next).for_each(|page| run_commands(&page, &ran));
    std::thread::scope(|scope| (0..2).for_each(|_| drop(scope.spawn(run_pages))));
    let ran = ran.into_inner().expect("no panic");
    assert!(ran.len() > 25, "only {} commands ran", ran.len());
}

/// Runs the commands of a page that did not run before.
fn run_commands(page: &Path, ran: &Mutex<BTreeSet<Vec<String>>>) {
    let text = read(page).replace("\\\n", " ");
    let folder = tempfile::tempdir().expect("a folder");
    for (line, mut call) in calls(&text) {
        if !folder.path().join("capture.npz").exists() {
            inputs(folder.path());
        }
        if is_left_out(&call, folder.path()) || !ran.lock().expect("no panic").insert(call.clone()) {
            continue;
        }
        call.extend(made_cheaper(&call));
        let run = Command::new(program()).args(&call).current_dir(folder.path()).output();
        let output = run.expect("the program runs");
        assert!(output.status.success(), "{}: {line}\n{}", page.display(), stderr(&output));
    }
}

#[test]
fn wrong_commands_are_seen() {
    let page = "thirdbounce prose\n\n    X=1 find . | thirdbounce batch - --out 'a b'  # c\n\n```sh\n$ x\n\
                target/release/thirdbounce info a.npz > f\nthirdbounce\n```\n";
    let found: Vec<_> = calls(page).into_iter().map(|(_, call)| call.join("_")).collect();
    assert_eq!(found, ["batch_-_--out_a b", "info_a.npz", ""]);
    let understood = |line: &str| is_understood(&split(&format!("thirdbounce {line}"))[0]).is_ok();
    assert!(understood("info a.npz") && understood("help") && understood("demo"));
    assert!(!understood("info") && !understood("info a.npz --nonsense") && !understood("inform a.npz"));
}

/// What stands between single backticks in the prose of a page.
fn quoted(text: &str) -> Vec<&str> {
    let prose = lines(text).filter(|(is_code, _)| !is_code);
    prose.flat_map(|(_, line)| line.split('`').skip(1).step_by(2)).collect()
}

#[test]
fn options_of_the_pages_exist() {
    // The error of an unknown topic names all verbs and topics.
    let names = stderr(&thirdbounce(&["help", "nonsense"]));
    let names = names.split("give one of ").nth(1).expect("the topics").split([',', ' ', '\n']);
    let texts = names
        .filter(|n| !n.is_empty())
        .map(|n| String::from_utf8(thirdbounce(&["help", n]).stdout).expect("text"));
    let help = String::from_utf8(thirdbounce(&["help"]).stdout).expect("text");
    let mut options = BTreeSet::new();
    for text in texts.chain([help.clone()]) {
        let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '-').map(str::to_owned);
        options.extend(words.filter(|w| w.starts_with("--")));
    }
    assert!(options.contains("--lateral") && options.contains("--dark") && !options.contains("--nonsense"));
    let mut pages = files(&root().join("docs"), &[".md"]);
    pages.push(root().join("README.md"));
    assert!(pages.len() > 10, "the pages were not found");
    for page in pages {
        let text = read(&page);
        let own = quoted(&text)
            .into_iter()
            .filter(|q| !["cargo ", "make ", "benches/"].iter().any(|p| q.starts_with(p)));
        for word in own.flat_map(|q| q.split([' ', '=', '|'])).filter(|w| w.starts_with("--")) {
            assert!(options.contains(word), "{}: {word} is no option", page.display());
        }
    }
}

/// The documentation of the crate has the programs, which the compiler checks. Pages have them word for word.
#[test]
fn pages_show_the_programs_that_are_compiled() {
    let root = root();
    let documentation: String = read(&root.join("src/lib.rs")).lines().fold(String::new(), |text, line| {
        let line = line.strip_prefix("//!").unwrap_or_default();
        text + line.strip_prefix(' ').unwrap_or(line) + "\n"
    });
    let programs: Vec<String> = documentation
        .split("```no_run\n")
        .skip(1)
        .filter_map(|rest| Some(format!("```rust\n{}```", rest.split("```").next()?)))
        .collect();
    assert_eq!(programs.len(), 3);
    let page = read(&root.join("docs/rust-c-vulkan.md"));
    assert!(programs.iter().all(|program| page.contains(program)), "the page has other programs");
    assert_eq!(page.matches("```rust\n").count(), programs.len(), "a program that nothing compiles");
    assert!(read(&root.join("README.md")).contains(&programs[0]), "README.md has another program");
}

/// A path in a recipe, if this word is one. Capitals stand for names of the reader's own: the folder around them must exist.
fn path_of(word: &str) -> Option<PathBuf> {
    let is_path = word.contains('/') && word.chars().all(|c| c.is_ascii_alphanumeric() || "/._-".contains(c));
    let word = word.replace("SOLVER", "surface");
    let is_free = |part: &str| {
        part.split('.').next().is_some_and(|p| p.len() > 1 && p.chars().all(|c| c.is_ascii_uppercase()))
    };
    let kept = word.split('/').take_while(|part| !is_free(part) || part.ends_with(".md"));
    is_path.then(|| kept.collect())
}

#[test]
fn recipes_name_files_that_exist() {
    let text = read(&root().join("CONTRIBUTING.md"));
    let text = text + &read(&root().join("ARCHITECTURE.md"));
    let paths: Vec<_> = quoted(&text).into_iter().filter_map(path_of).collect();
    assert!(paths.len() > 50, "only {} paths were found", paths.len());
    let missing: Vec<_> = paths.iter().filter(|path| !root().join(path).exists()).collect();
    assert!(missing.is_empty(), "the pages name files that are not there: {missing:?}");
    assert_eq!(path_of("crates/capture/src/formats/NAME.rs"), Some("crates/capture/src/formats".into()));
    assert_eq!(path_of("src/SOLVER/passes.rs"), Some("src/surface/passes.rs".into()));
    assert_eq!(path_of("make test"), None);
}

/// The table of a capture's way names what is declared in its files.
#[test]
fn the_steps_of_a_capture_are_where_the_page_says() {
    let text = read(&root().join("ARCHITECTURE.md"));
    let table = text.split("## ").find(|part| part.starts_with("A capture's way")).expect("the table");
    let declares = |file: &str, name: &str| {
        let text = read(&root().join(file));
        let kinds = ["fn", "struct", "enum", "trait", "const"];
        text.match_indices(name).any(|(at, _)| {
            let ends = !text[at + name.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_');
            ends && kinds.iter().any(|kind| text[..at].ends_with(&format!("{kind} ")))
        })
    };
    let mut found = 0;
    for row in table.lines().filter(|line| line.starts_with("| ") && line.contains('`')) {
        let [_, _, names, files, _] = row.split('|').collect::<Vec<_>>()[..] else { panic!("{row}") };
        for name in quoted(names) {
            assert!(quoted(files).iter().any(|file| declares(file, name)), "{name} is not in {files}");
            found += 1;
        }
    }
    assert!(found > 12, "{found} names");
    assert!(!declares("src/judge/job.rs", "Jo") && !declares("src/judge/job.rs", "Settings"));
    assert!(text.split_whitespace().count() <= 900, "the page fits a quarter of an hour");
}
