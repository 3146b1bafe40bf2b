//! `thirdbounce profile`, as people run it: the content of its files, and its errors.

use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;

fn thirdbounce(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_thirdbounce")).args(arguments).output().expect("the binary runs")
}

#[track_caller]
fn succeed(arguments: &[&str]) -> String {
    let output = thirdbounce(arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}\n{error}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[track_caller]
fn fail(arguments: &[&str], code: i32, words: &str) {
    let output = thirdbounce(arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}\n{error}");
    assert!(error.contains(words) && !error.contains("internal error"), "{words:?} is not in\n{error}");
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("the file is there")).expect("it is JSON")
}

/// A small capture, and a profile of each solver with its timeline.
struct Profiled {
    folder: tempfile::TempDir,
    /// By solver: table, profile, timeline.
    runs: Vec<(&'static str, String, Value, Value)>,
}

impl Profiled {
    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }
}

fn profiled() -> &'static Profiled {
    static ONCE: OnceLock<Profiled> = OnceLock::new();
    ONCE.get_or_init(|| {
        let mut all = Profiled { folder: tempfile::tempdir().expect("a temporary folder"), runs: vec![] };
        let capture = all.path("z.npz");
        let scan = ["--scan", "12", "--bin-width", "0.02", "--noise", "0.1"];
        succeed(&[&["simulate", "letter-Z", "--out", &capture], &scan[..]].concat());
        let paper: &[&str] = &["--double-every", "8", "--reduce-every", "4"];
        let surface: &[&str] = &["--model", "cosine", "--support", "fixed"];
        for (solver, more) in [("paper", paper), ("surface", surface)] {
            let name = |ending: &str| all.folder.path().join(format!("{solver}{ending}"));
            let (profile, trace) = (name(".json"), name(".trace.json"));
            let files = [profile.display().to_string(), trace.display().to_string()];
            let short = [
                "profile",
                &capture,
                "--device",
                "vulkan",
                "--solver",
                solver,
                "--lateral",
                "24",
                "--iterations",
                "16",
            ];
            let out = name("-maps").display().to_string();
            let out = ["--json", &files[0], "--trace", &files[1], "--out", &out, "--quiet"];
            let text = succeed(&[&short[..], more, &out[..]].concat());
            all.runs.push((solver, text, json(&profile), json(&trace)));
        }
        all
    })
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} is no number in {value}"))
}

#[test]
fn the_profile_holds_every_kernel_with_its_figures() {
    for (solver, text, profile, _) in &profiled().runs {
        for key in
            ["version", "device", "settings", "limits", "kernels", "iterations", "gaps", "host", "totals"]
        {
            assert!(!profile[key].is_null(), "{solver}: {key}");
        }
        assert!(!profile["device"]["name"].as_str().unwrap().is_empty());
        assert!(!profile["device"]["driver"].as_str().unwrap().is_empty());
        let kernels = profile["kernels"].as_array().unwrap();
        for k in kernels {
            for key in ["calls", "seconds", "pairs", "share"] {
                assert!(number(k, key) >= 0.0, "{k}");
            }
            assert!(k.get("pairs_per_s").is_some() && k.get("share_of_limit").is_some(), "{k}");
            assert!(text.contains(k["name"].as_str().unwrap()), "the table lists {}", k["name"]);
        }
        let of = |name: &str| kernels.iter().find(|k| k["name"] == name);
        let passes: &[&str] = match *solver {
            "paper" => &["forward", "backward"],
            _ => &["forward", "backward_surface"],
        };
        for name in passes {
            let k = of(name).unwrap_or_else(|| panic!("{solver} runs {name}"));
            let (pairs, seconds, rate) = (number(k, "pairs"), number(k, "seconds"), number(k, "pairs_per_s"));
            assert!(pairs > 0.0 && (rate * seconds / pairs - 1.0).abs() < 1e-9, "{k}");
            let (bytes, share) = (number(k, "bytes"), number(k, "share_of_limit"));
            assert!(bytes > 0.0 && share > 0.0 && share < 2.0, "{k}");
            let limit = k["limit"].as_str().unwrap_or_else(|| panic!("{name} has a limit"));
            assert!(["additions", "loads", "arithmetic", "memory", "launch"].contains(&limit), "{k}");
            assert!(text.contains(&format!("{limit} {:.1} %", 100.0 * share)), "{text}");
        }
        // Forward and backward see the same voxels or points: the trace's sum of pairs.
        let total = number(&profile["totals"], "pairs");
        let pairs = |name: &str| of(name).map_or(0.0, |k| number(k, "pairs"));
        let of_surface = pairs("backward_surface");
        assert_eq!(pairs("backward") + of_surface, total);
        // The surface is rendered four times before its first iteration, to find the scale of its albedos.
        assert_eq!(pairs("forward"), total + of_surface * 4.0 / 16.0);
        assert_eq!(of_surface > 0.0, *solver == "surface");
        assert_eq!(number(of("finish").unwrap(), "pairs"), 0.0);
        assert!(of("finish").unwrap()["pairs_per_s"].is_null());
        // The last pass of the surface closes an iteration by itself.
        let closed = if *solver == "paper" { 16.0 } else { 4.0 };
        assert_eq!(number(of("finish").unwrap(), "calls"), closed);
        assert_eq!(number(&profile["iterations"], "count"), 16.0);
    }
}

/// On the host no kernel is above a limit, passes over pairs have one of arithmetic, and columns stand below their headings.
#[test]
#[cfg_attr(
    debug_assertions,
    ignore = "the loops that measure the host are part of the command: needs an optimised build"
)]
fn the_host_is_a_roofline() {
    let (capture, file) = (profiled().path("z.npz"), profiled().path("host.json"));
    let options = ["--lateral", "32", "--iterations", "16", "--model", "cosine", "--support", "fixed"];
    let text = succeed(
        &[&["profile", &capture, "--device", "host", "--quiet", "--json", &file], &options[..]].concat(),
    );
    let profile = json(Path::new(&file));
    assert!(number(&profile["limits"], "fma_per_s") > 1e8, "{}", profile["limits"]);
    let (mut of_arithmetic, mut limited) = (0, 0);
    for kernel in profile["kernels"].as_array().unwrap() {
        of_arithmetic +=
            usize::from(["arithmetic", "additions"].contains(&kernel["limit"].as_str().unwrap_or("")));
        if let Some(share) = kernel["share_of_limit"].as_f64() {
            limited += 1;
            assert!(share > 0.0 && share <= 1.0, "{kernel}");
        }
    }
    assert!(of_arithmetic >= 2 && limited > 8, "{text}");
    let lines: Vec<&str> = text.lines().skip_while(|line| !line.starts_with("kernel ")).collect();
    let ends = |column: &str| lines[0].find(column).expect("a heading") + column.len();
    for line in lines.iter().skip(1).take_while(|line| !line.starts_with("all ")) {
        let (at_share, at_limit) = (ends("share"), ends("of its limit"));
        assert!(
            line[..at_share].ends_with(" %") && line.as_bytes().get(at_share) == Some(&b' '),
            "{line}\n{text}"
        );
        assert!(line[..at_limit].ends_with(['%', '-']), "{line}\n{text}");
    }
}

#[test]
fn the_parts_are_no_more_than_the_whole() {
    for (solver, _, profile, _) in &profiled().runs {
        let totals = &profile["totals"];
        let kernels = profile["kernels"].as_array().unwrap();
        let sum: f64 = kernels.iter().map(|k| number(k, "seconds")).sum();
        assert!((sum / number(totals, "device_s") - 1.0).abs() < 1e-9);
        let idle = number(&profile["gaps"], "within_s") + number(&profile["gaps"], "between_s");
        let solve = number(totals, "solve_s");
        assert!(sum + idle <= solve, "{solver}: busy {sum}, idle {idle}, in all {solve}");
        assert!(sum > 0.05 * solve, "{solver}: on lavapipe the device is what takes the time");
        let shares: f64 = kernels.iter().map(|k| number(k, "share")).sum();
        assert!((shares - 1.0).abs() < 1e-9);
        let iteration = &profile["iterations"];
        let parts = number(iteration, "pass_s") + number(iteration, "overhead_s");
        assert!((parts / number(iteration, "seconds") - 1.0).abs() < 1e-9);
        assert!(number(iteration, "overhead_s") > 0.0 && number(iteration, "pass_s") > 0.0);
    }
}

#[test]
fn the_timeline_has_two_lanes_whose_events_nest() {
    for (solver, _, profile, trace) in &profiled().runs {
        let events = trace["traceEvents"].as_array().unwrap();
        let slices = |lane: u64| -> Vec<&Value> {
            events.iter().filter(|e| e["ph"] == "X" && e["tid"] == lane).collect()
        };
        let (host, device) = (slices(1), slices(2));
        for what in ["load", "plan", "allocate", "make kernels", "record", "submit", "wait", "export"] {
            assert!(host.iter().any(|e| e["name"] == what), "{solver}: no {what} on the host");
        }
        for k in profile["kernels"].as_array().unwrap() {
            let calls = device.iter().filter(|e| e["name"] == k["kernel"]).count();
            let own = match k["kernel"].as_str().unwrap() {
                // Uploads are copies too, outside of the solver's stages.
                "copy" | "fill" => number(k, "calls") <= calls as f64,
                _ => number(k, "calls") == calls as f64,
            };
            assert!(own, "{solver}: {calls} of {k}");
        }
        let forward: Vec<_> = device.iter().filter(|e| e["name"] == "forward").collect();
        assert!(forward.iter().any(|e| e["args"]["iteration"] == 15 && e["args"]["lateral"] == 24));
        let first = if *solver == "paper" { 12 } else { 24 };
        assert!(forward.iter().any(|e| e["args"]["iteration"] == 0 && e["args"]["lateral"] == first));
        for lane in [&host, &device] {
            assert_nested(solver, lane);
        }
        let first =
            events.iter().filter(|e| e["ph"] == "X").map(|e| number(e, "ts")).fold(f64::MAX, f64::min);
        assert_eq!(first, 0.0);
    }
}

/// Two events of a lane are disjoint, or one contains the other.
fn assert_nested(solver: &str, lane: &[&Value]) {
    let mut spans: Vec<(f64, f64, &str)> = lane
        .iter()
        .map(|e| (number(e, "ts"), number(e, "ts") + number(e, "dur"), e["name"].as_str().unwrap()))
        .collect();
    spans.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
    // Nanoseconds are whole numbers; their sums in float64 nearly are.
    const SLACK: f64 = 1e-3;
    let mut open: Vec<(f64, f64, &str)> = vec![];
    for span in spans {
        while open.last().is_some_and(|o| o.1 <= span.0 + SLACK) {
            open.pop();
        }
        if let Some(o) = open.last() {
            assert!(span.1 <= o.1 + SLACK, "{solver}: {span:?} reaches out of {o:?}");
        }
        open.push(span);
    }
}

#[test]
#[ignore = "long: make soak"]
fn the_device_is_held_against_the_twins() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("check.json");
    let text = succeed(&["profile", "--check", "--json", &file.display().to_string()]);
    for words in ["backward", "float", "fixed", "points", "fma"] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
    assert!(!text.contains("WRONG"), "{text}");
    let reported = json(&file);
    assert!(number(&reported["limits"], "fma_per_s") > 0.0);
    let checks = reported["checks"].as_array().unwrap();
    assert!(checks.len() >= 28 && checks.iter().all(|c| number(c, "error") <= number(c, "allowed")));
    let last = format!("checked   {0} of {0} comparisons with float64 references pass", checks.len());
    assert!(text.trim_end().ends_with(&last), "{text}");
}

#[test]
fn what_is_wrong_is_said() {
    let capture = profiled().path("z.npz");
    fail(&["profile"], 2, "CAPTURE");
    fail(&["profile", "--stride", "2"], 2, "CAPTURE");
    fail(&["profile", &capture, "--check"], 2, "--check");
    fail(&["profile", "/nonexistent/z.npz"], 1, "no such file");
    fail(&["profile", &capture, "--json", "/"], 1, "is a folder");
    fail(&["profile", &capture, "--trace", &format!("{capture}/trace.json")], 1, "no folder");
    fail(&["profile", &capture, "--iterations", "0"], 1, "--iterations");
    fail(&["profile", &capture, "--device", "no such device"], 1, "no device is called");
    fail(&["profile", "--check", "--device", "no such device"], 1, "no device is called");
}

#[test]
#[ignore = "long: make soak"]
fn kernels_compile_without_a_device_to_run_them() {
    let all = profiled();
    let (file, capture) = (all.path("compiled.json"), all.path("z.npz"));
    for given in [&[][..], &[capture.as_str(), "--lateral", "24"]] {
        let text = succeed(&[&["profile", "--compile", "--quiet", "--json", &file], given].concat());
        let reported = json(Path::new(&file));
        let kernels = reported["kernels"].as_array().unwrap();
        let of = |name: &str| kernels.iter().find(|k| k["kernel"] == name).expect("the plan has it");
        for name in ["forward", "surface_gather"] {
            assert!(number(of(name), "seconds") > 0.0 && text.contains(name), "{name}: {reported}");
        }
        assert_eq!(reported["pairs"], if given.is_empty() { 1024 } else { 144 });
        let silent = kernels.iter().all(|k| k["executables"].as_array().unwrap().is_empty());
        assert_eq!(
            (silent, text.contains("says nothing")),
            (reported["tells"] == false, reported["tells"] == false)
        );
    }
    fail(&["profile", "--compile", "--check"], 2, "cannot be used with");
    fail(&["profile", &capture, "--listings", &file], 2, "--compile");
    fail(&["profile", "--compile", "--listings", &file], 1, "no folder");
}

/// Mesa's driver for AMD compiles for a GPU that is not there, where it is installed.
#[test]
#[ignore = "needs Mesa's driver for AMD: make soak"]
fn a_driver_without_a_device_tells_of_its_kernels_and_closes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [file, listings] = ["k.json", "isa"].map(|name| folder.path().join(name).display().to_string());
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_thirdbounce"));
        command.env("RADV_FORCE_FAMILY", "navi21").args(arguments).output().expect("the binary runs")
    };
    if !String::from_utf8_lossy(&run(&["devices"]).stdout).contains("Null hardware") {
        return;
    }
    let null = ["--device", "Null hardware"];
    let compiled =
        run(&[&["profile", "--compile", "--quiet", "--json", &file, "--listings", &listings], &null[..]]
            .concat());
    assert_eq!(compiled.status.code(), Some(0), "{}", String::from_utf8_lossy(&compiled.stderr));
    let reported = json(Path::new(&file));
    for kernel in reported["kernels"].as_array().unwrap() {
        let executable = &kernel["executables"][0];
        let of = |name: &str| number(&executable["statistics"], name);
        assert!(of("VGPRs") > 0.0 && of("Instructions") > 10.0 && of("Spilled VGPRs") == 0.0, "{kernel}");
        assert!([32.0, 64.0].contains(&number(executable, "subgroup")), "{kernel}");
    }
    let listing =
        std::fs::read_to_string(Path::new(&listings).join("forward.0.assembly.txt")).expect("a listing");
    assert!(listing.contains("v_rsq_f32"), "{listing}");
    // It cannot compute: the checks end in an error, and the device closes.
    let check = run(&[&["profile", "--check"], &null[..]].concat());
    assert_eq!(check.status.code(), Some(1), "{}", String::from_utf8_lossy(&check.stderr));
    assert!(!String::from_utf8_lossy(&check.stderr).contains("internal error"));
}

/// The file of compiled kernels: written by the first run, read by the second, and replaced where it is of another driver. With
/// Mesa's driver for AMD, where it is installed: lavapipe keeps no kernels.
#[test]
#[ignore = "long, needs Mesa's driver for AMD: make soak"]
fn kernels_are_kept_between_runs() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [file, cache] = ["k.json", "cache"].map(|name| folder.path().join(name));
    let command = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_thirdbounce"));
        // Without the driver's own cache.
        command.env("RADV_FORCE_FAMILY", "navi21").env("MESA_SHADER_CACHE_DISABLE", "true");
        command.env("XDG_CACHE_HOME", &cache).args(arguments);
        command
    };
    let run = |arguments: &[&str]| command(arguments).output().expect("the binary runs");
    if !String::from_utf8_lossy(&run(&["devices"]).stdout).contains("Null hardware") {
        return;
    }
    let compile = ["profile", "--compile", "--quiet", "--device", "Null hardware"];
    let paper: &[&str] = &["--solver", "paper", "--lateral", "64"];
    // Seconds of making all kernels.
    let made = |more: &[&str]| {
        let output = run(&[&compile[..], &["--json", &file.display().to_string()], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let reported = json(&file);
        reported["kernels"].as_array().unwrap().iter().map(|k| number(k, "seconds")).sum::<f64>()
    };
    let kept = |folder: &Path| -> Vec<std::path::PathBuf> {
        std::fs::read_dir(folder).map(|all| all.map(|e| e.unwrap().path()).collect()).unwrap_or_default()
    };
    let usual = cache.join("thirdbounce/kernels");
    let off = made(&[paper, &["--pipeline-cache", "off"]].concat());
    assert!(kept(&usual).is_empty());
    let (first, second) = (made(paper), made(paper));
    assert!(second < 0.25 * first.min(off), "{first} s, then {second} s; {off} s without");
    let [only] = &kept(&usual)[..] else { panic!("one file: {:?}", kept(&usual)) };
    let whole = std::fs::read(only).expect("the file");
    assert!(whole.len() > 10_000, "{}", whole.len());

    let mut other = whole.clone();
    // The vendor.
    other[8] ^= 4;
    for wrong in [&other[..], &whole[..31], b"another program's"] {
        std::fs::write(only, wrong).expect("it is ours");
        let again = made(paper);
        assert!(again > 4.0 * second, "{again} s without the file");
        assert!(made(paper) < 0.25 * again, "it is replaced");
    }

    // Two at once, with different kernels: what is left is whole, and each has what it needs.
    let there = folder.path().join("there");
    let at = ["--pipeline-cache", &there.display().to_string()];
    let paper = [&at[..], paper].concat();
    let both = [&[&compile[..], &at[..]].concat()[..], &[&compile[..], &paper].concat()[..]];
    let children = both.map(|arguments| {
        command(arguments).stdout(std::process::Stdio::null()).spawn().expect("the binary runs")
    });
    for mut child in children {
        assert!(child.wait().expect("it ends").success());
    }
    made(&at);
    made(&paper);
    assert!(made(&at) < 0.25 * first && made(&paper) < 0.25 * first);
    assert_eq!(kept(&there).len(), 1, "{:?}", kept(&there));
}
