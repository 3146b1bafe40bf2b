//! Constants of the estimates. Evidence: benches/NOTES.md.

/// Minimum hold-out size for model selection, pairs.
pub const LEAST_PAIRS: usize = 16;
/// Minimum hold-out size for an impulse response of exact values: with fewer pairs, it only hides errors of the depths.
pub const LEAST_FOR_PULSE: usize = 64;
/// Pairs that a fit takes at least.
pub const PAIRS: usize = 512;
/// Lateral pixels of a fit.
pub const LATERAL: usize = 64;
/// Rounds of the support of a fit from the start.
pub const ROUNDS: usize = 3;
/// Iterations of a round, and of the fit after the rounds or with another impulse response.
pub const ITERATIONS: [usize; 2] = [15, 20];
/// Iterations of a fit that continues a surface with a change of the instrument.
pub const OF_CHANGE: usize = 20;
/// Iterations of fits whose impulse responses are compared: tails differ less than widths do.
pub const OF_PULSE: usize = 30;
/// Rounds are left out where a trial's model error exceeds this multiple of that up to which the support follows the evidence:
/// light of a room or of another instrument draws surface where there is none.
pub const FAR: f64 = 0.75;
/// Fits begin with the union of the network and a light-cone transform, too, where this share is certainly left beyond noise, and at most
/// this: more is the light of a room, which haze explains.
pub const UNION_LEFT: [f64; 2] = [0.03, 0.25];
/// What the union leaves at most, of what is left without it, and standard errors of the difference at least. Below the last share, the
/// network missed surface: what the fit shows counts as seen.
pub const UNION_LESS: f64 = 0.85;
pub const UNION_ERRORS: f64 = 3.0;
pub const UNION_SHOWN: f64 = 0.6;
