//! The pages of the repository that show the stored benchmark, and results of `benches/gpu.sh`.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use thirdbounce_benchmark::pages::{Page, Stability, figure, read_json, write_json};
use thirdbounce_benchmark::pinned::Pinned;

/// The stored benchmark.
pub const STORED: &str = "benches/results/benchmark.json";

/// The curve.
const CURVE: &str = "docs/benchmark.svg";

/// Results of `benches/gpu.sh` that pages show.
const GPUS: &str = "benches/results";

/// A part of a file, between the comments `<!-- NAME -->` and `<!-- end of NAME -->`; the whole file without a name.
pub struct Part {
    pub file: &'static str,
    pub name: Option<&'static str>,
    pub text: String,
}

pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Everything that shows the stored benchmark.
pub fn parts(page: &Page) -> Vec<Part> {
    let cases = page.compared();
    let names: Vec<&str> = cases.iter().map(|case| case.name.as_str()).collect();
    let title = format!("Error against run time, means over {} cases", cases.len());
    let about =
        format!("Cases: {}. Device: {}.\n\n{}\n", names.join(", "), page.machine(), page.standing().trim());
    let caption = format!("*{title}; [cases, device and table](docs/accuracy.md#benchmark).*");
    let picture = |path: &str| format!("![{title}]({path})");
    let limited = cases.iter().flat_map(|case| &case.sides).find(|side| side.limited);
    let limit = limited.map_or(String::new(), |side| {
        let (name, spec) = (&side.name, &side.spec);
        format!("\n`{name}` (`{spec}`) is stopped at its first sample after the time limit, which is then its result.\n")
    });
    vec![
        Part { file: CURVE, name: None, text: figure(&cases, &title, &[0, 1, 2, 3], true).svg() },
        Part {
            file: "README.md",
            name: Some("benchmark"),
            text: format!("{}\n\n{caption}\n", picture(CURVE)),
        },
        Part {
            file: "docs/accuracy.md",
            name: Some("benchmark"),
            text: format!("{}\n\n{about}\n{}{limit}", picture("benchmark.svg"), page.means().markdown()),
        },
        Part { file: "docs/accuracy.md", name: Some("stability"), text: page.stability_table().markdown() },
        Part { file: "README.md", name: Some("gpus"), text: gpus().iter().map(sentence).collect() },
        Part {
            file: "docs/devices.md",
            name: Some("gpus"),
            text: gpus().iter().map(section).collect::<Vec<_>>().join("\n"),
        },
    ]
}

/// Whole results of GPUs, by file name.
fn gpus() -> Vec<Value> {
    let files = fs::read_dir(root().join(GPUS)).expect("a folder of results");
    let mut files: Vec<PathBuf> = files.map(|file| file.expect("a file").path()).collect();
    files.sort();
    let read =
        |file: &PathBuf| serde_json::from_slice::<Value>(&fs::read(file).expect("a readable file")).ok();
    // Those of `--quick` and `--smoke` are of CPUs.
    files
        .iter()
        .filter(|f| f.extension().is_some_and(|e| e == "json"))
        .filter_map(read)
        .filter(|v| v["quick"] == false)
        .collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// Seconds of the default and of a named model.
fn sentence(gpu: &Value) -> String {
    let [default, named] = ["default", "named"].map(|case| &gpu["case"][case]);
    format!(
        "*{}: 32 × 32 scan points, 128 × 128 pixels in {:.2} s, with a named model {:.2} s ([measured on GPUs](docs/devices.md#measured-on-gpus)).*\n",
        gpu["device"].as_str().unwrap_or_default(),
        number(&default["median_s"]),
        number(&named["median_s"]),
    )
}

/// A table of all cases.
fn section(gpu: &Value) -> String {
    let word = |key: &str| gpu[key].as_str().unwrap_or_default();
    let checks = gpu["check"]["checks"].as_array().map_or(&[][..], Vec::as_slice);
    let passed = checks.iter().filter(|c| number(&c["error"]) <= number(&c["allowed"])).count();
    let mut text = format!(
        "{} ({}): {passed} of {} comparisons of kernels with their float64 references pass.\n\n\
         | case | solve, s | second process, s | device, s | device memory, MiB | forward, pairs/s | backward, pairs/s |\n\
         |---|--:|--:|--:|--:|--:|--:|\n",
        word("device"),
        word("driver"),
        checks.len(),
    );
    for (name, case) in gpu["case"].as_object().into_iter().flatten() {
        let profile = &case["profile"];
        let kernels = profile["kernels"].as_array().map_or(&[][..], Vec::as_slice);
        let rate = |pass: &str| {
            let of_pass = |k: &&Value| k["name"].as_str().is_some_and(|name| name.starts_with(pass));
            kernels.iter().find(of_pass).map_or(f64::NAN, |k| number(&k["pairs_per_s"]))
        };
        text += &format!(
            "| {name}: `{}` | {:.3} | {:.2} | {:.3} | {:.0} | {:.1e} | {:.1e} |\n",
            case["options"].as_str().unwrap_or_default(),
            number(&case["median_s"]),
            number(&case["second_start_s"]),
            number(&profile["totals"]["device_s"]),
            number(&case["peak_device_bytes"]) / f64::from(1 << 20),
            rate("forward"),
            rate("backward"),
        );
    }
    text
}

/// A file with a part replaced, and the part that it had.
///
/// # Errors
/// The file lacks the comments around the part.
pub fn replaced(text: &str, part: &Part) -> Result<(String, String), String> {
    let Some(name) = part.name else { return Ok((part.text.clone(), text.into())) };
    let [begin, end] = [format!("<!-- {name} -->\n\n"), format!("\n<!-- end of {name} -->")];
    let found = text.split_once(&begin).and_then(|(before, rest)| Some((before, rest.split_once(&end)?)));
    let (before, (inside, after)) = found.ok_or(format!("{}: lacks {begin:?} or {end:?}", part.file))?;
    Ok((format!("{before}{begin}{}{end}{after}", part.text), inside.into()))
}

/// Stores a benchmark with a table of stability, and renews everything that shows it. Without a new table the stored one stays.
///
/// # Errors
/// Files that cannot be read or written.
pub fn renew(file: &Path, stability: Vec<Stability>) -> Result<(), String> {
    let text = |e: thirdbounce::Error| e.to_string();
    let stored = root().join(STORED);
    let mut page: Page = read_json(file).map_err(text)?;
    if page.stability.is_empty() {
        page.stability = stability;
    }
    if page.stability.is_empty() {
        page.stability = read_json::<Page>(&stored).map_or(vec![], |page| page.stability);
    }
    // Tables that are stored already keep their build.
    if page.pinned.is_none() {
        page.pinned = Some(Pinned::solved().map_err(text)?);
    }
    // Folders of maps are not stored.
    page.cases.iter_mut().flat_map(|case| &mut case.sides).for_each(|side| side.folder.clear());
    write_json(&stored, &page).map_err(text)?;
    for part in parts(&page) {
        let path = root().join(part.file);
        let at = |e: std::io::Error| format!("{}: {e}", path.display());
        let before = if part.name.is_some() { fs::read_to_string(&path).map_err(at)? } else { String::new() };
        fs::write(&path, replaced(&before, &part)?.0).map_err(at)?;
    }
    Ok(())
}
