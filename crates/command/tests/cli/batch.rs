//! Many captures: whole results whatever happens, nothing twice, everything once.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use fixtures::command::{program, stderr, stdout, succeed, thirdbounce};
use serde_json::Value;
use thirdbounce::export::npz;

use fixtures::browser::{browser, image_colours, look};

/// Options that make a run short, and its bits the same every time.
const SHORT: [&str; 9] =
    ["--model", "cosine", "--lateral", "16", "--iterations", "16", "--deterministic", "--support", "fixed"];

/// Captures of three scenes and a file that is none, made once: `a/one.npz`, `a/two.npz`, `b/one.npz`, `b/bad.npz`.
fn captures() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        for (scene, file) in [("letter-Z", "a/one.npz"), ("sphere", "a/two.npz"), ("spheres", "b/one.npz")] {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            let path = path.display().to_string();
            succeed(&[
                "simulate",
                scene,
                "--out",
                &path,
                "--scan",
                "8",
                "--bin-width",
                "0.03",
                "--noise",
                "0.3",
            ]);
        }
        std::fs::write(folder.path().join("b/bad.npz"), "no capture").unwrap();
        folder
    });
    folder.path()
}

/// A batch of what `inputs` names below the captures.
fn command(inputs: &[&str], out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(program());
    command.arg("batch").args(inputs).arg("--out").arg(out).args(SHORT).args(more).current_dir(captures());
    command
}

/// What a batch said.
struct Said {
    code: Option<i32>,
    /// The line of each capture by its path.
    lines: BTreeMap<String, Value>,
    summary: Value,
    errors: String,
}

fn batch(inputs: &[&str], out: &Path, more: &[&str]) -> Said {
    let output = command(inputs, out, more).output().expect("the command runs");
    let lines: Vec<Value> =
        stdout(&output).lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect();
    let (summary, lines) = lines.split_last().unwrap_or_else(|| panic!("no lines: {}", stderr(&output)));
    assert_eq!(summary["summary"], true);
    let by_path =
        lines.iter().map(|line| (line["capture"].as_str().expect("a path").to_string(), line.clone()));
    let lines = by_path.collect();
    Said { code: output.status.code(), lines, summary: summary.clone(), errors: stderr(&output) }
}

impl Said {
    fn status(&self, capture: &str) -> &str {
        self.lines.get(capture).and_then(|l| l["status"].as_str()).unwrap_or("untold")
    }

    fn counts(&self) -> [u64; 4] {
        ["captures", "done", "skipped", "failed"].map(|key| self.summary[key].as_u64().expect("a number"))
    }
}

/// Every name in a folder of results, hidden ones included. Each result must be whole.
fn results(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(out).into_iter().flatten().map(|e| e.unwrap().path());
    let entries = entries.filter(|path| !path.file_name().unwrap().to_string_lossy().starts_with("index."));
    let whole = |folder: PathBuf| {
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let maps = std::fs::read(folder.join("maps.npz")).unwrap_or_else(|e| panic!("{name}: {e}"));
        for file in ["report.json", "made_from.json", "mesh.ply", "depth.png", "log.txt"] {
            assert!(folder.join(file).is_file(), "{name} has no {file}");
        }
        npz::read_maps(&folder.join("maps.npz")).expect("maps");
        (name, maps)
    };
    entries.map(whole).collect()
}

#[test]
fn a_bad_file_amid_good_ones_fails_alone() {
    let out = tempfile::tempdir().unwrap();
    let said = batch(&["a/*.npz", "b/bad.npz", "b/missing.npz"], out.path(), &[]);
    assert_eq!((said.code, said.counts()), (Some(1), [4, 2, 0, 2]), "{}", said.errors);
    assert!(said.errors.contains("4 captures: 2 done, 0 skipped, 2 failed"), "{}", said.errors);
    for (path, what) in [("b/bad.npz", "format"), ("b/missing.npz", "cannot be read")] {
        let line = &said.lines[path];
        assert!(line["error"].as_str().unwrap().contains(what) && !line["hint"].is_null(), "{line}");
        assert!(line["folder"].is_null() && line["status"] == "failed", "{line}");
    }
    let line = &said.lines["a/one.npz"];
    assert!(line["folder"].as_str().unwrap().ends_with("one") && line["error"].is_null(), "{line}");
    let figures = &line["figures"];
    assert!(figures["iterations"] == 16 && figures["model"] == "cosine", "{line}");
    assert!((0.2..1.5).contains(&figures["depth"].as_f64().unwrap()), "{line}");
    assert_eq!(results(out.path()).into_keys().collect::<Vec<_>>(), ["one", "two"]);
    // Where it is, and how long it will take; notes are in the logs.
    assert!(said.errors.contains("2 of 4: ") && said.errors.contains(" left\n"), "{}", said.errors);
    assert!(!said.errors.contains("note:"), "{}", said.errors);
    let log = std::fs::read_to_string(out.path().join("one/log.txt")).unwrap();
    assert!(log.contains("note: "), "{log}");
}

#[test]
fn a_batch_ends_in_one_page() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    // Another batch made a result in the same folder.
    assert_eq!(batch(&["b/one.npz"], &out, &[]).counts(), [1, 1, 0, 0]);
    std::fs::rename(out.join("one"), out.join("earlier")).unwrap();
    let said = batch(&["a/*.npz", "b/bad.npz"], &out, &[]);
    assert_eq!(said.counts(), [3, 2, 0, 1]);
    assert!(said.errors.contains("index.html"), "{}", said.errors);
    let csv = std::fs::read_to_string(out.join("index.csv")).unwrap();
    let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let names: Vec<_> = lines.iter().map(|cells| (cells[0], cells[2])).collect();
    assert_eq!(
        names,
        [("name", "status"), ("bad", "failed"), ("earlier", "done"), ("one", "done"), ("two", "done")]
    );
    let residual = lines[0].iter().position(|cell| *cell == "residual").unwrap();
    let grade = lines[0].iter().position(|cell| *cell == "verdict").unwrap();
    let verdict = said.lines["a/two.npz"]["figures"]["verdict"].as_str().unwrap_or_default();
    assert!(["good", "fair", "poor"].contains(&verdict) && lines[4][grade] == verdict, "{verdict} {lines:?}");
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains(&format!("data-label=\"Verdict\" data-value=\"{verdict}\"")));
    let of_line = &said.lines["a/two.npz"]["figures"]["residual"];
    assert_eq!(lines[4][residual].parse::<f64>().ok(), of_line.as_f64());
    // What is there already has its figures, too.
    let again = batch(&["a/two.npz"], &out, &[]);
    assert_eq!(&again.lines["a/two.npz"]["figures"]["residual"], of_line);

    let Some(browser) = browser() else {
        eprintln!("skipped: no chromium is installed");
        return;
    };
    let click = "<script>document.querySelectorAll(\"th button\")[2].click()</script></html>";
    std::fs::write(out.join("index.sorted.html"), page.replace("</html>", click)).unwrap();
    let address = format!("file://{}", out.join("index.sorted.html").display());
    let text = stdout(&look(browser, &address, "1400,1000", folder.path(), &["--dump-dom"]));
    let mut by_residual: Vec<_> =
        lines[2..].iter().map(|c| (c[residual].parse::<f64>().unwrap(), c[0])).collect();
    by_residual.sort_by(|a, b| a.0.total_cmp(&b.0));
    let places: Vec<_> =
        by_residual.iter().map(|(_, name)| text.find(&format!("<a href=\"{name}/report.html\">"))).collect();
    assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{by_residual:?} {places:?}");
    for width in ["1400", "420"] {
        let picture = folder.path().join("page.png");
        let screenshot = format!("--screenshot={}", picture.display());
        let address = format!("file://{}", out.join("index.html").display());
        look(browser, &address, &format!("{width},1000"), folder.path(), &[&screenshot]);
        assert!(image_colours(&picture) > 40, "pictures of the maps are shown");
    }
}

#[test]
fn a_killed_batch_ends_with_the_same_results() {
    let whole = tempfile::tempdir().unwrap();
    assert_eq!(batch(&["a/*.npz", "b/one.npz"], whole.path(), &[]).counts(), [3, 3, 0, 0]);
    let out = tempfile::tempdir().unwrap();
    let mut child = command(&["a/*.npz", "b/one.npz"], out.path(), &["--quiet"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut first = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut first).unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    let first: Value = serde_json::from_str(&first).expect("one line");
    assert_eq!(first["status"], "done");
    // What is visible is whole. What is hidden is not a result.
    let there = std::fs::read_dir(out.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let visible: Vec<String> =
        there.filter(|name| !name.starts_with('.') && !name.starts_with("index.")).collect();
    assert!(visible.contains(&first["name"].as_str().unwrap().to_string()), "{visible:?}");
    for name in &visible {
        assert!(out.path().join(name).join("report.json").is_file(), "{name}");
    }
    let again = batch(&["a/*.npz", "b/one.npz"], out.path(), &[]);
    assert_eq!(again.code, Some(0), "{}", again.errors);
    assert_eq!(again.status(first["capture"].as_str().unwrap()), "skipped");
    assert_eq!(again.counts(), [3, 3 - visible.len() as u64, visible.len() as u64, 0]);
    // Names and bits of the maps; no hidden folder is left.
    assert!(results(out.path()) == results(whole.path()));
}

#[test]
fn files_of_one_name_have_folders_of_their_own() {
    let out = tempfile::tempdir().unwrap();
    let said = batch(&["a/one.npz", "b/one.npz", "./a/one.npz"], out.path(), &["--jobs", "2"]);
    assert_eq!((said.code, said.counts()), (Some(0), [2, 2, 0, 0]), "{}", said.errors);
    let results = results(out.path());
    let names: Vec<&String> = results.keys().collect();
    assert!(names.len() == 2 && names.iter().all(|n| n.starts_with("one-")), "{names:?}");
    let bytes: BTreeSet<_> = results.values().collect();
    assert_eq!(bytes.len(), 2, "each has its own capture's maps");
    // Another order, the same names.
    assert_eq!(batch(&["b/one.npz", "a/one.npz"], out.path(), &[]).counts(), [2, 0, 2, 0]);
}

#[test]
fn parts_hold_every_capture_once() {
    let folder = tempfile::tempdir().unwrap();
    let list = folder.path().join("list.txt");
    std::fs::write(&list, "# a comment\na/*.npz\n\nb/one.npz\n").unwrap();
    let out = folder.path().join("out");
    let mut reported = vec![];
    for part in ["1/3", "2/3", "3/3"] {
        let said = batch(&[list.to_str().unwrap()], &out, &["--part", part]);
        assert_eq!(said.code, Some(0), "{}", said.errors);
        reported.extend(said.lines.into_keys());
    }
    reported.sort();
    assert_eq!(reported, ["a/one.npz", "a/two.npz", "b/one.npz"]);
    assert_eq!(results(&out).len(), 3);
    // The list on stdin, in another order, finds all of it done.
    let mut child = command(&["-"], &out, &[]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"b/one.npz\na/two.npz\na/one.npz\n").unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(stdout(&output).contains("\"skipped\":3"), "{}", stdout(&output));
}

#[test]
fn a_result_of_other_options_is_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    let (out, capture) = (folder.path().join("out"), folder.path().join("scene.npz"));
    std::fs::copy(captures().join("a/two.npz"), &capture).unwrap();
    let input = [capture.to_str().unwrap()];
    assert_eq!(batch(&input, &out, &[]).counts(), [1, 1, 0, 0]);
    let first = results(&out);
    // What does not change results does not matter.
    assert_eq!(batch(&input, &out, &["--quiet", "--jobs", "3", "--memory", "2G"]).counts(), [1, 0, 1, 0]);
    assert_eq!(batch(&input, &out, &["--sparsity", "0.1"]).counts(), [1, 1, 0, 0]);
    assert!(results(&out) != first, "the old result is gone");
    // Another capture under the same name, and a result that lost its report.
    std::fs::copy(captures().join("a/one.npz"), &capture).unwrap();
    assert_eq!(batch(&input, &out, &["--sparsity", "0.1"]).counts(), [1, 1, 0, 0]);
    std::fs::remove_file(out.join("scene/report.json")).unwrap();
    assert_eq!(batch(&input, &out, &["--sparsity", "0.1"]).counts(), [1, 1, 0, 0]);
    assert_eq!(batch(&input, &out, &["--sparsity", "0.1"]).counts(), [1, 0, 1, 0]);
}

/// Ctrl-C: the process ends, and every result that is there is whole.
#[test]
#[cfg(unix)]
fn an_interrupted_batch_leaves_whole_results() {
    let out = tempfile::tempdir().unwrap();
    let mut child = command(&["a/*.npz", "b/one.npz"], out.path(), &[])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    lines.next().unwrap().unwrap();
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    let code = child.wait().unwrap().code();
    let summary: Value = serde_json::from_str(rest.last().unwrap()).unwrap();
    let done = summary["done"].as_u64().unwrap();
    // The last capture may have been written by then.
    assert_eq!(code, Some(if summary["stopped"] == true { 130 } else { 0 }), "{summary}");
    assert_eq!((summary["stopped"] == true, summary["failed"].as_u64()), (done < 3, Some(0)), "{summary}");
    assert_eq!(results(out.path()).len() as u64, done);
}

#[test]
fn a_folder_that_no_batch_made_stays() {
    let out = tempfile::tempdir().unwrap();
    let mine = out.path().join("two/mine.txt");
    std::fs::create_dir(mine.parent().unwrap()).unwrap();
    std::fs::write(&mine, "mine").unwrap();
    let said = batch(&["a/two.npz"], out.path(), &[]);
    assert_eq!((said.code, said.counts()), (Some(1), [1, 0, 0, 1]), "{}", said.errors);
    assert!(said.lines["a/two.npz"]["error"].as_str().unwrap().contains("no batch made it"));
    assert_eq!(std::fs::read_to_string(&mine).unwrap(), "mine");
}

#[test]
fn files_of_others_stay_when_a_result_is_made_anew() {
    let out = tempfile::tempdir().unwrap();
    let place = |name: &str| out.path().join("two").join(name);
    assert_eq!(batch(&["a/two.npz"], out.path(), &[]).counts(), [1, 1, 0, 0]);
    let before = std::fs::read(place("maps.npz")).unwrap();
    std::fs::create_dir(place("mine")).unwrap();
    for name in ["notes.txt", "mine/figure.svg", "report.html~"] {
        std::fs::write(place(name), name).unwrap();
    }
    assert_eq!(batch(&["a/two.npz"], out.path(), &["--sparsity", "0.1"]).counts(), [1, 1, 0, 0]);
    assert!(std::fs::read(place("maps.npz")).unwrap() != before);
    for name in ["notes.txt", "mine/figure.svg", "report.html~"] {
        assert_eq!(std::fs::read_to_string(place(name)).unwrap(), name);
    }
}

#[test]
#[cfg(unix)]
fn a_full_disk_ends_the_batch() {
    let folder = tempfile::tempdir().unwrap();
    let volume = folder.path().join("v.npz");
    std::os::unix::fs::symlink("/dev/full", &volume).unwrap();
    let out = folder.path().join("out");
    let said =
        batch(&["a/*.npz", "b/one.npz"], &out, &["--jobs", "1", "--volume-file", volume.to_str().unwrap()]);
    assert_eq!((said.code, said.summary["stopped"].as_bool()), (Some(1), Some(true)), "{}", said.errors);
    assert_eq!(said.counts(), [3, 0, 0, 1]);
    assert!(said.errors.contains("the disk is full") && said.errors.contains("2 left"), "{}", said.errors);
    assert!(said.errors.contains("start the batch again"), "{}", said.errors);
    assert!(results(&out).is_empty());
}

#[test]
fn truth_and_volume_go_by_the_name_of_the_capture() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, truth) = (folder.path().join("z.npz"), folder.path().join("z_truth.npz"));
    let simulate = ["simulate", "letter-Z", "--scan", "8", "--bin-width", "0.03", "--noise", "0.3", "--out"];
    succeed(&[&simulate[..], &[capture.to_str().unwrap(), "--truth", truth.to_str().unwrap()]].concat());
    let [truths, volumes] = ["{}_truth.npz", "v/{}.npz"].map(|n| folder.path().join(n).display().to_string());
    let out = folder.path().join("out");
    let said = batch(&[capture.to_str().unwrap()], &out, &["--truth", &truths, "--volume-file", &volumes]);
    assert_eq!(said.code, Some(0), "{}", said.errors);
    let line = said.lines.values().next().unwrap();
    assert!(line["figures"]["iou"].as_f64().unwrap() > 0.1, "{line}");
    assert!(folder.path().join("v/z.npz").is_file());
}

/// Tasks of an array of 16 over 40 captures: each capture belongs to one, and none is left out.
#[test]
fn sixteen_parts_are_disjoint_and_complete() {
    let folder = tempfile::tempdir().unwrap();
    let list = folder.path().join("list.txt");
    let names: Vec<String> = (0..40).map(|i| format!("missing-{i}.npz")).collect();
    std::fs::write(&list, names.join("\n")).unwrap();
    let mut reported = vec![];
    for part in 1..=16 {
        let said = batch(&[list.to_str().unwrap()], folder.path(), &["--part", &format!("{part}/16")]);
        assert!((2..=3).contains(&said.lines.len()), "{part}: {:?}", said.lines.keys());
        reported.extend(said.lines.into_keys());
    }
    reported.sort();
    let all: BTreeSet<&String> = names.iter().collect();
    assert!(reported.iter().eq(all), "{reported:?}");
}

#[test]
fn a_folder_gives_its_captures_and_a_terminal_gets_no_json() {
    let out = tempfile::tempdir().unwrap();
    let said = batch(&["a"], out.path(), &[]);
    assert_eq!(said.lines.keys().collect::<Vec<_>>(), ["a/one.npz", "a/two.npz"]);
    let output = command(&["."], out.path(), &[]).output().unwrap();
    assert!(stderr(&output).contains("there is no capture in the folder"), "{}", stderr(&output));
    // util-linux's script gives the command a terminal.
    let on_terminal = |more: &str| {
        let line = format!(
            "{} batch a --out {} {} {more}",
            program().display(),
            out.path().display(),
            SHORT.join(" ")
        );
        Command::new("script").args(["-qec", &line, "/dev/null"]).current_dir(captures()).output()
    };
    let output = on_terminal("").expect("script, of util-linux");
    assert!(stdout(&output).contains("2 skipped") && !stdout(&output).contains('{'), "{}", stdout(&output));
    let output = on_terminal("--json").unwrap();
    assert!(
        stdout(&output).contains("\"status\":\"skipped\"") && stdout(&output).contains("\"summary\":true")
    );
}

#[test]
fn what_makes_no_batch_is_refused_at_once() {
    for (more, words) in [
        (&["--jobs", "0"][..], "--jobs is 0"),
        (&["--jobs", "18446744073709551615"], "give 1 to 256"),
        (&["--part", "3/2"], "the part is \"3/2\""),
        (&["--timings"], "--timings is no option of a batch"),
        (&["--lateral", "0"], "--lateral is 0"),
    ] {
        let output = thirdbounce(&[&["batch", "none.npz", "--out", "nowhere"][..], more].concat());
        assert!(!output.status.success() && stdout(&output).is_empty());
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
    }
}

/// A list of the good captures, by their whole paths.
fn list(folder: &Path) -> PathBuf {
    let list = folder.join("list.txt");
    let lines = ["a/one.npz", "a/two.npz", "b/one.npz"].map(|n| captures().join(n).display().to_string());
    std::fs::write(&list, lines.join("\n")).unwrap();
    list
}

#[test]
#[cfg(unix)]
fn a_slurm_array_shares_a_list() {
    let folder = tempfile::tempdir().unwrap();
    let (list, out) = (list(folder.path()), folder.path().join("out"));
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/slurm.sh");
    let task = |part: &str| {
        let mut command = Command::new(script);
        command.arg(&list).arg(&out).args(SHORT).env("THIRDBOUNCE", program());
        command.env("SLURM_ARRAY_TASK_ID", part).env("SLURM_ARRAY_TASK_MAX", "2");
        command
    };
    let log =
        |part: &str| std::fs::read_to_string(out.join(format!("part-{part}-of-2.jsonl"))).unwrap_or_default();
    // The first task has two captures, and is killed once it has reported one.
    let mut killed = task("1").stderr(Stdio::null()).spawn().unwrap();
    let begun = std::time::Instant::now();
    while !log("1").ends_with('\n') {
        assert!(begun.elapsed().as_secs() < 60, "the task reports nothing");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let first: Value = serde_json::from_str(log("1").lines().next().unwrap()).unwrap();
    assert_eq!(first["status"], "done");
    // Both run side by side, as in an array.
    let mut tasks = ["1", "2"].map(|part| task(part).stderr(Stdio::null()).spawn().unwrap());
    assert!(tasks.iter_mut().all(|task| task.wait().unwrap().success()));
    for part in ["1", "2"] {
        assert!(log(part).lines().last().unwrap().contains("\"failed\":0"), "{}", log(part));
    }
    let again = log("1").lines().map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<Value>>();
    let of_first = again.iter().find(|line| line["capture"] == first["capture"]).unwrap();
    assert_eq!(of_first["status"], "skipped");
    // Bits of a batch that nothing interrupts, and no hidden folder.
    let whole = folder.path().join("whole");
    assert_eq!(batch(&[list.to_str().unwrap()], &whole, &[]).counts(), [3, 3, 0, 0]);
    assert!(results(&out.join("maps")) == results(&whole));
}
