//! Trials: quick fits, judged by pairs that they have not seen.

use std::ops::ControlFlow;

use fixtures::device::*;
use thirdbounce::gpu::{Faults, Gpu, GpuOptions};
use thirdbounce::solve::vector::{Left, Own, Start, Trial};
use thirdbounce::solve::{Accumulation, Progress, VectorOptions};
use thirdbounce::transport::{Grid, Volume};

use super::session::{frames, scan};

/// Trials of one frame, with the same bits in every run.
fn trial() -> Trial {
    trial_on(&gpu())
}

fn trial_on(gpu: &Gpu) -> Trial {
    let mut capture = scan(12, 0.02);
    capture.histograms = frames(&capture)[0].clone();
    let volume = Volume { min: glam::dvec3(-0.5, -0.5, 0.3), max: glam::dvec3(0.5, 0.5, 1.0) };
    let options = VectorOptions::default().with(|o| {
        o.lateral = 24;
        o.iterations = 8;
        o.surface.iterations = 30;
        o.domain.coarse_iterations = 2;
        o.domain.reduce_every = 2;
        o.bound_every = 4;
        o.accumulation = Accumulation::Repeatable;
        o.stop = false;
    });
    Trial::new(gpu, &capture, Grid::new(volume, 24, 0.02).unwrap(), options, None)
}

/// What a volume leaves after each of these numbers of iterations, up to the `last`th one.
fn left(iterations: &[usize], last: usize) -> Vec<Left> {
    let mut trial = trial();
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    let mut all = vec![];
    let mut judge = |found: Option<Left>| {
        all.extend(found);
        all.len() < last
    };
    trial.fit_volume(None, iterations, &mut unwatched(&mut hear), &mut judge).unwrap();
    all
}

#[test]
fn a_volume_that_goes_on_after_it_was_judged_ends_as_one_in_one_go() {
    let on_the_way = left(&[4, 7, 12], 3);
    let alone = [4, 7, 12].map(|n| left(&[n], 1).remove(0));
    assert_eq!(on_the_way, alone);
    let shares: Vec<f64> = on_the_way.iter().map(Left::share).collect();
    assert!(shares[0] > shares[1] && shares[1] > shares[2], "{shares:?}");
    assert_eq!(left(&[4, 7, 12], 2), on_the_way[..2], "it ends when it is told to");
}

#[test]
fn a_surface_does_not_depend_on_the_judgement_of_the_volume_before_it() {
    let mut trial = trial();
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    let mut fit = |trial: &mut Trial, start| {
        trial.fit(start, None, &mut unwatched(&mut hear)).unwrap().expect("a surface")
    };
    // The first fits a volume and judges it; the second begins with that volume's maps.
    let [first, second] = [(); 2].map(|()| fit(&mut trial, Start::Own));
    assert_eq!(first, second);
    let own = trial.own().expect("a volume of its own").clone();
    assert!(
        own.left.pairs.len() == first.pairs.len() && own.left.share() > first.share(),
        "{own:?} {first:?}"
    );
}

#[test]
fn a_surface_from_a_volume_that_was_kept_has_its_second_layer_and_no_other() {
    let mut hear = |_: &Progress| ControlFlow::Continue(());
    let mut first = trial();
    first.fit(Start::Own, None, &mut unwatched(&mut hear)).unwrap().expect("a surface");
    let kept = first.own().expect("a volume of its own").clone();
    let mut two = kept.clone();
    two.behind = kept.maps.clone();
    two.behind.depth.iter_mut().for_each(|depth| *depth += 0.2);
    let mut on = |poison: f32, own: &Own| {
        let faults = Faults { poison: Some(poison.to_bits()), ..Faults::default() };
        let gpu = Gpu::open(&GpuOptions { faults, ..GpuOptions::default() }).expect("a device");
        let start = Start::Of(Box::new(own.clone()));
        trial_on(&gpu).fit(start, None, &mut unwatched(&mut hear)).unwrap().expect("a surface")
    };
    // What an earlier solve left in the memory may look like a volume.
    let one = on(0.0, &kept);
    assert_eq!(on(1.0, &kept), one);
    assert!(on(1.0, &two) != one, "all of it is twice there");
}
