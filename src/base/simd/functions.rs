//! Functions that the machine has no lanes for, as polynomials (Moshier's Cephes) of the same operations in every form: the same
//! bits everywhere, within a few units in the last place of the true value.

use super::Simd;
use super::lane::F8;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, LOG2_E, PI};

/// tan(π/8).
const TAN_PI_8: f32 = std::f32::consts::SQRT_2 - 1.0;

/// c[0] xⁿ + c[1] xⁿ⁻¹ + ... + c[n].
#[inline(always)]
fn polynomial<S: Simd, const N: usize>(x: F8<S>, c: [f32; N]) -> F8<S> {
    let mut sum = F8::splat(x.0, c[0]);
    for c in &c[1..] {
        sum = sum * x + *c;
    }
    sum
}

/// The angle of (x, y), in [-π, π]; 0 at the origin.
#[inline(always)]
pub fn atan2<S: Simd>(y: F8<S>, x: F8<S>) -> F8<S> {
    let (ax, ay) = (x.abs(), y.abs());
    let (small, large) = (ax.min(ay), ax.max(ay));
    // Of the slope, or past tan(π/8) of what is left of it after π/4 have been taken away.
    let past = (large * TAN_PI_8).less(small);
    let (over, under) = (past.choose(small - large, small), past.choose(small + large, large));
    let t = over / under.max(F8::splat(x.0, f32::MIN_POSITIVE));
    let z = t * t;
    let rest = polynomial(z, [8.053_745e-2, -1.387_768_6e-1, 1.997_771_1e-1, -3.333_295e-1]) * z * t + t;
    let first = past.choose(rest + FRAC_PI_4, rest);
    let steep = ax.less(ay).choose(first * -1.0 + FRAC_PI_2, first);
    x.below(0.0).choose(steep * -1.0 + PI, steep).with_sign_of(y)
}

/// The angle of a cosine in [-1, 1].
#[inline(always)]
pub fn acos<S: Simd>(c: F8<S>) -> F8<S> {
    let a = c.abs();
    // Near the ends by half of the angle.
    let near = a.above(0.5);
    let half = (a * -1.0 + 1.0) * 0.5;
    let z = near.choose(half, a * a);
    let x = near.choose(half.sqrt(), a);
    let c5 = [4.216_32e-2, 2.418_131e-2, 4.547_002_6e-2, 7.495_300_3e-2, 1.666_675_2e-1];
    let asin = polynomial(z, c5) * z * x + x;
    let positive = near.choose(asin + asin, asin * -1.0 + FRAC_PI_2);
    c.below(0.0).choose(positive * -1.0 + PI, positive)
}

/// eˣ of what is not above 0; 0 below -87.
#[inline(always)]
pub fn exp_down<S: Simd>(x: F8<S>) -> F8<S> {
    let s = x.0;
    let within = x.max(F8::splat(s, -87.0));
    let n = (within * LOG2_E + 0.5).floor();
    let r = within - n * 0.693_359_4 - n * -2.121_944_4e-4;
    let c = [1.987_569_1e-4, 1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 5e-1];
    let e = polynomial(r, c) * (r * r) + r + 1.0;
    let two_to_n = F8(s, s.of_bits(s.shift_up::<23>(s.add_ids(s.ids(n.1), s.splat_ids(127)))));
    x.below(-87.0).choose(F8::splat(s, 0.0), e * two_to_n)
}

#[cfg(test)]
mod tests {
    use super::super::{Kernel, Lanes};
    use super::*;

    /// Eight arguments of each function.
    struct All([f32; 8], [f32; 8]);

    impl Kernel for All {
        type Output = [[f32; 8]; 3];
        #[inline(always)]
        fn run<S: Simd>(self, s: S) -> [[f32; 8]; 3] {
            let (a, b) = (F8::load(s, &self.0), F8::load(s, &self.1));
            [atan2(a, b).array(), acos(a.clamp(-1.0, 1.0)).array(), exp_down(a.abs() * -20.0).array()]
        }
    }

    #[test]
    fn they_are_near_the_true_values_and_the_same_in_every_form() {
        let value = |i: usize| ((i as f32 * 0.618_034).fract() * 2.0 - 1.0) * 1.1;
        for i in 0..4000 {
            let (mut a, b) = (std::array::from_fn(|k| value(8 * i + k)), std::array::from_fn(|k| value(31 * i + 7 * k + 3)));
            if i < 8 {
                (a[i], a[7 - i]) = (0.0, if i < 4 { 1.0 } else { -1.0 });
            }
            let all: Vec<_> = Lanes::all().into_iter().map(|lanes| lanes.run(All(a, b))).collect();
            assert!(all.iter().all(|found| found.map(|f| f.map(f32::to_bits)) == all[0].map(|f| f.map(f32::to_bits))));
            for k in 0..8 {
                let (y, x) = (f64::from(a[k]), f64::from(b[k]));
                let expected = [y.atan2(x), y.clamp(-1.0, 1.0).acos(), f64::from(a[k].abs() * -20.0).exp()];
                for (found, expected) in all[0].iter().zip(expected) {
                    let error = (f64::from(found[k]) - expected).abs();
                    assert!(
                        error <= 3e-7 * expected.abs().max(f64::from(f32::MIN_POSITIVE)),
                        "{} for {expected}: {a:?}",
                        found[k]
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_far_below_zero_is_zero() {
        let [_, _, found] =
            Lanes::Portable(super::super::Portable).run(All([0.0, 4.0, 5.0, 100.0, 1e30, 3.0, 2.0, 1.0], [0.0; 8]));
        assert_eq!((found[0], found[2], found[3], found[4]), (1.0, 0.0, 0.0, 0.0));
        assert!(found[1] > 0.0);
    }
}
