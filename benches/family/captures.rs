//! Real captures, which have no truth: how far the default agrees with what the closed-form methods agree on.

use std::path::Path;

use thirdbounce::job::benchmark::{CLOSED_FORMS, Consensus};
use thirdbounce::maps::Maps;

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
