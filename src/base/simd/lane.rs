//! Operators over eight lanes, so that formulas read as they do for one number.

use super::Simd;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Eight numbers.
#[derive(Clone, Copy)]
pub struct F8<S: Simd>(pub S, pub S::F);

/// Eight answers.
#[derive(Clone, Copy)]
pub struct M8<S: Simd>(pub S, pub S::M);

/// Eight vectors of two.
#[derive(Clone, Copy)]
pub struct V2<S: Simd> {
    /// x.
    pub x: F8<S>,
    /// y.
    pub y: F8<S>,
}

/// Eight vectors of three.
#[derive(Clone, Copy)]
pub struct V3<S: Simd> {
    /// x.
    pub x: F8<S>,
    /// y.
    pub y: F8<S>,
    /// z.
    pub z: F8<S>,
}

macro_rules! operator {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl<S: Simd> $trait for F8<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0, self.0.$operation(self.1, other.1))
            }
        }
        impl<S: Simd> $trait<f32> for F8<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f32) -> Self {
                Self(self.0, self.0.$operation(self.1, self.0.splat(other)))
            }
        }
    };
}

operator!(Add, add, add);
operator!(Sub, sub, sub);
operator!(Mul, mul, mul);
operator!(Div, div, div);

macro_rules! componentwise {
    ($vector:ident { $($axis:ident),* }) => {
        impl<S: Simd> Add for $vector<S> {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self { $($axis: self.$axis + other.$axis),* }
            }
        }
        impl<S: Simd> Sub for $vector<S> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self { $($axis: self.$axis - other.$axis),* }
            }
        }
        impl<S: Simd> Mul<F8<S>> for $vector<S> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, factor: F8<S>) -> Self {
                Self { $($axis: self.$axis * factor),* }
            }
        }
        impl<S: Simd> Div<F8<S>> for $vector<S> {
            type Output = Self;
            #[inline(always)]
            fn div(self, divisor: F8<S>) -> Self {
                Self { $($axis: self.$axis / divisor),* }
            }
        }
    };
}

componentwise!(V2 { x, y });
componentwise!(V3 { x, y, z });

impl<S: Simd> Neg for F8<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // Not 0 - x, whose zeros have another sign.
        self * -1.0
    }
}

impl<S: Simd> BitAnd for M8<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0, self.0.both(self.1, other.1))
    }
}

impl<S: Simd> BitOr for M8<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0, self.0.either(self.1, other.1))
    }
}

impl<S: Simd> Not for M8<S> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(self.0, self.0.not(self.1))
    }
}

impl<S: Simd> M8<S> {
    /// A bit for each lane that says yes.
    #[inline(always)]
    pub fn bits(self) -> u32 {
        self.0.mask(self.1)
    }

    /// `a` where yes, `b` elsewhere.
    #[inline(always)]
    pub fn choose(self, a: F8<S>, b: F8<S>) -> F8<S> {
        F8(self.0, self.0.choose(self.1, a.1, b.1))
    }

    /// The same of vectors.
    #[inline(always)]
    pub fn choose2(self, a: V2<S>, b: V2<S>) -> V2<S> {
        V2 { x: self.choose(a.x, b.x), y: self.choose(a.y, b.y) }
    }
}

impl<S: Simd> F8<S> {
    /// Eight times `x`.
    #[inline(always)]
    pub fn splat(s: S, x: f32) -> Self {
        Self(s, s.splat(x))
    }

    /// From memory.
    #[inline(always)]
    pub fn load(s: S, x: &[f32; 8]) -> Self {
        Self(s, s.load(x))
    }

    /// To memory.
    #[inline(always)]
    pub fn store(self, to: &mut [f32; 8]) {
        self.0.store(self.1, to);
    }

    /// As an array.
    #[inline(always)]
    pub fn array(self) -> [f32; 8] {
        let mut to = [0.0; 8];
        self.store(&mut to);
        to
    }

    /// √x.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt(self.1))
    }

    /// |x|.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self(self.0, self.0.abs(self.1))
    }

    /// The largest whole number not above.
    #[inline(always)]
    pub fn floor(self) -> Self {
        Self(self.0, self.0.floor(self.1))
    }

    /// |x| with the sign of `other`.
    #[inline(always)]
    pub fn with_sign_of(self, other: Self) -> Self {
        Self(self.0, self.0.with_sign(self.1, other.1))
    }

    /// The lesser; `other` where either is NaN.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Self(self.0, self.0.min(self.1, other.1))
    }

    /// The greater; `other` where either is NaN.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self(self.0, self.0.max(self.1, other.1))
    }

    /// Within [low, high]; low for NaN.
    #[inline(always)]
    pub fn clamp(self, low: f32, high: f32) -> Self {
        self.max(Self::splat(self.0, low)).min(Self::splat(self.0, high))
    }

    /// x < other.
    #[inline(always)]
    pub fn less(self, other: Self) -> M8<S> {
        M8(self.0, self.0.less(self.1, other.1))
    }

    /// x < other.
    #[inline(always)]
    pub fn below(self, other: f32) -> M8<S> {
        self.less(Self::splat(self.0, other))
    }

    /// x > other.
    #[inline(always)]
    pub fn above(self, other: f32) -> M8<S> {
        Self::splat(self.0, other).less(self)
    }

    /// Neither infinite nor NaN.
    #[inline(always)]
    pub fn is_finite(self) -> M8<S> {
        self.abs().below(f32::INFINITY)
    }

    /// Whole part of numbers within i32's range.
    #[inline(always)]
    pub fn ids(self) -> S::I {
        self.0.ids(self.1)
    }

    /// The sum of the eight: of those that lie four apart, then two apart, then one.
    #[inline(always)]
    pub fn sum(self) -> f32 {
        self.0.sum(self.1)
    }

    /// The least of the eight, none of which is NaN.
    #[inline(always)]
    pub fn least(self) -> f32 {
        self.0.least(self.1)
    }
}

impl<S: Simd> V2<S> {
    /// Dot product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F8<S> {
        self.x * other.x + self.y * other.y
    }

    /// Neither component is infinite or NaN.
    #[inline(always)]
    pub fn is_finite(self) -> M8<S> {
        self.x.is_finite() & self.y.is_finite()
    }
}

impl<S: Simd> V3<S> {
    /// Eight times `v`.
    #[inline(always)]
    pub fn splat(s: S, v: glam::Vec3) -> Self {
        Self { x: F8::splat(s, v.x), y: F8::splat(s, v.y), z: F8::splat(s, v.z) }
    }

    /// From memory, axis by axis.
    #[inline(always)]
    pub fn load(s: S, [x, y, z]: &[[f32; 8]; 3]) -> Self {
        Self { x: F8::load(s, x), y: F8::load(s, y), z: F8::load(s, z) }
    }

    /// Dot product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F8<S> {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// x and y.
    #[inline(always)]
    pub fn truncate(self) -> V2<S> {
        V2 { x: self.x, y: self.y }
    }
}
