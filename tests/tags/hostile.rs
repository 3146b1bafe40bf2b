//! Damaged files of time tags: an error or a sound capture, never a panic.

use std::ops::ControlFlow;

use fixtures::files::noise;
use fixtures::tags::every_reader;
use thirdbounce::tags::{self, Asked, Division, Inputs, Scan, Zero};

#[test]
fn damaged_tags_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let scan = Scan::grid([2, 2], 1.0, false).unwrap();
    let inputs = Inputs { sync: 0, markers: vec![100, 101, 102] };
    let usual = Asked { inputs, bin_width: Some(0.1), until: Some(1e-7), ..Asked::default() };
    let divisions = [
        None,
        Some(Division::Pixels { marker: 1, frame: None }),
        Some(Division::Lines { start: 1, stop: Some(2), frame: Some(3) }),
        Some(Division::Pulses { each: 30, before: 10 }),
    ];
    let (mut made, mut refused) = (0, 0);
    for (at, (_, name, good)) in every_reader().into_iter().enumerate() {
        let path = folder.path().join(name);
        let mut noise = noise(at as u64 + 1);
        let mut random = || noise() >> 8;
        // As many as a second or two allow; the first is whole.
        for damage in 0..24 {
            let mut bad = good.clone();
            for _ in 0..damage.min(1 + damage % 4) {
                let place = random() % bad.len();
                bad[place] = random() as u8;
            }
            if damage % 6 == 5 {
                bad.truncate(random() % good.len());
            }
            std::fs::write(&path, &bad).unwrap();
            let division = divisions[damage % divisions.len()].clone();
            let zero = if damage % 8 < 4 { Zero::Direct } else { Zero::At(1e-9) };
            let asked = Asked { division, zero, ..usual.clone() };
            match tags::histogram(&path, &scan, &asked) {
                Ok(whole) => {
                    whole.capture.check().unwrap();
                    made += 1;
                }
                Err(error) => {
                    assert!(!error.what.is_empty() && !error.mend.to_string().is_empty());
                    refused += 1;
                }
            }
            let wait = || ControlFlow::Break(());
            let passed = tags::passes(&path, &scan, &asked, &wait, &mut |_| ControlFlow::Continue(()));
            passed.unwrap_or_else(|error| {
                assert!(!error.what.is_empty() && !error.mend.to_string().is_empty())
            });
        }
    }
    assert!(made > 20 && refused > 20, "{made} made, {refused} refused");
}
