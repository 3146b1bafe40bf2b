//! The table of passes and tests: every pass has a twin and a test against it, or its row says why not.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use thirdbounce::job::profile::check::CHECKS;
use thirdbounce::solve::closed_form::passes::{BACKPROJECT, FILTER};
use thirdbounce::solve::paper::passes::*;
use thirdbounce::solve::passes::*;
use thirdbounce::solve::surface::passes::*;
use thirdbounce::solve::{PASSES, Pass, Twin};

use crate::{backproject, domain, forward, paper as of_paper, surface, surface_gather};

/// Passes, and the tests that compare them with their twins.
macro_rules! held {
    ($($($pass:path),+ => $test:path;)*) => {
        &[$((&[$(&$pass),+], $test)),*]
    };
}

/// Passes, and a test that holds them.
type Held = (&'static [&'static Pass], fn());

/// Passes that tests hold, in addition to those that `thirdbounce profile --check` holds on a user's device
/// ([`CHECKS`]).
static HELD: &[Held] = held! {
    SAMPLE => of_paper::sample;
    FORWARD => of_paper::forward_on_every_accumulation_path;
    FORWARD, BACKWARD => of_paper::forward_and_backward_of_every_model_pair_and_wall;
    RESIDUAL => of_paper::residual_with_and_without_noise_term;
    NOISE => of_paper::noise_learns_as_its_twin;
    BACKWARD => of_paper::backward_published_and_exact;
    UPDATE => of_paper::update_continuous_and_fixed;
    FINISH => of_paper::finish_sums_and_resets;
    INITIALISE, INITIALISE_RAW => domain::initialise_is_uniform_and_keeps_the_near_space_out;
    GAUSSIAN_X, GAUSSIAN_Y, GAUSSIAN_Z, THRESHOLD, CARRY
        => domain::reduction_smooths_and_keeps_what_is_above_the_threshold;
    COMPACT_COUNT, COMPACT_SCAN_ACTIVE, COMPACT_SCATTER_ACTIVE, RIM, COMPACT_SCAN_RIM, COMPACT_SCATTER_RIM
        => domain::compaction_lists_every_active_voxel_in_brick_order;
    DOUBLE_DOMAIN, CARRY_DOUBLED => domain::doubling_interpolates_the_volume_and_splits_every_voxel;
    EXTRACT => domain::extract_finds_the_brightest_voxel_of_every_column;
    LEVELS_OF, ROOM => domain::a_domain_beyond_its_room_keeps_the_brightest;
    FILTER, BACKPROJECT => backproject::filter_and_backproject;
    FORWARD, RESIDUAL => forward::forward_and_weighted_residual_on_every_accumulation_path;
    RESIDUAL_ROWS => forward::forward_and_high_pass_residual_on_every_accumulation_path;
    PULSE, PULSE_BACK => forward::forward_and_weighted_residual_through_a_pulse;
    SPOT, SPOT_MORE, SPOT_BACK => forward::forward_and_weighted_residual_through_spots;
    SURFACE_BONDS, SURFACE_POINTS => surface::bonds_and_points;
    SURFACE_GATHER => surface_gather::gather_of_every_model_pair_and_wall;
    SURFACE_COMBINE => surface::combine;
    SURFACE_PULL, SURFACE_STEP => surface::several_steps;
    FINISH, RESIDUAL => surface::iterations_in_a_row;
    SURFACE_EXTRACT => surface::extract;
};

#[test]
fn every_pass_has_a_twin_and_a_test_against_it() {
    let named: Vec<&Pass> = HELD.iter().flat_map(|(passes, _)| passes.iter().copied()).collect();
    let checked: Vec<&Pass> = CHECKS.iter().flat_map(|check| check.holds.iter().copied()).collect();
    let sources = sources();
    for pass in PASSES.iter().copied().flatten().copied() {
        let is_held = named.iter().chain(&checked).any(|p| std::ptr::eq(*p, pass));
        match pass.twin {
            Twin::Function(twin) => {
                assert!(is_held, "{pass:?} is held by no test: add it to HELD in tests/kernels/held.rs");
                let call = format!("twin::{twin}(");
                assert!(sources.iter().any(|s| s.contains(&call)), "no test calls {call}..)");
            }
            Twin::None(why) => assert!(why.len() > 30, "{pass:?} has no twin: its row must say why"),
        }
    }
    // The tests differ: a table that repeats one test would hold nothing.
    let tests: BTreeSet<usize> = HELD.iter().map(|(_, test)| *test as usize).collect();
    assert!(tests.len() > 20, "{}", tests.len());
}

/// The sources of the tests that compare with twins.
fn sources() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders: Vec<PathBuf> =
        ["tests/kernels", "tests/fixtures/src/device", "src/job/profile/check"].map(|f| root.join(f)).into();
    let mut all = vec![];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            match path.is_dir() {
                true => folders.push(path),
                false => all.push(std::fs::read_to_string(path).expect("a source")),
            }
        }
    }
    all
}
