//! Stiff and extreme cases (METHOD, section 7) against the float64 twins.

mod device;
mod extreme;

use device::{ACCUMULATIONS, assert_valid, gpu};
use extreme::{Case, cases, passes, solve};
use thirdbounce::solve::Accumulation;

#[test]
fn figures() {
    let gpu = gpu();
    for case in cases::all() {
        print!("{:42} {:5} ", case.name, case.active.len());
        for a in ACCUMULATIONS {
            let p = passes(&gpu, &case, a);
            print!("| {a:?} {:.0e} {:.0e} r {:.0e} {:.0e} g {:.0e} ", p.forward.largest, p.forward.histogram, p.residual.largest, p.residual.histogram, p.gradient);
        }
        for n in [10, 60] {
            let [v, o] = solve::state_apart(&solve::on_device(&gpu, &case, Accumulation::Owned, n), &solve::by_twin(&case, n, false));
            print!("| {n}: {v:.0e} {o:.0e} ");
        }
        println!();
    }
    assert_valid(&gpu);
}
