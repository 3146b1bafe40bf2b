//! The compiled modules: what they count, declare and bind, and what the device makes of them.

use std::sync::Mutex;

use super::{KERNELS, buffer, kernel};
use crate::gpu::spirv::{Counts, count_loop, extended};
use crate::gpu::{
    Arena, Buffer, BufferPlan, Executor, Faults, Gpu, GpuOptions, Guarded, Kernel, KernelCode, MOST_STORAGE,
    Overrun, Place, Point, Schedule, View, to_nearest,
};

fn of(name: &str, constants: &[(&str, u32)]) -> Counts {
    let code = KERNELS.iter().find(|k| k.name == name).expect("a kernel of the table");
    count_loop(code, constants).expect("a loop over pairs or voxels")[0]
}

#[test]
fn a_product_finds_the_scanned_points_arm_once_for_several_pairs() {
    for (name, constants) in [
        ("forward_product_owned", &[("OTHERS", 4), ("SHARED", 0), ("TOUCHING", 0)][..]),
        ("forward_product_float", &[("OTHERS", 4), ("TOUCHING", 0)]),
        ("surface_gather", &[("OTHERS", 4), ("GEOMETRY", 2), ("TOUCHING", 0)]),
        ("backproject", &[("OTHERS", 4), ("GEOMETRY", 2), ("TOUCHING", 0)]),
    ] {
        let code = KERNELS.iter().find(|k| k.name == name).expect("a kernel of the table");
        let [pair, shared] = count_loop(code, constants).expect("a loop over the other points");
        println!("{name}: {pair:?}, shared {shared:?}");
        assert_eq!(shared.special, 1, "{name}: one root for the arm");
        assert!(shared.fma >= 7 && shared.broadcasts >= 3, "{name}: {shared:?}");
        assert_eq!((shared.atomics, shared.stores, shared.loads), (0, 0, 0), "{name}: bins are a pair's own");
        assert!(pair.issued() > 20, "{name}: {pair:?}");
    }
    // A loop by itself shares nothing.
    let code = KERNELS.iter().find(|k| k.name == "backward").expect("a kernel of the table");
    assert_eq!(count_loop(code, &[("SLICES", 1)]).expect("a loop over pairs")[1], Counts::default());
}

#[test]
fn the_passes_count_as_they_are_written() {
    let forward = of("forward_owned", &[("SPLIT", 0)]);
    assert_eq!((forward.special, forward.atomics), (1, 0), "{forward:?}: one root, plain adds");
    assert_eq!((forward.loads, forward.stores), (1, 1), "{forward:?}: one bin is read and written");
    assert!(forward.broadcasts >= 7, "{forward:?}: all lanes read the same sample");
    let split = of("forward_owned", &[("SPLIT", 1)]);
    assert_eq!((split.loads, split.stores), (2, 2), "{split:?}: two bins");
    assert_eq!(of("forward_float", &[("SPLIT", 1)]).atomics, 2);
    assert_eq!(of("forward_float", &[("SPLIT", 0)]).atomics, 1);
    let lambertian = of("forward_owned", &[("SPLIT", 0), ("REFLECTANCE", 1)]);
    assert!(
        lambertian.special == 1 && lambertian.fma > forward.fma,
        "{lambertian:?}: a cosine more, and no root"
    );
    let published = of("backward", &[("SPLIT", 0), ("EXACT", 0)]);
    let exact = of("backward", &[("SPLIT", 0), ("EXACT", 1)]);
    assert!(exact.fma > published.fma, "the falloff costs: {published:?} {exact:?}");
    assert_eq!(
        (published.stores, published.atomics, published.special),
        (0, 0, 1),
        "{published:?}: a gather"
    );
    // Slices sum in a loop of their own, which is not the one over pairs.
    assert_eq!(of("backward", &[("SPLIT", 0), ("EXACT", 0), ("SLICES", 4)]).special, 1);
}

/// Variants of the notes' table, with the most issue slots that a pair may take: a change that adds some says so here.
/// `cargo test kernels::tests -- --nocapture` prints the table.
#[test]
fn a_pair_takes_no_more_than_it_did() {
    let (near, linear) = (("SPLIT", 0), ("SPLIT", 1));
    let apart = ("TOUCHING", 0);
    let lambertian = ("REFLECTANCE", 1);
    let two = ("GEOMETRY", 1);
    let product = ("GEOMETRY", 2);
    type Row<'a> = (&'a str, &'a [(&'a str, u32)], u32);
    let table: &[Row] = &[
        ("forward_owned", &[near, apart], 40),
        ("forward_owned", &[linear, apart], 49),
        ("forward_owned", &[linear, apart, lambertian], 60),
        ("forward_owned_texels", &[near, apart], 37),
        ("forward_owned_texels", &[linear, apart], 45),
        ("backward_texels", &[near, apart], 30),
        ("surface_gather_texels", &[apart], 61),
        ("forward_float", &[near, apart], 42),
        ("forward_float", &[linear, apart], 49),
        ("forward_float", &[linear], 52),
        ("forward_float", &[linear, apart, two], 62),
        ("forward_float", &[linear, apart, ("FINE", 1)], 109),
        ("forward_fixed64", &[near, apart], 46),
        ("forward_fixed32", &[near, apart], 68),
        ("forward_cas", &[near, apart], 45),
        ("forward_product_owned", &[linear, apart, ("OTHERS", 4), ("SHARED", 0)], 44),
        ("forward_product_float", &[linear, apart, ("OTHERS", 4)], 31),
        ("backward", &[near, apart, ("EXACT", 0)], 32),
        ("backward", &[linear, apart, ("EXACT", 0)], 39),
        ("backward", &[linear, apart, ("EXACT", 1)], 43),
        ("surface_gather", &[apart], 64),
        ("surface_gather", &[apart, lambertian], 92),
        ("surface_gather", &[], 67),
        ("surface_gather", &[apart, two], 82),
        ("surface_gather", &[apart, product, ("OTHERS", 4)], 43),
        ("backproject", &[apart], 33),
    ];
    let over = table.iter().filter(|(name, constants, most)| {
        let c = of(name, constants);
        let numbers =
            [c.fma, c.special, c.other, c.conversions, c.loads, c.broadcasts, c.stores, c.shared, c.atomics];
        println!("| {name} {constants:?} | {numbers:?} | {} | {} |", c.issued(), c.bytes);
        c.issued() > *most
    });
    assert_eq!(over.count(), 0);
}

/// GLSL's own clamp may let what is not a number pass, and its bits would become an address.
#[test]
fn a_place_is_within_its_row_whatever_the_path() {
    const N_CLAMP: u32 = 81;
    let finds = ["forward", "backward", "backproject", "surface_gather", "places"];
    for code in KERNELS.iter().filter(|k| finds.iter().any(|name| k.name.starts_with(name))) {
        for value in [0, 1] {
            let found = extended(code, &[("FINE", value)]).expect("a whole module");
            assert!(code.constants.iter().any(|c| c.0.name() == "FINE"), "a constant of place.glsl");
            assert!(found.contains(&N_CLAMP), "{} fine {value}", code.name);
        }
    }
}

/// Vulkan promises 128 invocations. Kernels whose sizes a plan chooses begin with small ones, too.
#[test]
fn every_workgroup_has_a_size_that_every_device_takes() {
    const EXECUTION_MODE: u32 = 16;
    const LOCAL_SIZE: u32 = 17;
    for code in KERNELS {
        let words: Vec<u32> =
            code.spirv.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let mut at = 5;
        let mut sizes = vec![];
        while at < words.len() {
            if words[at] & 0xffff == EXECUTION_MODE && words[at + 2] == LOCAL_SIZE {
                sizes.push(words[at + 3..at + 6].iter().product::<u32>());
            }
            at += (words[at] >> 16) as usize;
        }
        assert!(sizes.len() == 1 && sizes[0] <= 128, "{}: {sizes:?}", code.name);
    }
}

#[test]
fn limits_count_what_they_say() {
    let fma = of("limit_fma", &[]);
    assert_eq!((fma.fma, fma.special, fma.loads), (32, 0, 0), "{fma:?}");
    assert_eq!(of("limit_special", &[]).special, 8);
    let load = of("limit_load", &[]);
    assert_eq!((load.loads, load.broadcasts), (4, 0), "{load:?}");
    assert_eq!(of("limit_shared_atomic", &[]).shared_atomics, 4);
    assert_eq!(of("limit_global_atomic", &[]).atomics, 4);
    assert_eq!(of("limit_global_atomic_float", &[]).atomics, 4);
    assert_eq!(of("limit_scattered_atomic", &[]).atomics, 4);
}

#[test]
fn every_module_declares_rounding_once_and_keeps_the_rest() {
    const CAPABILITY: u32 = 17;
    const EXECUTION_MODE: u32 = 16;
    const CAN_ROUND_TO_NEAREST: u32 = 4467;
    const ROUND_TO_NEAREST: u32 = 4462;
    for code in KERNELS {
        let words: Vec<u32> =
            code.spirv.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let with = to_nearest(&words);
        assert_eq!(with.len(), words.len() + 6, "{}: one entry point", code.name);
        assert_eq!(with[5..7], [2 << 16 | CAPABILITY, CAN_ROUND_TO_NEAREST]);
        let at = with.windows(2).position(|w| w == [ROUND_TO_NEAREST, 32]).expect("the mode");
        assert_eq!(with[at - 2], 4 << 16 | EXECUTION_MODE, "{}", code.name);
        let rest = [&with[..5], &with[7..at - 2], &with[at + 2..]].concat();
        assert_eq!(rest, words, "{}", code.name);
    }
}

#[test]
fn a_device_binds_what_the_largest_kernel_binds() {
    let of = |k: &KernelCode, view: &dyn Fn(View) -> bool| k.bindings.iter().filter(|b| view(b.view)).count();
    let storage = KERNELS.iter().map(|k| of(k, &|view| view == View::Storage)).max();
    assert_eq!(storage, Some(MOST_STORAGE as usize));
    // Storage texel buffers, of which Vulkan promises four, and uniform buffers.
    assert!(KERNELS.iter().all(|k| of(k, &|view| matches!(view, View::Texels { .. })) <= 4));
    // The scene, and the block of a solver.
    assert!(KERNELS.iter().all(|k| of(k, &|view| view == View::Uniform) <= 2));
}

#[test]
fn a_kernel_compiles_without_buffers() {
    let options = GpuOptions { statistics: true, ..GpuOptions::default() };
    let gpu = Gpu::open(&options).expect("a Vulkan device: `make setup` installs lavapipe");
    let compiled = gpu.compile(&kernel::FORWARD_OWNED, &kernel::FORWARD_OWNED, &[]).unwrap();
    assert!(compiled.seconds > 0.0 && gpu.allocated() == 0);
    assert_eq!(compiled.executables.is_empty(), !gpu.tells_of_kernels());
}

const BACK: Buffer = Buffer::named("back");

#[test]
fn labels_balance_under_validation_and_times_are_in_order() {
    let open = |validation| Gpu::open(&GpuOptions { validation, timings: true, ..GpuOptions::default() });
    let gpu = open(true).or_else(|_| open(false)).expect("a Vulkan device: `make setup` installs lavapipe");
    let buffers =
        [BufferPlan::new(buffer::RESULT, 4, Place::Device), BufferPlan::new(BACK, 4, Place::Readback)];
    let mut executor = Executor::new(&gpu, Arena::new(&gpu, &buffers, None).unwrap()).unwrap();
    executor.add_kernel(Kernel::named("count"), &kernel::LIMIT_EMPTY, &[]).unwrap();
    let mut s = Schedule::default();
    s.fill(buffer::RESULT, 4, 0);
    s.stage("first", &[("iteration", 1)]);
    s.dispatch(Kernel::named("count"), [1, 1, 1], 1).with([1u32, 0, 0, 0]);
    s.stage("second", &[]);
    s.dispatch(Kernel::named("count"), [1, 1, 1], 1).with([2u32, 0, 0, 0]);
    s.dispatch(Kernel::named("count"), [1, 1, 1], 1).with([3u32, 0, 0, 0]);
    s.copy(buffer::RESULT, BACK, 4);
    executor.run(&s).unwrap();
    let counted = executor.read::<u32>(BACK, ..)[0];
    let (told, messages) = (gpu.take_recording(), gpu.validation_messages());
    assert!(messages.is_empty(), "{messages:?}");
    assert_eq!(counted, 6);
    let kernels: Vec<_> = told.device.iter().map(|r| r.kernel).collect();
    assert_eq!(kernels, ["fill", "count", "count", "count", "copy"]);
    let stages: Vec<_> = told.device.iter().map(|r| r.stage.map(|s| told.stages[s].name)).collect();
    assert_eq!(stages, [None, Some("first"), Some("second"), Some("second"), Some("second")]);
    assert!(told.device.windows(2).all(|w| w[0].from <= w[0].to && w[0].to <= w[1].from), "{told:?}");
    // All of it while the host was waiting, as far as the clocks agree.
    let spans = |what| told.host.iter().filter(move |s| s.what == what);
    let (submit, wait) = (spans("submit").next_back().unwrap(), spans("wait").next_back().unwrap());
    assert!(told.device[0].from >= submit.from - 1e-3 && told.device[4].to <= wait.to + 1e-6, "{told:?}");
    assert!(told.kernels["count"].code.name == "limit_empty");
}

const DOWN: Buffer = Buffer::named("down");

/// Runs a kernel that writes a word per invocation, in `groups` workgroups of 64.
fn run(gpu: &Gpu, bound: Buffer, groups: u32) {
    let plan = [
        BufferPlan::new(buffer::RESULT, 3 << 20, Place::Device),
        BufferPlan::new(DOWN, 256, Place::Readback),
    ];
    // The budget counts planned bytes, not canaries.
    let arena = Arena::new(gpu, &plan, Some(8 << 20)).unwrap();
    let mut executor = Executor::new(gpu, arena).unwrap();
    executor.add_kernel(&kernel::LIMIT_FMA, &kernel::LIMIT_FMA, &[]).unwrap();
    let mut s = Schedule::default();
    s.dispatch(&kernel::LIMIT_FMA, [groups, 1, 1], 64).bind(buffer::RESULT, bound).with([1u32, 0, 0]);
    executor.run(&s).unwrap();
}

fn open(options: &GpuOptions) -> Gpu {
    Gpu::open(options).expect("a Vulkan device and the validation layer: `make setup` installs both")
}

/// Checks the canaries after such a kernel.
fn seen(bound: Buffer, groups: u32) -> Guarded {
    let faults = Faults { guard: true, ..Faults::default() };
    let gpu = open(&GpuOptions { faults, ..GpuOptions::default() });
    run(&gpu, bound, groups);
    assert_eq!(gpu.allocated(), 0);
    gpu.take_guarded()
}

#[test]
fn a_kernel_that_writes_past_an_end_is_found_by_buffer_and_place() {
    let fit = (3 << 20) / 256;
    for (buffer, bytes, groups) in [(buffer::RESULT, 3 << 20, fit), (DOWN, 256, 1)] {
        assert_eq!(seen(buffer, groups), Guarded { buffers: 3, overruns: vec![] });
        let overruns = vec![Overrun { buffer, bytes, at: bytes }];
        assert_eq!(seen(buffer, groups + 1), Guarded { buffers: 3, overruns });
    }
    assert_eq!(open(&GpuOptions::default()).take_guarded(), Guarded::default());
}

#[test]
fn executors_share_their_kernels() {
    let gpu =
        open(&GpuOptions { faults: Faults { guard: true, ..Faults::default() }, ..GpuOptions::default() });
    // A pipeline is a layout of its set, a module and itself.
    let made = |constants: &[_], executors: &mut Vec<Executor>| {
        let arena = Arena::new(&gpu, &[BufferPlan::new(DOWN, 256, Place::Readback)], None).unwrap();
        let mut executor = Executor::new(&gpu, arena).unwrap();
        let before = gpu.reached(Point::Object);
        executor.add_kernel(&kernel::CARRY, &kernel::CARRY, constants).unwrap();
        executors.push(executor);
        gpu.reached(Point::Object) - before
    };
    let mut executors = vec![];
    let constant = kernel::CARRY.constants[0].0;
    assert_eq!(made(&[], &mut executors), 3);
    assert_eq!(made(&[], &mut executors), 0);
    assert_eq!(made(&[(constant, 3)], &mut executors), 3, "other constants, another pipeline");
    executors.clear();
    assert_eq!(made(&[(constant, 3)], &mut executors), 0, "it stays for who comes later");
}

/// Held by who opens a device under the validation layer: the layer's own map of devices takes no lock.
pub(crate) static UNDER_THE_LAYER: Mutex<()> = Mutex::new(());

#[test]
fn an_instrumented_kernel_tells_of_it() {
    let _alone = UNDER_THE_LAYER.lock();
    let messages = |groups| {
        let gpu = open(&GpuOptions { instrumented: true, ..GpuOptions::default() });
        run(&gpu, DOWN, groups);
        gpu.close()
    };
    assert_eq!(messages(1), Vec::<String>::new());
    let told = messages(2).join("\n");
    assert!(told.contains("out of bounds"), "{told}");
}
