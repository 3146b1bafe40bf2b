//! Every method over every scene of a folder: one page, whatever happens on the way, and nothing twice.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use fixtures::browser::{browser, look};
use fixtures::command::{program, stderr, stdout, succeed};
use serde_json::Value;
use thirdbounce_benchmark::cases::{self, Case, Source};

/// Two tiny scenes: one to simulate, and a capture with a truth beside it. And a capture without truth.
fn scenes() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let text = "plane --scan 6 # a square\n--bin-width 3cm --noise 0.3\n";
    std::fs::write(folder.path().join("square.scene"), text).unwrap();
    let scene = ["simulate", "sphere", "--scan", "6", "--bin-width", "0.03", "--noise", "0.3"];
    let files = ["--out", &at("ball.npz"), "--truth", &at("truth_ball.npz")];
    succeed(&[&scene[..], &files].concat());
    std::fs::copy(folder.path().join("ball.npz"), folder.path().join("alone.npz")).unwrap();
    folder
}

fn command(folder: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(program());
    command.arg("benchmark").arg(folder).args(["--methods", "lct;bp", "--lateral", "16"]).args(more);
    command
}

fn benchmark(folder: &Path, more: &[&str]) -> Output {
    command(folder, more).output().expect("the command runs")
}

/// When every comparison was written.
fn times(folder: &Path) -> BTreeMap<String, SystemTime> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().map(|e| e.unwrap().path());
    let time = |path: &Path| path.join("case.json").metadata().and_then(|m| m.modified()).ok();
    entries.filter_map(|p| Some((p.file_name()?.to_string_lossy().into_owned(), time(&p)?))).collect()
}

fn page(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("benchmark.html")).unwrap()
}

#[test]
fn a_killed_benchmark_ends_with_one_page_of_all_cases() {
    let folder = scenes();
    let out = folder.path().join("benchmark");
    let mut child = command(folder.path(), &["--photons", "100"])
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while times(&out).is_empty() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let before = times(&out);
    assert!(!before.is_empty());

    let done = benchmark(folder.path(), &["--photons", "100"]);
    assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
    let after = times(&out);
    let names: Vec<&str> = after.keys().map(String::as_str).collect();
    // Nobody draws photons from what has no truth.
    assert_eq!(names, ["alone", "ball", "ball-photons-100", "square", "square-photons-100"]);
    assert!(before.iter().all(|(name, time)| after[name] == *time), "{before:?} {after:?}");
    assert!(stderr(&done).contains("alone is done already"), "{}", stderr(&done));
    // Five columns within a terminal, and a warning on what agreement favours.
    let said = stdout(&done);
    let head = said.lines().next().unwrap();
    assert!(
        head.split_whitespace().eq("alone (agreement) solve s own IoU depth, mm normals, °".split(' ')),
        "{said}"
    );
    assert!(said.lines().all(|line| line.chars().count() <= 80 || line.contains("/")), "{said}");
    assert!(said.contains("mean of 5 cases") && said.contains("That favours\nclosed forms"), "{said}");
    let said = stderr(&done);
    assert!(said.contains("case 1 of 5: ") && said.contains(" s remain") && !said.contains("-0"), "{said}");

    let html = page(&out);
    for name in names {
        let title = name.replace("alone", "alone (agreement)");
        assert!(html.contains(&format!("<h2>{title}</h2>")));
    }
    // Four curves of all cases, and of each.
    assert_eq!(
        (html.matches("data:image/png;base64,").count(), html.matches("<svg ").count()),
        (5, 4 + 5 * 4)
    );
    assert!(html.contains("Agreement: without truth") && !html.contains("Left out"));
    let order = ["<svg ", "<table>", "data:image/png;base64,"].map(|part| html.find(part).unwrap());
    assert!(order.is_sorted(), "curves, the table, pictures");
    let json: Value = serde_json::from_slice(&std::fs::read(out.join("benchmark.json")).unwrap()).unwrap();
    let cases = json["cases"].as_array().unwrap();
    let methods: Vec<_> = cases.iter().flat_map(|case| case["sides"].as_array().unwrap()).collect();
    assert_eq!((cases.len(), methods.len()), (5, 10));
    for method in methods {
        assert!(method["values"]["best_iou"].as_f64().unwrap() > 0.2, "{method}");
        let points = method["points"].as_array().unwrap();
        assert!(points.len() == 1 && points[0][0].as_f64().unwrap() > 0.0, "{method}");
    }

    fits_a_window(folder.path(), &html);

    // Nothing is left to do, and other options do all anew.
    let again = benchmark(folder.path(), &["--photons", "100"]);
    assert_eq!((again.status.code(), times(&out)), (Some(0), after.clone()), "{}", stderr(&again));
    assert!(stderr(&again).contains("about 0 s remain"), "{}", stderr(&again));
    std::fs::remove_file(folder.path().join("ball.npz")).unwrap();
    let other = benchmark(folder.path(), &["--oracle"]);
    assert_eq!(other.status.code(), Some(0), "{}", stderr(&other));
    let anew = times(&out);
    assert!(anew["square"] != after["square"] && anew["ball"] == after["ball"]);
    assert!(page(&out).contains("Oracle masks"));
}

/// Wide and narrow windows show the page without scrolling sideways: tables and pictures scroll inside their boxes.
fn fits_a_window(folder: &Path, html: &str) {
    let Some(browser) = browser() else {
        eprintln!("skipped: no chromium is installed");
        return;
    };
    let file = folder.join("measured.html");
    let script =
        "<script>document.title = document.documentElement.scrollWidth + ' of ' + innerWidth</script>";
    std::fs::write(&file, html.replace("</html>", script)).unwrap();
    for size in ["1400,1000", "420,900"] {
        let dom =
            stdout(&look(browser, &format!("file://{}", file.display()), size, folder, &["--dump-dom"]));
        let title = dom.split("<title>").nth(1).and_then(|t| t.split("</title>").next()).unwrap_or_default();
        let widths: Vec<usize> = title.split(" of ").filter_map(|n| n.parse().ok()).collect();
        assert!(widths.len() == 2 && widths[0] <= widths[1], "{size}: {title}");
    }
}

#[test]
fn a_case_that_fails_stops_no_other() {
    let folder = scenes();
    std::fs::write(folder.path().join("bad.npz"), "no capture").unwrap();
    std::fs::copy(folder.path().join("truth_ball.npz"), folder.path().join("bad_truth.npz")).unwrap();
    let counts =
        ["simulate", "plane", "--scan", "6", "--bin-width", "0.03", "--noise", "0.3", "--photons", "50"];
    let at = |name: &str| folder.path().join(name).display().to_string();
    succeed(&[&counts[..], &["--out", &at("counts.npz"), "--truth", &at("counts_truth.npz")]].concat());
    // One scene and the counts are enough beside it.
    std::fs::remove_file(folder.path().join("ball.npz")).unwrap();
    let done = benchmark(folder.path(), &["--photons", "10", "--out", &at("results")]);
    let said = stderr(&done);
    assert_eq!(done.status.code(), Some(1), "{said}");
    assert!(
        said.contains("error: bad:") && said.contains("counts-photons-10 is left out: its values"),
        "{said}"
    );
    let all: Vec<String> = times(&folder.path().join("results")).into_keys().collect();
    assert_eq!(all, ["alone", "counts", "square", "square-photons-10"]);
    let html = page(&folder.path().join("results"));
    assert!(html.contains("<h2>Left out</h2>") && html.contains("bad failed:"), "{html}");
}

/// A capture of one's own: every fast method once; `paper`, which takes minutes, on request.
#[test]
fn a_capture_alone_is_compared_by_fast_methods_once() {
    let folder = scenes();
    let capture = folder.path().join("ball.npz").display().to_string();
    let out = folder.path().join("own").display().to_string();
    let done = succeed(&[
        "benchmark",
        &capture,
        "--out",
        &out,
        "--lateral",
        "16",
        "--iterations",
        "4",
        "--model",
        "cosine",
    ]);
    let rows: Vec<&str> = done.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(["surface", "lct", "fk", "phasor", "fbp"].iter().all(|name| rows.contains(name)), "{done}");
    assert!(!rows.contains(&"paper") && !done.contains("favours"), "{done}");
    let case: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("own/ball/case.json")).unwrap()).unwrap();
    let sides = case["sides"].as_array().unwrap();
    assert!(sides.iter().all(|side| side["repeats_s"].as_array().unwrap().len() == 1), "{case}");
}

#[test]
fn what_is_no_benchmark_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |more: &[&str], says: &str| {
        let done = benchmark(folder.path(), more);
        let said = stderr(&done);
        assert!(done.status.code() == Some(1) && said.contains(says), "{more:?}: {said}");
    };
    refused(&[], "the benchmark has no scenes");
    refused(&["--foreign", "a=b,seconds=1,hardware=c"], "--foreign belongs to one capture");
    refused(&["--truth", "t.npz", &folder.path().display().to_string()], "--truth belongs to one capture");
    let scene = folder.path().join("one.scene");
    std::fs::write(&scene, "plane --scan 6 --bin-width 3cm").unwrap();
    refused(&["--photons", "0"], "the photons of the strongest bin are 0");
    refused(&["--method", "magic"], "magic is not known");
    std::fs::write(&scene, "plane --out x.npz").unwrap();
    refused(&[], "--out does not fit here");
    std::fs::write(&scene, "plane --colour red").unwrap();
    refused(&[], "--colour");
    assert!(!folder.path().join("benchmark").exists());
}

/// Without a capture the standard cases run: here by the fastest methods.
#[test]
#[ignore = "long: make soak"]
fn scenes_of_its_own_need_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("page").display().to_string();
    let fast = ["--methods", "fbp;bp", "--lateral", "32", "--trace-every", "0", "--out", &out];
    succeed(&[&["benchmark"], &fast[..]].concat());
    let html = page(&folder.path().join("page"));
    let cases = [
        "figure-32x32",
        "figure-8x8",
        "one-laser",
        "10-photons",
        "three-before-wall",
        "letter-R",
        "letter-S-as-measured",
        "figure-as-measured",
    ];
    assert!(cases.iter().all(|case| html.contains(&format!("<h2>{case}</h2>"))), "{html}");
    let scene = folder.path().join("mine.scene");
    std::fs::write(&scene, "family 3").unwrap();
    let at = folder.path().display().to_string();
    succeed(&[&["benchmark", &at, "--set", "points"], &fast[..]].concat());
    let html = page(&folder.path().join("page"));
    assert!(html.contains("<h2>mine</h2>") && html.contains("<h2>torus-64x64</h2>"), "{html}");
}

#[test]
fn a_benchmark_of_random_scenes_has_each_twice() {
    let all = cases::all(&["family", "points"], 3..4, None).expect("cases");
    let points = all.len() - 1;
    let all: Vec<Case> = all.into_iter().flat_map(Case::with_ideal).collect();
    assert_eq!((all[0].name.as_str(), all[1].name.as_str()), ("family-3", "family-3-ideal"));
    assert_eq!(all.len(), points + 2);
    let (Source::Scene(drawn), Source::Scene(ideal)) = (&all[0].source, &all[1].source) else {
        panic!("scenes");
    };
    assert_eq!(drawn.truth().expect("a truth").mask, ideal.truth().expect("a truth").mask);
    assert_eq!(ideal.scene.photons, None);
    assert_eq!(ideal.words, "confocal 24², 0.61 m, 1702 x 1.1 mm, exact; animal, box (partly outside)");
}
