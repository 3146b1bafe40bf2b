//! The compiled modules: what they count, declare and bind, and what the device makes of them.

use super::{KERNELS, buffer, kernel};
use crate::gpu::{
    Arena, Buffer, BufferPlan, Executor, Faults, Gpu, GpuOptions, Guarded, Kernel, KernelCode, MOST_STORAGE,
    Overrun, Place, Point, Schedule, View, to_nearest,
};

/// The words of a module.
pub fn words(code: &KernelCode) -> Vec<u32> {
    code.spirv.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// GLSL's own clamp may let NaN pass, and its bits would become an address.
#[test]
fn a_place_is_clamped_to_its_row_whatever_the_path() {
    const EXT_INST: u32 = 12;
    const N_CLAMP: u32 = 81;
    let finds = ["forward", "backward", "backproject", "surface_gather", "places"];
    for code in KERNELS.iter().filter(|k| finds.iter().any(|name| k.name.starts_with(name))) {
        let words = words(code);
        let mut at = 5;
        let mut clamps = 0;
        while at < words.len() {
            clamps += usize::from(words[at] & 0xffff == EXT_INST && words[at + 4] == N_CLAMP);
            at += (words[at] >> 16) as usize;
        }
        assert!(clamps > 0, "{}", code.name);
    }
}

/// Vulkan promises 128 invocations. Kernels whose sizes a plan chooses begin with small ones, too.
#[test]
fn every_workgroup_has_a_size_that_every_device_takes() {
    const EXECUTION_MODE: u32 = 16;
    const LOCAL_SIZE: u32 = 17;
    for code in KERNELS {
        let words = words(code);
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
fn every_module_declares_rounding_once_and_keeps_the_rest() {
    const CAPABILITY: u32 = 17;
    const EXECUTION_MODE: u32 = 16;
    const CAN_ROUND_TO_NEAREST: u32 = 4467;
    const ROUND_TO_NEAREST: u32 = 4462;
    for code in KERNELS {
        let words = words(code);
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
    // The scene, and the block of a solver.
    assert!(KERNELS.iter().all(|k| of(k, &|view| view == View::Uniform) <= 2));
}

#[test]
fn a_kernel_compiles_without_buffers() {
    let options = GpuOptions { statistics: true, ..GpuOptions::default() };
    let gpu = Gpu::open(&options).expect("a Vulkan device: `make setup` installs lavapipe");
    let compiled = gpu.compile(&kernel::FORWARD_OWNED, &kernel::FORWARD_OWNED, &[]).unwrap();
    assert!(compiled.seconds > 0.0 && gpu.allocated() == 0);
    assert_eq!(compiled.executables.is_empty(), !gpu.reports_kernels());
}

const BACK: Buffer = Buffer::named("back");

#[test]
fn labels_balance_under_validation_and_times_are_in_order() {
    let open = |validation| Gpu::open(&GpuOptions { validation, timings: true, ..GpuOptions::default() });
    let gpu = open(true).or_else(|_| open(false)).expect("the host at least");
    let buffers = [
        BufferPlan::new(buffer::RESULT, 1 << 18, Place::Device),
        BufferPlan::new(BACK, 1024, Place::Readback),
    ];
    let mut executor = Executor::new(&gpu, Arena::new(&gpu, &buffers, None).unwrap()).unwrap();
    executor.add_kernel(Kernel::named("count"), &kernel::LIMIT_SCATTERED_ATOMIC, &[]).unwrap();
    let mut s = Schedule::default();
    s.fill(buffer::RESULT, 1 << 18, 0);
    s.stage("first", &[("iteration", 1)]);
    s.dispatch(Kernel::named("count"), [1, 1, 1], 1).with([1u32, 0, 0, 0]);
    s.stage("second", &[]);
    s.dispatch(Kernel::named("count"), [1, 1, 1], 1).with([2u32, 0, 0, 0]);
    s.dispatch(Kernel::named("count"), [1, 1, 1], 1).with([3u32, 0, 0, 0]);
    s.copy(buffer::RESULT, BACK, 1024);
    executor.run(&s).unwrap();
    // The last word of the first histogram: one from each dispatch.
    let counted = executor.read::<u32>(BACK, ..)[255];
    let (reported, messages) = (gpu.take_recording(), gpu.validation_messages());
    assert!(messages.is_empty(), "{messages:?}");
    assert_eq!(counted, 3);
    let kernels: Vec<_> = reported.device.iter().map(|r| r.kernel).collect();
    assert_eq!(kernels, ["fill", "count", "count", "count", "copy"]);
    let stages: Vec<_> = reported.device.iter().map(|r| r.stage.map(|s| reported.stages[s].name)).collect();
    assert_eq!(stages, [None, Some("first"), Some("second"), Some("second"), Some("second")]);
    assert!(reported.device.windows(2).all(|w| w[0].from <= w[0].to && w[0].to <= w[1].from), "{reported:?}");
    // All of it while the host was waiting, as far as the clocks agree.
    let spans = |what| reported.host.iter().filter(move |s| s.what == what);
    let (submit, wait) = (spans("submit").next_back().unwrap(), spans("wait").next_back().unwrap());
    assert!(
        reported.device[0].from >= submit.from - 1e-3 && reported.device[4].to <= wait.to + 1e-6,
        "{reported:?}"
    );
    assert!(reported.kernels["count"].code.name == "limit_scattered_atomic");
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

#[test]
fn an_instrumented_kernel_tells_of_it() {
    let messages = |groups| {
        let gpu = open(&GpuOptions { instrumented: true, ..GpuOptions::default() });
        run(&gpu, DOWN, groups);
        gpu.close()
    };
    assert_eq!(messages(1), Vec::<String>::new());
    let reported = messages(2).join("\n");
    assert!(reported.contains("out of bounds"), "{reported}");
}
