//! Vectors of two and three components.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

use super::Real;

/// Declares a vector with its componentwise operations.
macro_rules! vector {
    ($name:ident: $($part:ident),*) => {
        /// A vector.
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        pub struct $name<F> {
            $(pub $part: F),*
        }

        impl<F: Real> $name<F> {
            /// The sum of products of components.
            #[inline(always)]
            pub fn dot(self, other: $name<F>) -> F {
                F::zero() $(+ self.$part * other.$part)*
            }

            /// The Euclidean length.
            #[inline(always)]
            pub fn length(self) -> F {
                self.dot(self).sqrt()
            }

            /// Componentwise function.
            #[inline(always)]
            pub fn map(self, of: impl Fn(F) -> F) -> $name<F> {
                $name { $($part: of(self.$part)),* }
            }

            /// Componentwise product.
            #[inline(always)]
            pub fn times(self, other: $name<F>) -> $name<F> {
                $name { $($part: self.$part * other.$part),* }
            }
        }

        impl<F: Real> Add for $name<F> {
            type Output = $name<F>;

            #[inline(always)]
            fn add(self, other: $name<F>) -> $name<F> {
                $name { $($part: self.$part + other.$part),* }
            }
        }

        impl<F: Real> Sub for $name<F> {
            type Output = $name<F>;

            #[inline(always)]
            fn sub(self, other: $name<F>) -> $name<F> {
                $name { $($part: self.$part - other.$part),* }
            }
        }

        impl<F: Real> Mul<F> for $name<F> {
            type Output = $name<F>;

            #[inline(always)]
            fn mul(self, factor: F) -> $name<F> {
                $name { $($part: self.$part * factor),* }
            }
        }

        impl<F: Real> Neg for $name<F> {
            type Output = $name<F>;

            #[inline(always)]
            fn neg(self) -> $name<F> {
                $name { $($part: -self.$part),* }
            }
        }

        impl<F: Real> AddAssign for $name<F> {
            #[inline(always)]
            fn add_assign(&mut self, other: $name<F>) {
                *self = *self + other;
            }
        }
    };
}

vector!(V2: x, y);
vector!(V3: x, y, z);

impl<F: Real> V2<F> {
    pub fn of([x, y]: [F; 2]) -> V2<F> {
        V2 { x, y }
    }
}

impl<F: Real> V3<F> {
    /// The first three numbers.
    #[inline(always)]
    pub fn of([x, y, z, _]: [F; 4]) -> V3<F> {
        V3 { x, y, z }
    }

    /// With a number before.
    pub fn with_first(self, first: F) -> [F; 4] {
        [first, self.x, self.y, self.z]
    }

    /// With a fourth number.
    pub fn with(self, w: F) -> [F; 4] {
        [self.x, self.y, self.z, w]
    }
}
