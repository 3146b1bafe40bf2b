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
/// Iterations of fits whose impulse responses are compared: tails differ less than widths do.
pub const OF_PULSE: usize = 30;
/// Rounds are left out where a trial's model error exceeds this multiple of that up to which the support follows the evidence:
/// light of a room or of another instrument draws surface where there is none.
pub const FAR: f64 = 0.75;
