//! The engine never takes its process down: faults of device, memory and disk, killed and cancelled runs, options that make
//! no sense. Each area runs a sample of its cases here, and all of them under `make soak`, which writes the outcome to
//! benches/results/reliability.tsv.

mod budget;
mod canaries;
mod disk;
mod injected;
mod killed;
mod ledger;
mod options;
mod order;
mod paced;
mod small;
mod stability;
mod valid;
#[cfg(unix)]
mod verbs;
mod watch;

use ledger::{Row, assert_held};

/// The share of the cases that run: every Nth.
#[derive(Clone, Copy)]
pub struct Share(pub usize);

impl Share {
    /// Whether case `i` runs. `salt` shifts the choice, so that areas do not all take their first case.
    pub fn takes(self, i: usize, salt: usize) -> bool {
        (i + salt).is_multiple_of(self.0)
    }
}

#[test]
fn failed_calls_of_the_device_are_survived() {
    assert_held(&injected::rows(Share(82)));
}

#[test]
fn failed_files_are_survived() {
    assert_held(&disk::rows(Share(38)));
}

#[test]
fn killed_cancelled_and_rivalling_runs_leave_whole_results() {
    assert_held(&killed::rows(2));
}

#[test]
fn no_option_panics_or_hangs() {
    assert_held(&options::rows(Share(262)));
}

#[test]
fn budgets_and_limits_hold() {
    assert_held(&budget::rows());
}

#[test]
fn poison_order_and_repeats_change_no_bit() {
    assert_held(&order::rows(Share(11)));
}

#[test]
fn the_validation_layer_has_nothing_to_say() {
    assert_held(&valid::rows(Share(7)));
}

#[test]
fn nothing_is_written_past_an_end_and_two_solve_at_once() {
    assert_held(&canaries::rows(Share(5)));
}

#[test]
#[cfg(unix)]
fn every_verb_ends_well_whatever_happens() {
    assert_held(&verbs::rows(Share(11)));
}

/// Asserts that all cases of an area held, and writes them to the page.
fn all_of(area: &str, rows: &[Row]) {
    ledger::write(area, rows);
    assert_held(rows);
}

#[test]
#[ignore = "long: make soak"]
fn all_calls_of_the_device() {
    all_of("Calls of the device that fail", &injected::rows(Share(1)));
}

#[test]
#[ignore = "long: make soak"]
fn all_files() {
    all_of("Files that cannot be written", &disk::rows(Share(1)));
}

#[test]
#[ignore = "long: make soak"]
fn all_ends_of_processes() {
    all_of("Processes killed, interrupted, cancelled, side by side", &killed::rows(12));
}

#[test]
#[ignore = "long: make soak"]
fn all_options() {
    all_of("Options", &options::rows(Share(1)));
}

#[test]
#[cfg(unix)]
#[ignore = "long: make soak"]
fn all_verbs() {
    all_of("Every verb, and containers", &verbs::rows(Share(1)));
}

#[test]
#[ignore = "long: make soak"]
fn all_budgets() {
    all_of("Memory budgets and limits", &budget::rows());
}

#[test]
#[ignore = "long: make soak"]
fn all_orders() {
    all_of("Content of memory, order of work, repeats", &order::rows(Share(1)));
}

#[test]
#[ignore = "long: make soak"]
fn all_validation() {
    all_of("Validation layer", &valid::rows(Share(1)));
}

#[test]
#[ignore = "long: make soak"]
fn all_canaries() {
    all_of("Canaries, two solves at once", &canaries::rows(Share(1)));
}
