//! The recording as a trace for Perfetto and chrome://tracing: one lane for the host, one for the device.

use serde_json::{Value, json};

use thirdbounce::gpu::Recording;

const HOST: u32 = 1;
const DEVICE: u32 = 2;

/// The trace's JSON. Times count from the earliest event.
pub fn events(recording: &Recording, device: &str) -> Value {
    let host = recording.host.iter().map(|s| s.from);
    let start = host.chain(recording.device.iter().map(|r| r.from)).fold(f64::INFINITY, f64::min);
    // Rounded to nanoseconds, so that spans that nest in seconds also nest in the file.
    let us = |s: f64| ((s - start) * 1e9).round() / 1e3;
    let slice = |lane, name: &str, from: f64, to: f64, arguments: Value| {
        let duration = ((us(to) - us(from)) * 1e3).round() / 1e3;
        json!({ "name": name, "ph": "X", "pid": 1, "tid": lane, "ts": us(from), "dur": duration, "args": arguments })
    };
    let lane = |tid, name: &str| json!({ "name": "thread_name", "ph": "M", "pid": 1, "tid": tid, "args": { "name": name } });
    let mut all = vec![
        json!({ "name": "process_name", "ph": "M", "pid": 1, "args": { "name": "thirdbounce" } }),
        lane(HOST, "host"),
        lane(DEVICE, device),
    ];
    all.extend(recording.host.iter().map(|s| slice(HOST, s.what, s.from, s.to, json!({}))));
    // A stage lasts from its first command to its last; its commands lie inside.
    let mut stages: Vec<Option<(f64, f64)>> = vec![None; recording.stages.len()];
    for ran in &recording.device {
        if let Some(stage) = ran.stage {
            let (from, to) = stages[stage].unwrap_or((ran.from, ran.to));
            stages[stage] = Some((from.min(ran.from), to.max(ran.to)));
        }
    }
    let values = |stage: Option<usize>| {
        let stage = stage.map(|s| &recording.stages[s]);
        let values = stage.into_iter().flat_map(|s| s.values.iter());
        values.map(|(n, v)| (n.to_string(), json!(v))).collect::<serde_json::Map<_, _>>()
    };
    for (i, (stage, span)) in recording.stages.iter().zip(&stages).enumerate() {
        if let Some((from, to)) = span {
            all.push(slice(DEVICE, stage.name, *from, *to, values(Some(i)).into()));
        }
    }
    for ran in &recording.device {
        let mut arguments = values(ran.stage);
        arguments.insert("submission".into(), ran.submission.into());
        all.push(slice(DEVICE, ran.kernel, ran.from, ran.to, arguments.into()));
    }
    json!({ "traceEvents": all, "displayTimeUnit": "ms" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use thirdbounce::gpu::{HostSpan, Ran, Stage};

    #[test]
    fn a_stage_spans_its_commands_and_times_count_from_the_first() {
        let ran = |kernel, from, to| Ran { kernel, stage: Some(0), submission: 3, from, to };
        let recording = Recording {
            host: vec![HostSpan { what: "load", from: -0.5, to: -0.25 }],
            stages: vec![Stage::new("iteration", &[("iteration", 7)])],
            device: vec![ran("forward", 0.0, 1e-3), ran("finish", 2e-3, 2.5e-3)],
            ..Recording::default()
        };
        let trace = events(&recording, "a device");
        let all = trace["traceEvents"].as_array().unwrap();
        let of = |name: &str| all.iter().find(|e| e["name"] == name && e["ph"] == "X").unwrap();
        assert_eq!((&of("load")["ts"], &of("load")["dur"]), (&json!(0.0), &json!(250_000.0)));
        assert_eq!((&of("forward")["ts"], &of("forward")["dur"]), (&json!(500_000.0), &json!(1000.0)));
        assert_eq!((&of("iteration")["ts"], &of("iteration")["dur"]), (&json!(500_000.0), &json!(2500.0)));
        assert_eq!(of("finish")["args"], json!({ "iteration": 7, "submission": 3 }));
        assert_ne!(of("finish")["tid"], of("load")["tid"]);
    }
}
