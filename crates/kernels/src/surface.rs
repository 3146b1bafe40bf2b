//! From raw variables to albedo and normal: albedo = ELU(a), normal = normalize(tanh(q) + (0, 0, -1)).

use super::{Real, V3};

#[inline(always)]
pub fn elu<F: Real>(a: F) -> F {
    if a > F::zero() { a } else { a.exp() - F::one() }
}

/// The normal before normalization. tanh(10) is 1 in fp32.
#[inline(always)]
pub fn toward_wall<F: Real>(v: [F; 4]) -> V3<F> {
    let ten = F::of(10.0);
    let tanh = |q: F| q.at_least(-ten).at_most(ten).tanh();
    V3 { x: tanh(v[1]), y: tanh(v[2]), z: tanh(v[3]) - F::one() }
}

/// Its length, bounded from below to keep the division finite.
#[inline(always)]
pub fn safe_length<F: Real>(u: V3<F>) -> F {
    u.length().at_least(F::of(1e-12))
}
