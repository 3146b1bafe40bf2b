//! Error against run time: methods side by side.

use std::path::Path;

use fixtures::command::{succeed, thirdbounce};
use fixtures::letter::{SHORT, figures, json, small};
use serde_json::Value;

fn entries(folder: &Path) -> Vec<String> {
    let name = |e: std::io::Result<std::fs::DirEntry>| e.unwrap().file_name().to_string_lossy().into_owned();
    let mut names: Vec<String> = std::fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}

/// Names and iterations of all methods of the case z.
fn iterations(out: &Path) -> Vec<(String, u64)> {
    let report = json(&out.join("z/case.json"));
    let of = |side: &Value| (side["name"].as_str().unwrap().into(), side["iterations"].as_u64().unwrap());
    report["sides"].as_array().unwrap().iter().map(of).collect()
}

#[test]
fn two_settings_side_by_side() {
    let (_, capture, truth) = small();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("deep/page");
    let methods = "paper;paper:sampling=fixed,learning-rate=0.5,name=slow & <fixed>,trace-every=14";
    let all = ["benchmark", capture, "--truth", truth, "--out", out.to_str().unwrap(), "--method", methods];
    let text = succeed(&[&all[..], &SHORT, &["--repeats", "2", "--trace-every", "7"]].concat());
    assert_eq!(iterations(&out), [("paper".into(), 30), ("slow & <fixed>".into(), 30)]);
    assert!(["paper", "slow & <fixed>"].iter().all(|name| text.contains(name)), "{text}");
    assert_eq!(entries(&out), ["benchmark.html", "benchmark.json", "z"]);
    let out = out.join("z");
    assert_eq!(entries(&out), ["case.json", "made_from.json", "paper", "pictures.png", "slow____fixed_"]);
    let page = std::fs::read_to_string(out.with_file_name("benchmark.html")).unwrap();
    for part in ["<td>paper</td>", "<td>30</td>", "<td>slow &amp; &lt;fixed&gt;</td>"] {
        assert!(page.contains(part), "{part}: {page}");
    }

    let reported = json(&out.join("case.json"));
    assert_eq!(reported["sides"], json(&out.with_file_name("benchmark.json"))["cases"][0]["sides"]);
    let sides = reported["sides"].as_array().unwrap();
    assert_eq!(sides.len(), 2);
    let methods: Vec<Value> =
        sides.iter().map(|s| json(&out.join(s["folder"].as_str().unwrap()).join("report.json"))).collect();
    assert_eq!(methods[1]["settings"]["sampling"], "fixed");
    assert_eq!(methods[1]["settings"]["learning_rate"], 0.5);
    assert_eq!(methods[0]["settings"]["learning_rate"], 1.0);
    let iterations = [&[7.0, 14.0, 21.0, 28.0, 30.0][..], &[14.0, 28.0, 30.0]];
    for ((method, side), iterations) in methods.iter().zip(sides).zip(iterations) {
        let measured: Vec<Value> =
            method["trace"].as_array().unwrap().iter().filter(|e| e["best_iou"].is_f64()).cloned().collect();
        let method = serde_json::json!({ "trace": measured });
        assert_eq!(figures(&method["trace"], "iteration"), iterations);
        let last = iterations.len() - 1;
        let seconds = figures(&method["trace"], "seconds");
        assert!(seconds.is_sorted() && seconds[0] > 0.0, "{seconds:?}");
        assert_eq!(side["repeats_s"].as_array().unwrap().len(), 2);
        let points = side["points"].as_array().unwrap();
        assert!(!points.is_empty() && points.len() <= iterations.len(), "{points:?}");
        let end = points.last().unwrap()[0].as_f64().unwrap();
        assert!((side["values"]["solve_s"].as_f64().unwrap() / end - 1.0).abs() < 0.01, "{side}");
        for (key, better) in [("residual", -1.0), ("loss", -1.0)] {
            let values = figures(&method["trace"], key);
            assert!(
                values.len() == last + 1 && better * (values[last] - values[0]) > 0.0,
                "{key} {values:?}"
            );
        }
        // So few steps on so small a scene may not improve the figure.
        let iou = figures(&method["trace"], "best_iou");
        assert!(iou.len() == last + 1 && iou.iter().all(|v| (0.1..=1.0).contains(v)), "{iou:?}");
        let residual = figures(&method["trace"], "residual");
        assert!(residual.iter().all(|r| (0.0..1.5).contains(r)), "{residual:?}");
    }
    let text = succeed(&["evaluate", out.join("paper").to_str().unwrap(), "--truth", truth]);
    assert!(text.contains("solved in"), "{text}");
}

#[test]
fn a_solver_that_is_named_is_the_only_method() {
    let (_, capture, truth) = small();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let all = ["benchmark", capture, "--truth", truth, "--out", &out, "--repeats", "1", "--model", "cosine"];
    succeed(&[&all[..], &SHORT, &["--solver", "surface", "--support", "fixed"]].concat());
    assert_eq!(iterations(folder.path()), [("surface".into(), 30)]);
    let residual = figures(&json(&folder.path().join("z/surface/report.json"))["trace"], "residual");
    assert!(residual.len() >= 3 && residual.last() < residual.first(), "{residual:?}");
}

#[test]
fn what_is_wrong_is_said_in_one_message_and_nothing_is_written() {
    let (_, capture, truth) = small();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("c").display().to_string();
    let benchmark = ["benchmark", capture, "--out", &out, "--quiet"];
    let with_truth = ["--truth", truth.as_str()];
    let cases: &[(&[&str], i32, &str)] = &[
        (&["--truth", "/nonexistent/t.npz"], 1, "/nonexistent/t.npz"),
        (&["--truth", capture], 1, "gt_depth"),
        (&[&with_truth[..], &["--method", "magic"]].concat(), 1, "the solver magic is not known"),
        (&[&with_truth[..], &["--method", "paper:colour=red"]].concat(), 1, "--colour"),
        (&[&with_truth[..], &["--method", "paper:l1=much"]].concat(), 1, "--l1 is much"),
        (&[&with_truth[..], &["--method", "paper;paper:l1=-2"]].concat(), 1, "--l1 is -2"),
        (
            &[&with_truth[..], &["--method", "surface:l1=1"]].concat(),
            1,
            "--l1 is no option of the solver surface",
        ),
        (
            &[&with_truth[..], &["--method", "paper:sparsity=1"]].concat(),
            1,
            "--sparsity is no option of the solver paper",
        ),
        (&[&with_truth[..], &["--method", "paper:sampling=wild"]].concat(), 1, "'wild'"),
        (&[&with_truth[..], &["--method", "paper:no-reduce=1"]].concat(), 1, "no-reduce"),
        (&[&with_truth[..], &["--method", ""]].concat(), 1, "--method is empty"),
        (&[&with_truth[..], &["--repeats", "0"]].concat(), 1, "the number of repeats is 0"),
        (&[&with_truth[..], &["--mask-fraction", "2"]].concat(), 1, "the mask fraction is 2"),
        (&[&with_truth[..], &["--lateral", "0"]].concat(), 1, "--lateral is 0"),
    ];
    for (arguments, code, words) in cases {
        check_failure(&[&benchmark[..], arguments].concat(), *code, words);
    }
    assert_eq!(entries(folder.path()), Vec::<String>::new(), "something was written");
}

#[track_caller]
fn check_failure(arguments: &[&str], code: i32, words: &str) {
    let output = thirdbounce(arguments);
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}\n{text}");
    assert!(text.contains(words), "{arguments:?}: {words:?} is not in\n{text}");
    assert_eq!(text.matches("error:").count(), 1, "{arguments:?}\n{text}");
    assert!(!text.contains("internal error") && output.stdout.is_empty(), "{text}");
}

#[test]
fn every_method_and_other_programs_stand_in_one_table() {
    let (folder, capture, truth) = small();
    let out = folder.path().join("all");
    let other = folder.path().join("other");
    let [out_text, other_text] = [&out, &other].map(|p| p.display().to_string());
    succeed(&["reconstruct", capture, "--out", &other_text, "--solver", "lct", "--lateral", "16", "--quiet"]);
    let foreign = format!("theirs={other_text},seconds=1.5,hardware=another GPU");
    let arguments = ["benchmark", capture, "--truth", truth, "--out", &out_text, "--repeats", "1"];
    let table = succeed(&[&arguments[..], &["--method", "all", "--foreign", &foreign], &SHORT].concat());
    let report = json(&out.join("z/case.json"));
    let methods = report["sides"].as_array().unwrap();
    let names: Vec<&str> = methods.iter().map(|m| m["name"].as_str().unwrap()).collect();
    let all = ["surface", "paper", "lct", "dlct", "fk", "phasor", "phasor-bp", "fbp", "bp", "theirs"];
    assert_eq!(names, all);
    for method in methods {
        let name = method["name"].as_str().unwrap();
        // Without a GPU all run there.
        let [foreign, host] = [name == "theirs", name != "theirs"];
        assert_eq!(method["foreign"], foreign, "{name}");
        let on = method["runs_on"].as_str().unwrap();
        assert_eq!((on.starts_with("host"), on == "another GPU"), (host, foreign), "{name}: {on}");
        assert!(method["values"]["best_iou"].as_f64().unwrap() > 0.2, "{name}");
        assert!(method["values"]["solve_s"].as_f64().unwrap() > 0.0 && table.contains(name), "{name}");
    }
    // The solver shows the maps of a closed-form method first.
    assert_eq!(names[..2], ["surface", "paper"]);
    let points = methods[0]["points"].as_array().unwrap();
    let number = |point: &Value, k: usize| point[k].as_f64().unwrap();
    assert_eq!((&methods[0]["preview"], &methods[1]["preview"]), (&true.into(), &false.into()));
    assert!(number(&points[0], 2) > 0.2, "{}", points[0]);
    assert!(
        points.len() > 1 && points.is_sorted_by(|a, b| 0.0 < number(a, 0) && number(a, 0) < number(b, 0))
    );
    assert_eq!(methods[2]["points"].as_array().unwrap().len(), 1, "a closed form is one point");
    // The same maps, whoever made them.
    let without_time = |method: &Value| {
        let mut values = method["values"].as_object().unwrap().clone();
        values.remove("solve_s");
        values
    };
    assert_eq!(without_time(&methods[2]), without_time(&methods[9]));
    assert_eq!(report["left_out"].as_array().unwrap().len(), 0);
}

#[test]
fn with_an_oracle_every_mask_is_the_best_and_the_page_says_so() {
    let (folder, capture, truth) = small();
    let out = folder.path().join("oracle");
    let out_text = out.display().to_string();
    let all =
        ["benchmark", capture, "--truth", truth, "--out", &out_text, "--methods", "lct;fk", "--repeats", "1"];
    // A row of a published table stands beside it.
    let row = ["--foreign", "a|b,depth=.0477/.1523,normals=.1147,seconds=54,hardware=RTX 3090"];
    succeed(&[&all[..], &["--lateral", "16", "--quiet", "--oracle"], &row].concat());
    let report = json(&out.join("z/case.json"));
    let (row, own) = report["sides"].as_array().unwrap().split_last().unwrap();
    assert_eq!((row["foreign"].as_bool(), &row["values"]["own_iou"]), (Some(true), &Value::Null));
    assert_eq!(row["values"]["paper_depth_rmse_m"], 0.1523);
    let page = std::fs::read_to_string(out.join("benchmark.html")).unwrap();
    let line = page.split("<td>a|b (foreign)</td>").nth(1).unwrap().split("</tr>").next().unwrap();
    assert!(["0.0477", "0.1523", "0.1147"].iter().all(|figure| line.contains(figure)), "{line}");
    for method in own {
        let values = &method["values"];
        assert!(values["paper_normals_rmse"].as_f64().unwrap() > 0.0);
        assert_eq!(values["own_iou"], values["best_iou"]);
        let folder = out.join("z").join(method["folder"].as_str().unwrap());
        let maps = thirdbounce::export::npz::read_maps(&folder.join("maps.npz")).unwrap();
        let metrics = &json(&folder.join("report.json"))["metrics"];
        assert_eq!(maps.mask_fraction, metrics["best_fraction"].as_f64());
    }
    assert!(page.contains("Oracle masks"));
}

#[test]
fn a_time_limit_ends_a_run_with_its_last_sample() {
    let (folder, capture, truth) = small();
    let out = folder.path().join("limited");
    let method = "paper:time-limit=0.001,trace-every=1";
    let all = ["benchmark", capture, "--truth", truth, "--out", out.to_str().unwrap(), "--repeats", "1"];
    succeed(&[&all[..], &["--method", method], &SHORT].concat());
    assert!(std::fs::read_to_string(out.join("benchmark.html")).unwrap().contains("(stopped)"));
    let side = &json(&out.join("z/case.json"))["sides"][0];
    assert!(side["limited"] == true && side["iterations"].as_u64().unwrap() < 30, "{side}");
    let end = side["points"].as_array().unwrap().last().unwrap()[0].as_f64().unwrap();
    assert!((end - side["values"]["solve_s"].as_f64().unwrap()).abs() < 1e-4, "{side}");
    let refused = thirdbounce(&[&all[..], &["--method", "paper:time-limit=0"]].concat());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("time limit"));
}

#[test]
fn methods_whose_assumptions_break_are_left_out_or_refused() {
    let (folder, _, truth) = small();
    let [capture, out] = ["one_laser.npz", "one_laser"].map(|n| folder.path().join(n).display().to_string());
    let scene = ["simulate", "letter-Z", "--scan", "8", "--bin-width", "0.02", "--pairs", "one-laser"];
    succeed(&[&scene[..], &["--out", &capture]].concat());
    let arguments = ["benchmark", &capture, "--truth", truth, "--out", &out, "--repeats", "1"];
    let page = |more: &[&str]| thirdbounce(&[&arguments[..], more, &SHORT].concat());
    let refused = page(&["--method", "lct"]);
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(1) && said.contains("confocal") && said.contains("fbp"), "{said}");
    let done = page(&["--methods", "all"]);
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    let report = json(&Path::new(&out).join("one_laser/case.json"));
    let left: Vec<&str> =
        report["left_out"].as_array().unwrap().iter().map(|m| m[0].as_str().unwrap()).collect();
    assert_eq!(left, ["lct", "dlct", "fk"]);
    let page = std::fs::read_to_string(Path::new(&out).join("benchmark.html")).unwrap();
    assert!(page.contains("fk is left out: f-k migration needs a confocal scan"), "{page}");
}

#[test]
fn foreign_maps_need_a_folder_a_time_and_hardware() {
    let (folder, capture, truth) = small();
    let out = folder.path().join("foreign").display().to_string();
    for (foreign, says) in [
        ("theirs", "names no folder"),
        ("theirs=x,hardware=GPU", "gives no seconds"),
        ("theirs=x,seconds=1", "gives no hardware"),
        ("theirs=x,seconds=1,hardware=GPU,colour=red", "colour=red"),
        ("theirs=/nonexistent,seconds=1,hardware=GPU", "foreign \"theirs\""),
        ("theirs=x,seconds=-1,hardware=GPU", "took -1 s"),
        ("theirs=x,depth=.1,seconds=1,hardware=GPU", "both maps and figures"),
        ("theirs,depth=.1/.2/.3,seconds=1,hardware=GPU", "not MAE or MAE/RMSE"),
        ("theirs,normals=a/.2,seconds=1,hardware=GPU", "not MAE or MAE/RMSE"),
        ("theirs,depth=.1/.2,hardware=GPU", "gives no seconds"),
        (&format!("maps=m,hardware=h,seconds={}", "1".repeat(400)), "(400 digits)"),
    ] {
        let done = thirdbounce(&[
            "benchmark",
            capture,
            "--truth",
            truth,
            "--out",
            &out,
            "--method",
            "lct",
            "--foreign",
            foreign,
        ]);
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(done.status.code() == Some(1) && said.contains(says), "{foreign}: {said}");
    }
    assert!(!Path::new(&out).join("benchmark.json").exists());
}

/// Options of a short run of pixels that tell the models apart, and that repeats its bits.
const TELLING: [&str; 9] =
    ["--lateral", "64", "--iterations", "10", "--support", "fixed", "--high-pass", "0", "--deterministic"];

#[test]
fn a_comparison_names_the_models_that_were_found() {
    let folder = tempfile::tempdir().unwrap();
    let [capture, truth, out] =
        ["c.npz", "t.npz", "compared"].map(|name| folder.path().join(name).display().to_string());
    let scene = ["simulate", "figure", "--scan", "12", "--bin-width", "0.01", "--noise", "0.02", "--quiet"];
    let rest = ["--out", &capture, "--truth", &truth, "--reflectance", "lambertian"];
    succeed(&[&scene[..], &rest].concat());
    let methods = "surface:model=cosine;surface:name=auto";
    let all =
        ["benchmark", &capture, "--truth", &truth, "--out", &out, "--method", methods, "--repeats", "1"];
    let text = succeed(&[&all[..], &TELLING, &["--quiet"]].concat());
    assert!(text.contains("surface:model=cosine") && text.contains("auto (lambertian)"), "{text}");
    let page = std::fs::read_to_string(Path::new(&out).join("benchmark.html")).unwrap();
    assert!(page.contains("<td>auto (lambertian)</td>"), "{page}");
    let case = &json(&Path::new(&out).join("benchmark.json"))["cases"][0];
    let name = case["name"].as_str().unwrap();
    let report = |side: usize| {
        let folder = case["sides"][side]["folder"].as_str().unwrap();
        json(&Path::new(&out).join(name).join(folder).join("report.json"))
    };
    let ([named, auto], side) = ([report(0), report(1)], &case["sides"][1]);
    assert_eq!(auto["settings"]["model_found"]["reflectance"], "lambertian");
    assert!(named["settings"]["model_found"].is_null());
    // Trials count as solving: they come before the first point of the solver, behind that of the preview.
    let trials = auto["settings"]["trials_s"].as_f64().unwrap();
    let [preview, first] = [0, 1].map(|i| side["points"][i][0].as_f64().unwrap());
    assert!(side["preview"] == true && trials > 0.0 && first > trials && first > preview);
    assert!(side["values"]["solve_s"].as_f64().unwrap() > trials);
    assert_eq!(named["settings"]["trials_s"], 0.0);
}
