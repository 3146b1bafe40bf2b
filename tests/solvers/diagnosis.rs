//! Verdicts on captures with a fault, made from one without.

use std::ops::ControlFlow;

use fixtures::device::*;
use thirdbounce::capture::Capture;
use thirdbounce::diagnosis::Cause;
use thirdbounce::resolve::Job;
use thirdbounce::settings::{Calibrate, ReflectanceSetting, Settings};
use thirdbounce::simulate::{RenderOptions, Scene, simulate};
use thirdbounce::transport::Reflectance;
use thirdbounce::{Grade, Verdict};

/// A figure before a wall of 32 x 32 points.
fn proper() -> Capture {
    let scene = Scene { scan: 32, bin_width: 0.012, ..Scene::named("figure").unwrap() };
    simulate(&scene, &RenderOptions { noise: 0.05, ..Default::default() }).unwrap().capture
}

/// The verdict of the estimates, and the capture that is solved.
fn judged(capture: &Capture, calibrate: Calibrate) -> (Verdict, Capture) {
    let settings = Settings {
        calibrate: Some(calibrate),
        model: Some(ReflectanceSetting::Known(Reflectance::Lambertian)),
        ..Settings::default()
    };
    let settings = settings.with(|s| s.set("bins", "native").unwrap());
    let job = Job::resolve(&settings, capture, &gpu(), &mut |_| ControlFlow::Continue(())).unwrap();
    (Verdict::clone(&job.verdict), job.capture.into_owned())
}

/// The counts of each column this many bins later.
fn delayed(capture: &Capture, late: impl Fn(usize) -> usize) -> Capture {
    let (bins, [_, ny]) = (capture.bins, capture.scan);
    capture.clone().with(|c| {
        for (pair, row) in c.histograms.chunks_exact_mut(bins).enumerate() {
            row.rotate_right(late(pair / ny));
        }
    })
}

#[test]
fn causes_are_named_and_delays_of_lines_undone() {
    let proper = proper();
    assert_eq!(judged(&proper, Calibrate::Auto).0.grade, Grade::Good);
    // Points in feet.
    let feet = proper.clone().with(|c| {
        c.laser.iter_mut().chain(&mut c.sensor).for_each(|p| *p /= 0.3048);
    });
    let (verdict, _) = judged(&feet, Calibrate::Auto);
    assert!(verdict.grade == Grade::Poor && verdict.reasons[0].contains("0.305 times"), "{verdict}");
    // Delays of the columns, up to 12 cm.
    let late = |column: usize| [0, 7, 3, 9, 1, 5, 10, 2][column * 5 % 8];
    let wrong = delayed(&proper, late);
    let (verdict, kept) = judged(&wrong, Calibrate::None);
    assert!(verdict.grade == Grade::Poor && verdict.reasons[0].contains("columns"), "{verdict}");
    assert!(kept.histograms == wrong.histograms);
    let (verdict, undone) = judged(&wrong, Calibrate::Auto);
    assert!(verdict.grade == Grade::Fair && verdict.reasons[0].contains("undone here"), "{verdict}");
    // But for a delay of all columns.
    let squares = |a: &Capture, b: &Capture| -> f64 {
        a.histograms.iter().zip(&b.histograms).map(|(a, b)| f64::from(a - b).powi(2)).sum()
    };
    let least = (0..12).map(|by| squares(&undone, &delayed(&proper, |_| by))).fold(f64::INFINITY, f64::min);
    assert!(least < 0.1 * squares(&wrong, &proper), "{least}");
    let cause = Cause { what: "feet".into(), hint: "scale".into(), left: [0.9, 0.02], undone: false };
    assert!(cause.sentence().contains("90 % is left beyond noise, 2 % once"));
}
