//! Real captures, which have no truth: how far the default agrees with what the closed-form methods agree on.

use std::path::Path;

use thirdbounce::maps::{Maps, percentile};

use super::sheet::Sheet;
use super::{Arguments, Run, read_run};

/// Name, file below THIRDBOUNCE_DATA, what the file lacks, and whether it is judged.
const ALL: [(&str, &str, &[&str], bool); 8] = [
    ("T X", "tx_captured_confocal_51.npz", &[], true),
    ("diffuse S", "diffuse_s_confocal_64.npz", &[], true),
    ("exit sign", "native/lct_data_exit_sign.mat", &[], true),
    ("S U", "su_confocal_64.npz", &[], true),
    ("statue", "statue_confocal_64.npz", &[], true),
    ("captured Z", "z_captured_confocal_64.npz", &[], true),
    ("figure 4", "native/ccsocr_figure4", &["--wall", "1.26", "--bin-width", "0.0048"], true),
    ("mannequin over 1.43 km", "native/km_mannequin.mat", &[], false),
];

/// Simulated by others, without truth.
const OTHERS: [(&str, &str, &[&str], bool); 1] =
    [("U, one sensor point", "sim_U_nonconfocal_64.npz", &[], true)];

const CLOSED_FORMS: [&str; 4] = ["lct", "fk", "phasor", "fbp"];

/// Light farther than this from the consensus is beside it, in 64ths of the picture.
const NEAR: f64 = 3.0;

/// What several maps show alike, over the extent and by the pixels of the first.
struct Consensus {
    /// The first map, with the consensus as mask.
    maps: Maps,
}

pub fn all(arguments: &Arguments, data: &Path, sheet: &mut Sheet) {
    println!(
        "\nAgreement: IoU of the own mask with the consensus of the closed forms, for each of those with the others'."
    );
    println!(
        "| capture | chosen model | agreement | light beside | seconds (trials) | CPU s | {} |",
        CLOSED_FORMS.join(" | ")
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let mut judged = vec![];
    for (name, file, options, counts) in ALL.iter().chain(&OTHERS) {
        let path = data.join(file);
        let run = arguments.reconstruct(&path, options);
        let closed = closed_forms(arguments, name, &path, options);
        let shown: Vec<Option<&Maps>> = closed.iter().map(|run| run.as_ref().map(|run| &run.maps)).collect();
        let maps: Vec<&Maps> = shown.iter().copied().flatten().collect();
        let ours = Consensus::of(&maps).zip(run.as_ref()).map_or([0.0, 1.0], |(consensus, run)| {
            [consensus.agreement(&run.maps), consensus.beside(&run.maps)]
        });
        let mut theirs: Vec<f64> = vec![];
        let cells: Vec<String> = closed
            .iter()
            .map(|run| {
                let Some(run) = run else { return "–".into() };
                let others: Vec<&Maps> =
                    maps.iter().copied().filter(|m| !std::ptr::eq(*m, &raw const run.maps)).collect();
                let agreement = Consensus::of(&others).map_or(0.0, |c| c.agreement(&run.maps));
                theirs.push(agreement);
                format!("{agreement:.2}, {:.1} s", run.seconds())
            })
            .collect();
        println!(
            "| {name} | {} | {:.2} | {:.2} | {:.1} ({:.1}) | {:.1} | {} |",
            run.as_ref().map_or("failed", Run::model),
            ours[0],
            ours[1],
            run.as_ref().map_or(0.0, Run::seconds),
            run.as_ref().map_or(0.0, Run::trials),
            run.as_ref().map_or(0.0, |run| run.cpu),
            cells.join(" | ")
        );
        theirs.sort_by(|a, b| b.total_cmp(a));
        if *counts {
            judged.push([ours[0], ours[1], theirs.get(1).copied().unwrap_or(0.0)]);
        }
        sheet.captured(name, run.as_ref().map(|run| &run.maps), &CLOSED_FORMS, &shown);
    }
    let mean = |k: usize| judged.iter().map(|j| j[k]).sum::<f64>() / judged.len().max(1) as f64;
    let as_good = judged.iter().filter(|j| j[0] >= j[2]).count();
    let clean = judged.iter().filter(|j| j[1] <= 0.08).count();
    println!(
        "\nOf {} judged: mean agreement {:.3}, light beside {:.3}; {as_good} agree as well as the second best closed form \
         (mean {:.3}), {clean} have at most .08 of their light beside.",
        judged.len(),
        mean(0),
        mean(1),
        mean(2)
    );
}

/// Results of the closed-form methods, `None` for one that refuses the capture.
fn closed_forms(arguments: &Arguments, name: &str, capture: &Path, options: &[&str]) -> [Option<Run>; 4] {
    CLOSED_FORMS.map(|method| {
        let folder = arguments.keep.join(format!("closed/{}/{method}", name.replace(' ', "-")));
        let again = || arguments.run(capture, &folder, &[options, &["--solver", method]].concat());
        read_run(&folder).or_else(again)
    })
}

impl Consensus {
    /// The mean of the albedo maps, each over its 99.5th percentile, above Otsu's threshold. `None` without maps.
    fn of(all: &[&Maps]) -> Option<Consensus> {
        let mut maps = Maps::clone(all.first()?);
        let white = |m: &Maps| percentile(&m.albedo, 99.5).unwrap_or(0.0).max(f32::MIN_POSITIVE);
        let whites: Vec<f32> = all.iter().map(|m| white(m)).collect();
        maps.albedo = centres(&maps)
            .map(|[x, y]| {
                let at = |m: &Maps| m.pixel_at(x, y).map_or(0.0, |p| m.albedo[p]);
                let each = all.iter().zip(&whites).map(|(m, white)| (at(m) / white).clamp(0.0, 1.0));
                each.sum::<f32>() / all.len() as f32
            })
            .collect();
        let threshold = otsu(&maps.albedo);
        maps.mask = maps.albedo.iter().map(|a| *a > threshold).collect();
        Some(Consensus { maps })
    }

    /// Intersection over union of a mask with the consensus, which is dark beyond its extent.
    fn agreement(&self, other: &Maps) -> f64 {
        let (mut both, mut either) = (0.0, 0.0);
        for (pixel, [x, y]) in centres(&self.maps).enumerate() {
            let (here, there) = (self.maps.mask[pixel], other.pixel_at(x, y).is_some_and(|p| other.mask[p]));
            both += f64::from(u8::from(here && there));
            either += f64::from(u8::from(here || there));
        }
        let beyond =
            |(pixel, [x, y]): (usize, [f64; 2])| other.mask[pixel] && self.maps.pixel_at(x, y).is_none();
        let outside = centres(other).enumerate().filter(|at| beyond(*at)).count();
        both / (either + outside as f64 * area(other) / area(&self.maps)).max(1.0)
    }

    /// Share of a mask's albedo that is not near the consensus; 1 without any.
    fn beside(&self, other: &Maps) -> f64 {
        let [x0, x1, ..] = self.maps.extent;
        let near = NEAR * (x1 - x0) / 64.0;
        let bright: Vec<[f64; 2]> =
            centres(&self.maps).zip(&self.maps.mask).filter(|(_, mask)| **mask).map(|(at, _)| at).collect();
        let (mut all, mut beside) = (0.0, 0.0);
        for (pixel, [x, y]) in centres(other).enumerate().filter(|(pixel, _)| other.mask[*pixel]) {
            let light = f64::from(other.albedo[pixel]);
            all += light;
            if !bright.iter().any(|[u, v]| (u - x).hypot(v - y) <= near) {
                beside += light;
            }
        }
        if all > 0.0 { beside / all } else { 1.0 }
    }
}

/// Centres of all pixels, in the order of maps.
fn centres(maps: &Maps) -> impl Iterator<Item = [f64; 2]> + '_ {
    (0..maps.nx * maps.ny).map(|i| maps.centre(i / maps.ny, i % maps.ny))
}

/// Area of a pixel.
fn area(maps: &Maps) -> f64 {
    let [x0, x1, y0, y1] = maps.extent;
    (x1 - x0) * (y1 - y0) / (maps.nx * maps.ny) as f64
}

/// The threshold between two classes of values from 0 to 1 that are farthest apart (Otsu 1979).
fn otsu(values: &[f32]) -> f32 {
    const STEPS: usize = 256;
    let step = |i: usize| (i as f64 + 0.5) / STEPS as f64;
    let mut counts = [0.0; STEPS];
    values.iter().for_each(|v| counts[((v * STEPS as f32) as usize).min(STEPS - 1)] += 1.0);
    let total: f64 = counts.iter().sum();
    let sum: f64 = counts.iter().enumerate().map(|(i, c)| c * step(i)).sum();
    let (mut below, mut sum_below, mut best) = (0.0, 0.0, (0.0, 0));
    for (i, count) in counts.iter().enumerate() {
        below += count;
        sum_below += count * step(i);
        let above = total - below;
        let apart = below * above * (sum_below / below - (sum - sum_below) / above).powi(2);
        if apart > best.0 {
            best = (apart, i + 1);
        }
    }
    best.1 as f32 / STEPS as f32
}
