use super::Counts;
use super::flow::count;
use super::module::Module;

/// A loop that loads x and stores 1 / sqrt(x x + x), preceded by twice that value if the constant of number 10 is 1.
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
    // Loop-invariant.
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
    // x x + x is one fma, plus comparison, branch and increment; unused and loop-invariant instructions are absent.
    let without =
        Counts { fma: 1, special: 1, other: 3, broadcasts: 1, stores: 1, bytes: 8, ..Counts::default() };
    assert_eq!(module(7), without);
    assert_eq!(module(1), Counts { fma: 2, stores: 2, bytes: 12, ..without });
    assert_eq!(module(7).issued(), 7);
}
