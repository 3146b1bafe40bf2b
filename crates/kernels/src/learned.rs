//! What kernels of the learned start share. On the host it has code of its own: these are its reference, in float64 for both
//! types.

/// Number `i` of two in each word, in half precision.
pub fn half(words: &[u32], i: usize) -> f64 {
    let bits = words[i / 2] >> (16 * (i % 2)) & 0xffff;
    let (exponent, rest) = ((bits >> 10 & 31) as i32, f64::from(bits & 1023));
    let size = if exponent == 0 { rest * 2f64.powi(-24) } else { (1024.0 + rest) * 2f64.powi(exponent - 25) };
    if bits >> 15 == 1 { -size } else { size }
}

/// x sigmoid(x).
pub fn silu(x: f64) -> f64 {
    x / (1.0 + (-x).exp())
}
