//! What plans give to kernels: columns and polished distances by the device, sizes by the pairs.

use fixtures::device::*;
use glam::dvec3;
use thirdbounce::engine::Accumulation;
use thirdbounce::engine::passes::RESIDUAL;
use thirdbounce::gpu::{Abilities, DeviceKind, Limits, Schedule};
use thirdbounce::surface;
use thirdbounce::transport::kernels::*;
use thirdbounce::transport::{Geometry, Model, Reflectance, Wall};
use thirdbounce_verify::place;

/// A card that has no more than Vulkan promises gets narrower columns where a product's arms lie beside them.
#[test]
fn columns_fit_into_the_shared_memory_that_every_device_has() {
    let (base, grid) = (model(5, 64, 3), grid());
    let product = variant(&base, Geometry::Product, Reflectance::Lambertian, true, 7);
    let mut card = Abilities { kind: DeviceKind::Discrete, ..gpu().abilities() };
    card.limits = Limits { shared_memory: 16_384, workgroup_invocations: 128, ..card.limits };
    let tuning = |model: &Model, accumulation, card: &Abilities| {
        let o = FitNeeds::of(&grid, 1).with(|o| o.accumulation = accumulation);
        o.plan(model, grid, [5, 5], card).expect("it fits").division.tuning
    };
    let of = |model| tuning(model, Accumulation::Fixed, &card);
    assert_eq!([of(&base).window, of(&product).window], [64, 28]);
    // Nothing is added to the histograms of other lanes.
    assert_eq!(tuning(&base, Accumulation::Owned, &card).window, 0);
    // Gathers have as many lanes as the device allows.
    assert_eq!(of(&base).voxels * of(&base).slices, 128);
    // What has more keeps the usual columns; what has hardly any adds straight to the histograms.
    for (shared_memory, want) in [(18 << 10, 32), (3 << 10, 0)] {
        let other = Abilities { limits: Limits { shared_memory, ..card.limits }, ..card };
        assert_eq!(tuning(&product, Accumulation::Fixed, &other).window, want);
    }
    // A CPU driver gets the sizes of a GPU that shares the host's memory.
    let [shared, cpu] = [DeviceKind::Integrated, DeviceKind::Cpu].map(|kind| Abilities { kind, ..card });
    assert_eq!(tuning(&base, Accumulation::Fixed, &shared), tuning(&base, Accumulation::Fixed, &cpu));
    assert!(tuning(&base, Accumulation::Fixed, &cpu).fill < of(&base).fill);
}

#[test]
fn a_gpus_distances_are_polished_where_its_root_is_too_rough() {
    let gpu = gpu();
    for (bins, polished, fine) in [(300, false, false), (500, true, false), (700, false, true)] {
        let (model, grid) = (model(5, bins, 9), grid());
        for (kind, asks) in [(DeviceKind::Discrete, polished), (DeviceKind::Cpu, false)] {
            let device = Abilities { kind, ..gpu.abilities() };
            let plan = FitNeeds::of(&grid, 4).plan(&model, grid, [5, 5], &device).unwrap();
            assert_eq!((plan.scene.polished, plan.scene.fine), (asks, fine), "{bins} bins, {kind}");
            assert_eq!(plan.constant(constant::POLISHED), Some(u32::from(asks)));
        }
    }
}

/// Iterations take batches of pairs, judgements all of them: neither may run with the sizes of the other.
#[test]
fn passes_have_the_sizes_of_the_pairs_that_they_take() {
    let (gpu, grid) = (gpu(), oblong());
    let base = model(24, 32, 3);
    let one = Wall { geometry: Geometry::Product, others: vec![dvec3(0.1, 0.0, 0.0)], ..base.wall.clone() };
    for wall in [base.wall.clone(), one] {
        let model = Model { wall, is_spread: true, ..base.clone() };
        let mut job = job(&gpu, &model, &grid, &FitNeeds::of(&grid, 1));
        let (plan, field) = (job.plan.clone(), field(&grid, 61));
        let level = plan.levels.pixels.expect("a surface");
        assert_eq!(plan.levels.batches.len(), 2);
        place(&mut job, &field).expect("uploads run");
        zero_histograms(&mut job);
        let tiles = |pairs: usize| plan.division.tuning.tiles(model.wall.geometry, [pairs, pairs, 1]) as u32;
        let mut sized = |write: &dyn Fn(&mut Schedule)| {
            job.perform(&Schedule::of(write));
            // Residuals empty the rows of the pairs that they compare, and no others.
            assert!(read_rows::<f32>(&mut job, buffer::HISTOGRAMS).iter().all(|v| *v == 0.0));
            read::<u32>(&mut job, buffer::ARGUMENTS, 3 * ARGUMENTS_FORWARD as usize + 1).pop()
        };
        let of_batch = Some(tiles(288));
        assert!(of_batch < Some(tiles(576)));
        assert_eq!(sized(&|s| surface::start_of(s, &plan, &level, field.len(), 1)), of_batch);
        assert_eq!(sized(&|s| surface::iteration(s, &plan, &level, field.len(), [0, 0, 12])), of_batch);
        assert_eq!(sized(&|s| surface::render(s, &plan, &level, field.len(), &RESIDUAL)), of_batch);
        assert_eq!(sized(&|s| surface::iteration(s, &plan, &level, field.len(), [1, 1, 12])), of_batch);
    }
}
