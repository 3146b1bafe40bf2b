//! What plans give to kernels by the device: columns, polished distances.

use fixtures::device::*;
use thirdbounce::Kind;
use thirdbounce::gpu::{Abilities, DeviceKind, Limits};
use thirdbounce::solve::{Accumulation, Plan, Sizes};
use thirdbounce::transport::kernels::constant;
use thirdbounce::transport::{Geometry, Model, Reflectance};

/// A card that has no more than Vulkan promises gets narrower columns where a product's arms lie beside them.
#[test]
fn columns_fit_into_the_shared_memory_that_every_device_has() {
    let (base, grid) = (model(5, 64, 3), grid());
    let product = variant(&base, Geometry::Product, Reflectance::Lambertian, true, 7);
    let mut card = Abilities { kind: DeviceKind::Discrete, ..gpu().abilities() };
    card.limits = Limits { shared_memory: 16_384, workgroup_invocations: 128, ..card.limits };
    let tuning = |model: &Model, sizes: &str, card: &Abilities| {
        let sizes = if sizes.is_empty() { Sizes::default() } else { sizes.parse().expect("sizes") };
        let o = Fit::of(&grid, 1).with(|o| (o.accumulation, o.sizes) = (Accumulation::Cas, sizes));
        Plan::new(model, grid, [5, 5], &o, card, false).map(|plan| plan.division.tuning)
    };
    let window = |model, sizes| tuning(model, sizes, &card).expect("it fits").window;
    assert_eq!([window(&base, ""), window(&base, "lanes=128")], [64, 32]);
    assert_eq!([window(&product, ""), window(&product, "lanes=32")], [28, 32]);
    for (model, sizes) in [(&base, "window=65"), (&product, "window=29"), (&base, "lanes=129")] {
        let error = tuning(model, sizes, &card).expect_err("asked for more than there is");
        assert!(error.what.contains(sizes) && error.kind == Kind::Options, "{error}");
    }
    // Gathers have as many lanes as the device allows.
    let fitted = tuning(&base, "", &card).expect("it fits");
    assert_eq!(fitted.voxels * fitted.slices, 128);
    // What has more keeps the usual columns; what has hardly any adds straight to the histograms.
    for (shared_memory, want) in [(18 << 10, 32), (3 << 10, 0)] {
        let other = Abilities { limits: Limits { shared_memory, ..card.limits }, ..card };
        assert_eq!(tuning(&product, "", &other).expect("it fits").window, want);
    }
}

#[test]
fn a_gpus_distances_are_polished_where_its_root_is_too_rough() {
    let gpu = gpu();
    for (bins, polished, fine) in [(300, false, false), (500, true, false), (700, false, true)] {
        let (model, grid) = (model(5, bins, 9), grid());
        for (kind, asks) in [(DeviceKind::Discrete, polished), (DeviceKind::Cpu, false)] {
            let device = Abilities { kind, ..gpu.abilities() };
            let plan = Plan::new(&model, grid, [5, 5], &Fit::of(&grid, 4), &device, false).unwrap();
            assert_eq!((plan.scene.polished, plan.scene.fine), (asks, fine), "{bins} bins, {kind}");
            assert_eq!(plan.constant(constant::POLISHED), Some(u32::from(asks)));
        }
    }
}
