//! An engine that never takes its process down: faults of device, memory and disk, killed and cancelled runs, options
//! that make no sense. Each area runs a sample of its cases here and all of them under `make soak`, where
//! docs/reliability.md is written from what happened.

mod budget;
mod disk;
mod injected;
mod killed;
mod ledger;
mod options;
mod order;
mod resumed;
mod small;
mod valid;

use ledger::{Row, assert_held};

/// Which of the cases run: every so-manieth.
#[derive(Clone, Copy)]
pub struct Share(pub usize);

impl Share {
    /// Whether case `i` is among them; `salt` moves the choice, so that areas do not all take their first.
    pub fn takes(self, i: usize, salt: usize) -> bool {
        (i + salt).is_multiple_of(self.0)
    }
}

#[test]
fn failed_calls_of_the_device_are_survived() {
    assert_held(&injected::rows(Share(41)));
}

#[test]
fn failed_files_are_survived() {
    assert_held(&disk::rows(Share(19)));
}

#[test]
fn killed_cancelled_and_rivalling_runs_leave_whole_results() {
    assert_held(&killed::rows(2));
}

#[test]
fn a_resumed_solve_gives_the_same_bits() {
    assert_held(&resumed::rows(Share(9)));
}

#[test]
fn no_option_panics_or_hangs() {
    assert_held(&options::rows(Share(131)));
}

#[test]
fn budgets_and_limits_hold() {
    assert_held(&budget::rows());
}

#[test]
fn poison_order_and_repeats_change_no_bit() {
    assert_held(&order::rows(Share(6)));
}

#[test]
fn the_validation_layer_has_nothing_to_say() {
    assert_held(&valid::rows(Share(7)));
}

/// All cases of an area.
type Area = fn() -> Vec<Row>;

/// All cases of all areas; writes docs/reliability.md.
#[test]
#[ignore = "long: make soak"]
fn everything_holds_and_the_table_is_written() {
    let areas: [(&str, Area); 8] = [
        ("calls of the device", || injected::rows(Share(1))),
        ("files", || disk::rows(Share(1))),
        ("processes", || killed::rows(12)),
        ("checkpoints", || resumed::rows(Share(1))),
        ("options", || options::rows(Share(1))),
        ("memory and limits", budget::rows),
        ("memory content, order, repeats", || order::rows(Share(1))),
        ("validation", || valid::rows(Share(1))),
    ];
    let done: Vec<(&str, Vec<Row>, f64)> = areas
        .iter()
        .map(|(name, rows)| {
            let start = std::time::Instant::now();
            let rows = rows();
            let seconds = start.elapsed().as_secs_f64();
            println!("{name}: {seconds:.0} s");
            (*name, rows, seconds)
        })
        .collect();
    ledger::write(&done);
    done.iter().for_each(|(_, rows, _)| assert_held(rows));
}
