//! Where a ray meets a surface of degree two or one: real roots, compared and rounded exactly.
//!
//! No square root is taken but for a first guess. How a root of `A t^2 + 2 B t + C` compares with a number `x` follows
//! from the signs of `A x^2 + 2 B x + C`, which tells whether `x` lies between the roots, and of `A x + B`, which
//! tells on which side of their middle. Rounding a root is comparing it with the two numbers halfway to the neighbours
//! of a candidate. All that is needed of coefficients are signs, so each is asked of the cheapest [`Number`] first.

use core::cell::{Cell, OnceCell};
use core::cmp::Ordering;

use super::dyadic::{Dyadic, Place};
use super::number::{Ball, Number, Wide};
use super::root::Root;
use crate::{Ray, Real};

/// What gives a quadratic its coefficients `A`, `B`, `C` of `A t^2 + 2 B t + C`.
pub(crate) trait Equation {
    fn coefficients<N: Number>(&self) -> [N; 3];
}

/// A polynomial in the coefficients of an equation, of which the sign is asked.
pub(crate) trait Formula {
    fn value<N: Number>(&self, coefficients: &[N; 3]) -> N;
}

/// The number `(a - b) / c`, `c > 0`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fraction {
    a: f64,
    b: f64,
    c: f64,
}

impl Fraction {
    /// Finite numbers; `c` is not 0.
    pub(crate) fn new(a: f64, b: f64, c: f64) -> Self {
        if c < 0.0 { Self { a: b, b: a, c: -c } } else { Self { a, b, c } }
    }

    /// Halfway between neighbours among the numbers of `R`; half a step beyond the last one where one is infinite.
    pub(crate) fn between<R: Real>(low: R, high: R) -> Self {
        let (low, high) = (low.to_f64(), high.to_f64());
        let last_step = R::MAX.to_f64() - R::MAX.next_down().to_f64();
        if high.is_infinite() {
            return Self::new(low, -0.5 * last_step, 1.0);
        }
        if low.is_infinite() {
            return Self::new(high, 0.5 * last_step, 1.0);
        }
        // Half the least denormal is no float.
        let half = 0.5 * (high - low);
        if half > 0.0 { Self::new(low, -half, 1.0) } else { Self::new(low, -high, 2.0) }
    }

    fn parts<N: Number>(self) -> (N, N) {
        (N::difference(self.a, self.b), N::new(self.c))
    }

    /// How it compares with another one; sets `fallback` if exact numbers were needed for that.
    pub(crate) fn order(self, o: Self, fallback: &mut bool) -> Ordering {
        fn sign<N: Number>(x: Fraction, y: Fraction) -> Option<i32> {
            let ((n, m), (p, q)) = (x.parts::<N>(), y.parts::<N>());
            n.times(&q).minus(&p.times(&m)).sign()
        }
        let quick = sign::<Ball>(self, o).or_else(|| sign::<Wide>(self, o));
        *fallback |= quick.is_none();
        quick.or_else(|| sign::<Dyadic>(self, o)).unwrap_or(0).cmp(&0)
    }

    /// Whether it lies in the closed interval of a ray.
    pub(crate) fn is_in(self, ray: &Ray<f64>, fallback: &mut bool) -> bool {
        self.is_from(ray.t_min, fallback) && self.is_to(ray.t_max, fallback)
    }

    /// Whether it is at least `t`, maybe infinite.
    pub(crate) fn is_from(self, t: f64, fallback: &mut bool) -> bool {
        if t.is_finite() { self.order(t.into(), fallback).is_ge() } else { t < 0.0 }
    }

    /// Whether it is at most `t`, maybe infinite.
    pub(crate) fn is_to(self, t: f64, fallback: &mut bool) -> bool {
        if t.is_finite() { self.order(t.into(), fallback).is_le() } else { t > 0.0 }
    }
}

/// The root of `c t = a - b`.
impl Equation for Fraction {
    fn coefficients<N: Number>(&self) -> [N; 3] {
        let (n, m) = self.parts::<N>();
        [N::new(0.0), m, N::new(0.0).minus(&n.twice())]
    }
}

impl From<f64> for Fraction {
    fn from(x: f64) -> Self {
        Self { a: x, b: 0.0, c: 1.0 }
    }
}

/// Which root; both are the same where there is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Lower,
    Upper,
}

/// How many real roots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Count {
    None,
    /// Of an equation of degree one.
    Simple,
    /// The surface is touched, not crossed.
    Double,
    Two,
}

impl Count {
    pub(crate) fn sides(self) -> &'static [Side] {
        match self {
            Self::None => &[],
            Self::Simple | Self::Double => &[Side::Lower],
            Self::Two => &[Side::Lower, Side::Upper],
        }
    }
}

/// An equation with what is known about it.
pub(crate) struct Quadratic<E> {
    equation: E,
    ball: [Ball; 3],
    wide: OnceCell<[Wide; 3]>,
    exact: OnceCell<[Dyadic; 3]>,
    leading: Cell<Option<i32>>,
}

impl<E: Equation> Quadratic<E> {
    pub(crate) fn new(equation: E) -> Self {
        let ball = equation.coefficients();
        Self { equation, ball, wide: OnceCell::new(), exact: OnceCell::new(), leading: Cell::new(None) }
    }

    pub(crate) fn equation(&self) -> &E {
        &self.equation
    }

    fn wide(&self) -> &[Wide; 3] {
        self.wide.get_or_init(|| self.equation.coefficients())
    }

    fn exact(&self) -> &[Dyadic; 3] {
        self.exact.get_or_init(|| self.equation.coefficients())
    }

    /// Whether exact numbers were needed so far.
    pub(crate) fn fallback(&self) -> bool {
        self.exact.get().is_some()
    }

    /// The sign of a formula.
    pub(crate) fn sign(&self, formula: &impl Formula) -> i32 {
        let quick = formula.value(&self.ball).sign();
        quick.unwrap_or_else(|| self.careful(formula))
    }

    #[cold]
    fn careful(&self, formula: &impl Formula) -> i32 {
        let wide = formula.value(self.wide()).sign();
        wide.or_else(|| formula.value(self.exact()).sign()).unwrap_or(0)
    }

    /// The sign of `A`: the degree, and the side on which the form is negative.
    pub(crate) fn leading(&self) -> i32 {
        self.leading.get().unwrap_or_else(|| {
            let sign = self.sign(&Coefficient(0));
            self.leading.set(Some(sign));
            sign
        })
    }

    /// The sign of `B`.
    pub(crate) fn slope(&self) -> i32 {
        self.sign(&Coefficient(1))
    }

    /// The sign of `C`, which is that of the form at the ray's origin.
    pub(crate) fn constant(&self) -> i32 {
        self.sign(&Coefficient(2))
    }

    pub(crate) fn count(&self) -> Count {
        if self.leading() == 0 {
            return if self.slope() == 0 { Count::None } else { Count::Simple };
        }
        match self.sign(&Discriminant) {
            ..0 => Count::None,
            0 => Count::Double,
            1.. => Count::Two,
        }
    }

    /// How a root compares with a number.
    pub(crate) fn order(&self, side: Side, x: Fraction) -> Ordering {
        self.order_by(side, |f| self.sign(f), &x)
    }

    /// The same, with `sign` to tell signs.
    fn order_by<X>(&self, side: Side, sign: impl Fn(&At<'_, X>) -> i32, x: &X) -> Ordering {
        let at = |degree| sign(&At { degree, x });
        placed(self.leading(), || self.slope(), side, || at(2), || at(1))
    }

    /// A root as a number of its own.
    pub(crate) fn root(&self, side: Side) -> Root {
        Root { coefficients: self.equation.coefficients(), side }
    }

    /// Whether a root lies in the closed interval of a ray.
    pub(crate) fn admits(&self, side: Side, ray: &Ray<f64>) -> bool {
        let from = if ray.t_min.is_finite() { self.order(side, ray.t_min.into()).is_ge() } else { ray.t_min < 0.0 };
        let to = || if ray.t_max.is_finite() { self.order(side, ray.t_max.into()).is_le() } else { ray.t_max > 0.0 };
        from && to()
    }

    /// A root rounded to the nearest number of `R`, ties to even; infinite beyond the last.
    pub(crate) fn nearest<R: Real>(&self, side: Side) -> R {
        // What f64 makes of it may do for f32, not for f64.
        let single = is_single::<R>();
        let quick = if single { self.confirmed(side, guess(&self.ball, side)) } else { None };
        quick.or_else(|| self.confirmed(side, guess(self.wide(), side))).unwrap_or_else(|| {
            let exact = self.exact();
            let order = |x: &Dyadic| self.order_by(side, |f| f.value(exact).signum(), x);
            let place = Place::find(guess(exact, side), order);
            R::from_f64(if single { place.to_f32().into() } else { place.to_f64() })
        })
    }

    /// The nearest number if it is the guess or next to it.
    fn confirmed<R: Real>(&self, side: Side, guess: f64) -> Option<R> {
        let mut x = R::from_f64(guess);
        for _ in 0..3 {
            if !x.is_finite() {
                return None;
            }
            let (below, above) = (x.next_down(), x.next_up());
            match self.order(side, Fraction::between(below, x)) {
                Ordering::Less => x = below,
                Ordering::Equal => return Some(even(below, x)),
                Ordering::Greater => match self.order(side, Fraction::between(x, above)) {
                    Ordering::Less => return Some(x),
                    Ordering::Equal => return Some(even(x, above)),
                    Ordering::Greater => x = above,
                },
            }
        }
        None
    }
}

/// Whether `R` is `f32`.
fn is_single<R: Real>() -> bool {
    R::MAX.to_f64() < f64::MAX
}

/// How a root of a form compares with a number `x`, from signs: of `A`, of `B`, of the form at `x` and of half its
/// derivative there.
pub(super) fn placed(
    leading: i32,
    slope: impl FnOnce() -> i32,
    side: Side,
    value: impl FnOnce() -> i32,
    derivative: impl FnOnce() -> i32,
) -> Ordering {
    if leading == 0 {
        // The line rises with B: it is positive right of its root.
        return (-value() * slope()).cmp(&0);
    }
    let value = value() * leading;
    if value < 0 {
        // Between the roots.
        return if side == Side::Lower { Ordering::Less } else { Ordering::Greater };
    }
    // Right of the middle of the roots, or left.
    let right = derivative() * leading;
    match side {
        Side::Lower if right > 0 => Ordering::Less,
        Side::Upper if right < 0 => Ordering::Greater,
        _ if value == 0 => Ordering::Equal,
        _ => (-right).cmp(&0),
    }
}

/// Of two neighbours the one whose last bit is 0.
fn even<R: Real>(a: R, b: R) -> R {
    let odd = if is_single::<R>() { a.to_f32().to_bits() & 1 == 1 } else { a.to_f64().to_bits() & 1 == 1 };
    if odd { b } else { a }
}

/// About a root, to a few units if the coefficients are that good; may be no number.
fn guess<N: Number>(c: &[N; 3], side: Side) -> f64 {
    let [a, b, k] = [c[0].value(), c[1].value(), c[2].value()];
    if a == 0.0 {
        let t = -k / (2.0 * b);
        return polished(c, t);
    }
    let discriminant = Discriminant.value(c).value().max(0.0);
    let q = -(b + discriminant.sqrt().copysign(b));
    if q == 0.0 {
        return 0.0;
    }
    let (s, t) = (q / a, k / q);
    polished(c, if (s <= t) == (side == Side::Lower) { s } else { t })
}

/// One step of Newton's method.
fn polished<N: Number>(c: &[N; 3], t: f64) -> f64 {
    if !t.is_finite() {
        return t;
    }
    let x = Fraction::from(t);
    let step = At { degree: 2, x: &x }.value(c).value() / (2.0 * At { degree: 1, x: &x }.value(c).value());
    if step.abs() <= 1e-9 * t.abs() { t - step } else { t }
}

struct Coefficient(usize);

impl Formula for Coefficient {
    fn value<N: Number>(&self, c: &[N; 3]) -> N {
        c[self.0].clone()
    }
}

struct Discriminant;

impl Formula for Discriminant {
    fn value<N: Number>(&self, [a, b, c]: &[N; 3]) -> N {
        b.squared().minus(&a.times(c))
    }
}

/// The form (degree 2) or half its derivative (degree 1) at `x`, times a positive number.
struct At<'a, X> {
    degree: u32,
    x: &'a X,
}

/// `A x + B`, or `(A x + 2 B) x + C`.
fn at<N: Number>(degree: u32, [a, b, c]: &[N; 3], x: &N) -> N {
    let ax = a.times(x);
    if degree == 1 { ax.plus(b) } else { ax.plus(&b.twice()).times(x).plus(c) }
}

impl Formula for At<'_, Fraction> {
    fn value<N: Number>(&self, c: &[N; 3]) -> N {
        let (n, m) = self.x.parts::<N>();
        if self.x.c == 1.0 {
            return at(self.degree, c, &n);
        }
        // Homogeneous: A n^2 + 2 (B m) n + C m^2.
        let [a, b, c] = c;
        let b = b.times(&m);
        let c = if self.degree == 1 { N::new(0.0) } else { c.times(&m.squared()) };
        at(self.degree, &[a.clone(), b, c], &n)
    }
}

impl At<'_, Dyadic> {
    fn value(&self, c: &[Dyadic; 3]) -> Dyadic {
        at(self.degree, c, self.x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Coefficients as given.
    struct Plain([f64; 3]);

    impl Equation for Plain {
        fn coefficients<N: Number>(&self) -> [N; 3] {
            self.0.map(N::new)
        }
    }

    fn coefficient() -> impl Strategy<Value = f64> {
        prop_oneof![
            3 => (-9i32..9).prop_map(f64::from),
            2 => (-1.0..1.0f64, -60i32..60).prop_map(|(x, e)| x * 2f64.powi(e)),
            1 => any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |x| x.is_finite()),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// Candidates confirmed by signs are what a search by exact comparisons finds, from a bad guess; and rounding to
        /// f32 is not rounding twice.
        #[test]
        fn roots_are_correctly_rounded(c in [coefficient(), coefficient(), coefficient()], bad in -1e3..1e3f64) {
            let q = Quadratic::new(Plain(c));
            for &side in q.count().sides() {
                let exact = q.exact();
                let place = Place::find(bad, |x| q.order_by(side, |f| f.value(exact).signum(), x));
                prop_assert_eq!(q.nearest::<f64>(side), place.to_f64());
                prop_assert_eq!(q.nearest::<f32>(side), place.to_f32());
            }
        }

        /// Roots ascend, and between them the form has the other sign.
        #[test]
        fn roots_are_where_the_sign_changes(c in [coefficient(), coefficient(), coefficient()], x in coefficient()) {
            let q = Quadratic::new(Plain(c));
            let exact = c.map(Dyadic::new);
            let value = at(2, &exact, &Dyadic::new(x)).signum();
            match q.count() {
                Count::None => prop_assert!(c[0] == 0.0 && c[1] == 0.0 || value == q.leading() && value != 0),
                Count::Simple => {
                    prop_assert_eq!(q.order(Side::Lower, x.into()).is_eq(), value == 0);
                    prop_assert_eq!(q.order(Side::Lower, x.into()).is_lt(), value * q.slope() > 0);
                }
                Count::Double => prop_assert_eq!(q.order(Side::Lower, x.into()).is_eq(), value == 0),
                Count::Two => {
                    let (lower, upper) = (q.order(Side::Lower, x.into()), q.order(Side::Upper, x.into()));
                    prop_assert!(lower <= upper);
                    prop_assert_eq!(lower.is_lt() && upper.is_gt(), value * q.leading() < 0);
                    prop_assert_eq!(lower.is_eq() || upper.is_eq(), value == 0);
                }
            }
        }

        #[test]
        fn fractions_are_ordered(x in [-9..9i32, -9..9, -9..9i32], y in [-9..9i32, -9..9, -9..9i32], e in -400..400i32) {
            prop_assume!(x[2] != 0 && y[2] != 0);
            let s = 2f64.powi(e);
            let of = |[a, b, c]: [i32; 3]| Fraction::new(f64::from(a) * s, f64::from(b) * s, c.into());
            let (left, right) = ((x[0] - x[1]) * y[2], (y[0] - y[1]) * x[2]);
            let expected = if x[2] * y[2] > 0 { left.cmp(&right) } else { right.cmp(&left) };
            prop_assert_eq!(of(x).order(of(y), &mut false), expected);
        }
    }

    #[test]
    fn ordinary_roots_need_no_exact_numbers() {
        let q = Quadratic::new(Plain([0.3, -0.7, 0.1]));
        assert_eq!(q.count(), Count::Two);
        let [x, y] = [Side::Lower, Side::Upper].map(|side| q.nearest::<f64>(side));
        assert!((x * y - 1.0 / 3.0).abs() < 1e-15 && !q.fallback());
        // A double root that no float has exactly: 0.1^2 is not the float nearest to it.
        assert_eq!(Quadratic::new(Plain([1.0, -0.1, 0.1 * 0.1])).count(), Count::None);
        assert_eq!(Quadratic::new(Plain([1.0, -0.5, 0.25])).count(), Count::Double);
    }

    #[test]
    fn ends_of_the_range_are_rounded_as_ieee_says() {
        let root = |x: f64, scale: f64| Quadratic::new(Plain([0.0, scale, -2.0 * x])).nearest::<f64>(Side::Lower);
        // x / scale
        assert_eq!(root(f64::MAX / 2.0, 0.5), f64::MAX);
        assert_eq!(root(f64::MAX / 2.0, 0.25), f64::INFINITY);
        assert_eq!(root(-f64::MAX / 2.0, 0.25), f64::NEG_INFINITY);
        assert_eq!(root(f64::from_bits(3), 2.0), f64::from_bits(2));
        assert_eq!(root(f64::from_bits(1), 2.0), 0.0);
    }
}
