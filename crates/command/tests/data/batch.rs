//! `examples/ray_batch.py` on this machine.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use fixtures::command::{program, stderr, stdout, succeed};

pub fn ray_shares_a_list(python: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let names = ["a", "b", "c", "d"];
    let paths = names.map(|name| folder.path().join(name).with_extension("npz").display().to_string());
    for (scene, path) in ["letter-Z", "sphere", "torus", "letter-K"].into_iter().zip(&paths) {
        succeed(&["simulate", scene, "--out", path, "--scan", "8", "--bin-width", "0.03", "--noise", "0.3"]);
    }
    let (list, out) = (folder.path().join("list.txt"), folder.path().join("out"));
    std::fs::write(&list, paths.join("\n")).unwrap();
    let run = || {
        let mut command = Command::new(python);
        command.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/ray_batch.py"));
        command.arg(&list).arg(&out).args(["--parts", "2", "--cpus", "1", "--"]);
        command.args(["--model", "cosine", "--lateral", "16", "--iterations", "8"]);
        let output = command.env("THIRDBOUNCE", program()).output().expect("Python runs");
        assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
        let lines = stdout(&output);
        let of = |key: &str, line: &str| {
            let line: serde_json::Value = serde_json::from_str(line).expect("a line of JSON");
            line[key].as_str().expect("a word").to_string()
        };
        let reported: BTreeSet<_> =
            lines.lines().map(|line| (of("name", line), of("status", line))).collect();
        assert_eq!(lines.lines().count(), reported.len());
        reported
    };
    let all = |status: &str| names.map(|n| (n.to_string(), status.to_string())).into_iter().collect();
    assert_eq!(run(), all("done"));
    assert!(names.iter().all(|name| out.join(name).join("report.json").is_file()));
    assert_eq!(run(), all("skipped"));
}
