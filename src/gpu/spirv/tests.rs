use super::flow::count;
use super::module::{Module, op};
use super::{Counts, count_loop};
use crate::transport::kernels::KERNELS;

/// A loop that loads x, stores 1 / sqrt(x x + x), and twice that before where the constant of number 10 is 1.
fn module(special: u32) -> Counts {
    let mut words = vec![0x0723_0203, 0x0001_0500, 0, 100, 0];
    let mut emit = |op: u32, rest: &[u32]| {
        words.push((rest.len() as u32 + 1) << 16 | op);
        words.extend_from_slice(rest);
    };
    let (main, float, uint, truth, pointer) = (1, 2, 3, 4, 5);
    let (zero, one, given, is_one, buffer) = (10, 11, 12, 13, 20);
    emit(15, &[5, main, 0x6e69_616d, 0]);
    emit(71, &[given, 1, 10]);
    emit(22, &[float, 32]);
    emit(21, &[uint, 32, 0]);
    emit(20, &[truth]);
    emit(32, &[pointer, 12, float]);
    emit(43, &[uint, zero, 0]);
    emit(43, &[uint, one, 1]);
    emit(50, &[uint, given, 7]);
    emit(52, &[truth, is_one, 170, given, one]);
    emit(59, &[pointer, buffer, 12]);
    emit(54, &[uint, main, 0, 99]);
    let (before, head, body, extra, rest, again, behind) = (40, 41, 42, 43, 44, 45, 46);
    let (i, next, go_on, x, square, sum, root, twice, unused, same) =
        (60, 61, 62, 63, 64, 65, 66, 67, 68, 69);
    emit(248, &[before]);
    emit(249, &[head]);
    emit(248, &[head]);
    emit(245, &[uint, i, zero, before, next, again]);
    emit(176, &[truth, go_on, i, given]);
    emit(246, &[behind, again, 0]);
    emit(250, &[go_on, body, behind]);
    emit(248, &[body]);
    emit(61, &[float, x, buffer]);
    emit(133, &[float, square, x, x]);
    emit(129, &[float, sum, square, x]);
    emit(12, &[float, root, 90, 32, sum]);
    emit(133, &[float, unused, root, x]);
    // The same in every turn.
    emit(128, &[uint, same, given, given]);
    emit(247, &[rest, 0]);
    emit(250, &[is_one, extra, rest]);
    emit(248, &[extra]);
    emit(129, &[float, twice, root, root]);
    emit(62, &[buffer, twice]);
    emit(249, &[rest]);
    emit(248, &[rest]);
    emit(62, &[buffer, root]);
    emit(249, &[again]);
    emit(248, &[again]);
    emit(128, &[uint, next, i, one]);
    emit(249, &[head]);
    emit(248, &[behind]);
    emit(253, &[]);
    emit(56, &[]);
    let parsed = Module::parse(&words, &[(10, special)].into()).expect("a whole module");
    count(&parsed).expect("a loop")[0]
}

#[test]
fn a_turn_counts_what_is_done_in_it_under_the_constants_at_hand() {
    // x x + x is one fma; comparison, branch and increment; what is unused or the same in every turn is not there.
    let without =
        Counts { fma: 1, special: 1, other: 3, broadcasts: 1, stores: 1, bytes: 8, ..Counts::default() };
    assert_eq!(module(7), without);
    assert_eq!(module(1), Counts { fma: 2, stores: 2, bytes: 12, ..without });
    assert_eq!(module(7).issued(), 7);
}

fn of(name: &str, constants: &[(&str, u32)]) -> Counts {
    let code = KERNELS.iter().find(|k| k.name == name).expect("a kernel of the table");
    count_loop(code, constants).expect("a loop over pairs or voxels")[0]
}

#[test]
fn a_product_finds_the_scanned_points_arm_once_for_several_pairs() {
    for (name, constants) in [
        ("forward_product_owned", &[("OTHERS", 4), ("SHARED", 0), ("TOUCHING", 0)][..]),
        ("forward_product_float", &[("OTHERS", 4), ("TOUCHING", 0)]),
        ("step", &[("OTHERS", 4), ("GEOMETRY", 2), ("TOUCHING", 0)]),
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
    assert!(lambertian.special >= 2 && lambertian.fma > forward.fma, "{lambertian:?}: a cosine more");
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
/// `cargo test spirv -- --nocapture` prints the table.
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
        ("forward_owned", &[linear, apart, lambertian], 66),
        ("forward_owned", &[linear, apart, ("BOUND", 1)], 39),
        ("forward_owned_texels", &[near, apart], 40),
        ("forward_owned_texels", &[linear, apart], 49),
        ("step_texels", &[linear, apart], 43),
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
        ("step", &[linear, apart], 43),
        ("step", &[linear], 46),
        ("step", &[linear, apart, lambertian], 55),
        ("step", &[linear, apart, two], 61),
        ("step", &[linear, apart, product, ("OTHERS", 4)], 27),
        ("surface_gather", &[apart], 64),
        ("surface_gather", &[apart, lambertian], 93),
        ("surface_gather", &[apart, two], 82),
        ("bound", &[linear, apart, ("WHAT", 0)], 36),
        ("bound", &[linear, apart, ("WHAT", 1)], 37),
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
    let finds = ["forward", "backward", "backproject", "bound", "step", "surface_gather", "places"];
    for code in KERNELS.iter().filter(|k| finds.iter().any(|name| k.name.starts_with(name))) {
        let words: Vec<u32> =
            code.spirv.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let fine = code.constants.iter().find(|c| c.0.name() == "FINE").expect("a constant of place.glsl").1;
        for value in [0, 1] {
            let m = Module::parse(&words, &[(fine, value)].into()).expect("a whole module");
            let mut all = m.blocks.iter().flat_map(|b| &b.instructions);
            assert!(all.any(|i| i.op == op::EXT_INST && i.rest[1] == N_CLAMP), "{} fine {value}", code.name);
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
