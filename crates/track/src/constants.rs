//! Constants of positions. Evidence: docs/track.md.

/// Distance of a ball's centre behind its light, and standard deviation of the distances of its light, in radii: a ball whose
/// surface shines with the cosine toward the wall point.
pub const BEHIND: f64 = 2.0 / 3.0;
pub const SPREAD: f64 = 0.2357;

/// Standard deviation of a disc across, in radii.
pub const ACROSS: f64 = 0.5;
/// Heights of an upright object that are rendered.
pub const HEIGHTS: usize = 6;

/// Prior of the extent: median, in units of length of the wall, and standard deviation of its logarithm.
pub const EXTENT: [f64; 2] = [0.07, 0.8];
/// Prior of the roundness, from 0 (the centre is where the light comes from) to 1 (a ball): mean and standard deviation, if the shape
/// is not known; standard deviation for errors, as either end is likelier than the middle; and standard deviation if it is known.
pub const ROUNDNESS: [f64; 2] = [0.5, 0.35];
pub const ENDS: f64 = 0.5;
pub const KNOWN: f64 = 0.02;
/// What a blob does not describe, from pair to pair: standard deviation of the logarithm of its light, and of the path, in extents.
pub const LIGHT_ERROR: f64 = 0.1;
pub const PATH_ERROR: f64 = 0.05;

/// The same of the counts of a bin, in those of the strongest bin of the pair: light of a body has no Gaussian profile.
pub const PROFILE_ERROR: f64 = 0.1;
/// Standard deviation of the centre from the centre of light, in squared extents over the distance: near parts send more light.
pub const CENTRE_ERROR: f64 = 1.0;

/// Calibration: fewest positions, and rounds of fit and weights.
pub const LEAST_CALIBRATION: usize = 20;
pub const ROUNDS: usize = 3;
/// Bins of direct light have more than this share of its strongest bin.
pub const DIRECT: f64 = 0.01;
/// Standard deviation of wall points and delays, metres; deviation of paths, in bins and in metres, and the standard deviation of its
/// logarithm; mean and standard deviation of the powers of distances and cosines.
pub const PLACE_PRIOR: f64 = 0.3;
pub const DEVIATION_PRIOR: [f64; 3] = [0.75, 0.1, 0.5];
pub const POWER_PRIORS: [[f64; 2]; 2] = [[1.6, 0.4], [1.0, 1.0]];
/// Standard deviation of the light of a calibrated object, as a share: it turns.
pub const CALIBRATED_LIGHT: f64 = 0.3;

/// Least variance of a bin, in those of a count.
pub const LEAST_COUNT: f64 = 0.3;
/// Blobs at most.
pub const MOST_BLOBS: usize = 3;
/// Starts that are refined for a blob.
pub const STARTS: usize = 8;
/// Nodes of the grid of starts along the longest side of the box.
pub const NODES: f64 = 26.0;
/// Iterations of a fit, at most; damping at the start, and the largest.
pub const ITERATIONS: usize = 30;
pub const DAMPING: [f64; 2] = [1e-3, 1e8];
