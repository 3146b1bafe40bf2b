//! Stiff and extreme cases (METHOD, section 7) against the float64 twins.

mod device;
mod extreme;

use device::{ACCUMULATIONS, assert_valid, gpu};
use extreme::{cases, passes};

#[test]
fn crowded() {
    let gpu = gpu();
    for case in [cases::crowded(32, 64), cases::crowded(64, 64), cases::crowded(100, 100)] {
        for a in ACCUMULATIONS {
            let p = passes(&gpu, &case, a);
            println!("{} {a:?} {:.1e} r {:.1e} g {:.1e}", case.name, p.forward.largest, p.residual.largest, p.gradient);
        }
    }
    assert_valid(&gpu);
}
