//! `benches/gpu.sh` in its shortest form, so that it keeps working while there is no GPU.

use std::fs;
use std::process::Command;

use serde_json::Value;

fn measured(binary: &str) -> (bool, String, Option<Value>) {
    let out = tempfile::tempdir().unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../benches/gpu.sh");
    let mut command = Command::new("sh");
    command.args([script, "--smoke", "--out"]).arg(out.path()).arg(binary);
    let done = command.output().expect("sh runs");
    let text = String::from_utf8_lossy(&done.stdout).into_owned() + &String::from_utf8_lossy(&done.stderr);
    let mut files = fs::read_dir(out.path()).unwrap().map(|entry| entry.unwrap().path());
    let result = files.find(|file| file.extension().is_some_and(|e| e == "json"));
    let result = result.map(|file| serde_json::from_str(&fs::read_to_string(file).unwrap()).expect("JSON"));
    (done.status.success(), text, result)
}

#[test]
#[ignore = "long: make soak"]
fn the_script_for_gpus_measures_and_judges() {
    let (succeeds, text, result) = measured(env!("CARGO_BIN_EXE_thirdbounce"));
    assert!(
        succeeds && text.contains("pass  device memory of the default") && !text.contains("FAIL"),
        "{text}"
    );
    let result = result.expect("a result");
    for case in ["default", "named", "paper"] {
        let case = &result["case"][case];
        assert!(
            case["second_start_s"].as_f64() > Some(0.0) && case["peak_device_bytes"].as_f64() > Some(0.0)
        );
        let kernels = case["profile"]["kernels"].as_array().expect("kernels");
        assert!(kernels.iter().any(|k| k["kernel"] == "forward"), "{kernels:?}");
    }
    assert!(result["verdicts"].as_array().is_some_and(|all| all.len() == 5), "{}", result["verdicts"]);
}

#[test]
fn a_program_that_fails_fails_the_script() {
    let (succeeds, text, result) = measured("/bin/false");
    assert!(!succeeds && result.is_none(), "{text}");
}
