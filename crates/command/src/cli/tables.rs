//! Figures as lines of text.

use thirdbounce::export::report::Report;
use thirdbounce::gpu::KernelTime;
use thirdbounce::maps::MaskPart;
use thirdbounce::measure::{LayerMetrics, Metrics};

/// A device by name and kind; the host by name, vectors and threads.
pub fn device(name: &str, kind: &str, driver: &str) -> String {
    if kind == "host" { format!("{name}, {driver}") } else { format!("{name} ({kind})") }
}

/// The summary of a run.
pub fn report(report: &Report) -> String {
    let t = &report.totals;
    let mut out = String::new();
    let size = |name: &str| -> Vec<String> {
        report.settings[name].as_array().into_iter().flatten().map(|n| n.to_string()).collect()
    };
    let (grid, maps) = (size("volume_reached"), size("grid_reached"));
    let surface = match report.settings["points_per_pixel"].is_null() {
        true => String::new(),
        false => format!(", a surface of {} pixels", maps[..maps.len().min(2)].join(" x ")),
    };
    let line = |out: &mut String, name: &str, text: String| *out += &format!("{name:<10}{text}\n");
    if let Some(verdict) = &report.verdict {
        line(&mut out, "verdict", verdict.to_string());
    }
    line(&mut out, "grid", format!("{} voxels{surface}", grid.join(" x ")));
    line(&mut out, "device", device(&report.device.name, &report.device.kind, &report.device.driver));
    line(
        &mut out,
        "time",
        format!(
            "solved in {}, load {}, export {}",
            seconds(t.solve_s),
            seconds(t.load_s),
            seconds(t.export_s)
        ),
    );
    line(
        &mut out,
        "work",
        format!("{:.3e} voxel-pair evaluations, {:.3e} per second", t.pairs, t.pairs_per_s),
    );
    line(&mut out, "memory", format!("{} on the device", bytes(t.peak_device_bytes)));
    let of_volume = report.settings["volume_iterations"].as_u64().unwrap_or(u64::MAX);
    let volume = report.trace.iter().rfind(|p| p.iteration as u64 <= of_volume);
    if let Some(last) = report.trace.last() {
        // A closed form minimises nothing.
        let mut text = match last.loss.is_finite() {
            true => format!("iteration {}, loss {}", last.iteration, number(last.loss)),
            false => "closed form".into(),
        };
        if let Some(volume) = volume {
            let share = 100.0 * volume.active_ratio;
            text += &format!(", {} of the grid's voxels active ({share:.2} %)", volume.active);
        }
        if last.iteration > volume.map_or(0, |p| p.iteration) {
            let then = if volume.is_some() { "then " } else { "" };
            text += &format!(", {then}{} points of a surface", last.active);
        }
        line(&mut out, "end", text);
    }
    if report.plan.full {
        let what = "the domain was larger than its room, so its dimmest voxels were left out. If the result looks \
                    cut off, use a larger --room, a coarser --lateral or --depth-pitch, or a narrower --gate";
        line(&mut out, "note", what.into());
    }
    if let Some(metrics) = &report.metrics {
        out += &self::metrics(metrics);
    }
    out
}

/// Figures against truth.
pub fn metrics(m: &Metrics) -> String {
    let share = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.3}"));
    let four = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.4}"));
    let mm = |v: Option<f64>| match v {
        None => "-".into(),
        Some(v) if v < 1e-4 => format!("{} mm", number(1000.0 * v)),
        Some(v) => format!("{:.2} mm", 1000.0 * v),
    };
    let degrees = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.1} degrees"));
    let best = match (m.best_iou, m.best_fraction, &m.at_best) {
        // A mask of its own may be better than any share of the brightest pixel.
        (Some(iou), Some(fraction), Some(best)) if m.iou.is_none_or(|own| iou > own) => format!(
            "best      IoU {iou:.3} at mask fraction {fraction:.3}: completeness {}, depth MAE {}, normals {}\n",
            share(best.completeness),
            mm(best.depth_mae),
            degrees(best.normal_error_deg)
        ),
        _ => String::new(),
    };
    let quarter = |[depth_error, within]: &[f64; 2]| format!("{within:.2} at {}", mm(Some(*depth_error)));
    let quarters: Vec<String> = m.coverage.iter().map(quarter).collect();
    let reported = m.within_depth_error.map_or_else(String::new, |within| {
        let quarters = if quarters.is_empty() {
            String::new()
        } else {
            format!(" (by quarters {})", quarters.join(", "))
        };
        format!(
            "certain   {within:.2} of the errors are within the depth_error, .68 if it is right{quarters}\n"
        )
    });
    let layer = |(name, l): (&str, &LayerMetrics)| {
        format!(
            "{name:<10}IoU {}, completeness {}, depth MAE {}, normals {}\n",
            share(l.iou),
            share(l.completeness),
            mm(l.depth_mae),
            degrees(l.normal_error_deg)
        )
    };
    let albedo = m.albedo_spread.map_or_else(String::new, |spread| {
        let ratio =
            m.albedo_ratio_error.map_or_else(String::new, |e| format!(", ratio of two tones off by {e:.3}"));
        format!("albedo    spread {spread:.3} where the true one is the same{ratio}\n")
    });
    let layers: String = ["first", "behind"].into_iter().zip(&m.layers).map(layer).collect();
    format!(
        "surface   IoU {}, completeness {} {}\n\
         depth     MAE {}, RMSE {} over {} pixels\n\
         missing   over the true mask: depth MAE {} with the far limit where nothing is found, {} with the depth of the nearest pixel\n\
         normals   {}, mean absolute error of components {}\n\
         {albedo}paper     all pixels, 0 where nothing is: depth MAE {} m, RMSE {} m; normals MAE {}, RMSE {}\n\
         {best}{reported}{layers}",
        share(m.iou),
        share(m.completeness),
        m.fraction.map_or("within the mask".into(), |f| format!("at mask fraction {f}")),
        mm(m.depth_mae),
        mm(m.depth_rmse),
        m.hit_pixels,
        mm(m.depth_mae_far),
        mm(m.depth_mae_nearest),
        degrees(m.normal_error_deg),
        share(m.normal_mae),
        four(m.paper.depth_mae),
        four(m.paper.depth_rmse),
        four(m.paper.normal_mae),
        four(m.paper.normal_rmse),
    )
}

/// Largest parts that are listed.
const PARTS: usize = 5;

/// What the largest parts of a mask look like.
pub fn parts(parts: &[MaskPart]) -> String {
    let of = |p: &MaskPart| {
        format!(
            "part      {} pixels, {:.2} mm off a plane, albedo spread {:.3}\n",
            p.pixels,
            1000.0 * p.off_plane,
            p.albedo_spread
        )
    };
    let listed: String = parts.iter().take(PARTS).map(of).collect();
    match parts.len() {
        n if n > PARTS => format!("{listed}parts     {n} in all\n"),
        _ => listed,
    }
}

/// Time per kernel, the longest first.
pub fn kernels(times: &[(&'static str, KernelTime)]) -> String {
    let total: f64 = times.iter().map(|(_, t)| t.seconds).sum();
    let mut sorted = times.to_vec();
    sorted.sort_by(|a, b| b.1.seconds.total_cmp(&a.1.seconds));
    let mut out =
        format!("{:<26}{:>8}{:>12}{:>12}{:>8}\n", "kernel", "calls", "seconds", "us a call", "share");
    for (name, t) in sorted {
        let each = 1e6 * t.seconds / t.calls.max(1) as f64;
        let share = 100.0 * t.seconds / total.max(1e-12);
        out += &format!("{name:<26}{:>8}{:>12.4}{each:>12.1}{share:>6.1} %\n", t.calls, t.seconds);
    }
    out + &format!("{:<26}{:>8}{total:>12.4}\n", "all", "")
}

/// A number with four digits, with an exponent if that is shorter.
pub fn number(v: f64) -> String {
    if v == 0.0 {
        return "0".into();
    }
    if (1e-3..1e4).contains(&v.abs()) {
        let decimals = (3.0 - v.abs().max(1e-3).log10().floor()).clamp(0.0, 6.0) as usize;
        return format!("{v:.decimals$}");
    }
    format!("{v:.3e}")
}

pub fn seconds(s: f64) -> String {
    if s < 1.0 { format!("{:.0} ms", 1000.0 * s) } else { format!("{s:.1} s") }
}

pub fn bytes(n: u64) -> String {
    match n {
        0..1024 => format!("{n} B"),
        1024..1_048_576 => format!("{:.1} KiB", n as f64 / 1024.0),
        1_048_576..1_073_741_824 => format!("{:.1} MiB", n as f64 / 1_048_576.0),
        _ => format!("{:.2} GiB", n as f64 / 1_073_741_824.0),
    }
}
