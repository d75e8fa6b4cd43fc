//! What each tier must pass, as `tests/corpus/README.md` demands.

use firsthit_geometry::Precision;
use glam::DVec3;

use super::{Answer, Case, Expect, Found, Level, Outcome};

/// The verdict on one answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// Right, or as good as right.
    Passed,
    /// Wrong, and the tier must have it right.
    Failed(String),
    /// Wrong, where the tier may be.
    Excused(String),
    /// Not asked.
    Skipped(&'static str),
}

/// Whether a tier must answer a case right.
#[must_use]
pub fn required(case: &Case, precision: Precision) -> bool {
    let level = case.expect.level.unwrap_or(Level::F32);
    match precision {
        _ if case.expect.result == Outcome::NoHitOrError => true,
        Precision::Fast => false,
        Precision::Robust => level == Level::F32 || never_missed(case),
        Precision::Double => level <= Level::F64 || never_missed(case),
        Precision::Exact => true,
    }
}

/// The level up to which a tier promises the place of a hit too.
fn promised(precision: Precision) -> Level {
    match precision {
        Precision::Fast | Precision::Robust => Level::F32,
        Precision::Double => Level::F64,
        Precision::Exact => Level::Exact,
    }
}

/// Hits that rounding may not lose at any level: a mesh has no gaps, and no tree may drop a box.
fn never_missed(case: &Case) -> bool {
    match case.prim {
        super::Primitive::Mesh { .. } => case.expect.result != Outcome::Miss,
        super::Primitive::Aabb { .. } => case.expect.result == Outcome::Hit,
        _ => false,
    }
}

/// Compares an answer with the expected one.
#[must_use]
pub fn judge(case: &Case, precision: Precision, answer: &Answer) -> Verdict {
    let complaint = match (case.expect.result, answer) {
        (_, Answer::Skipped(reason)) => return Verdict::Skipped(reason),
        (_, Answer::Inconsistent(why)) => return Verdict::Failed(format!("contradicts itself: {why}")),
        (Outcome::NoHitOrError | Outcome::Miss, Answer::Hit(found)) => Some(format!("false hit at {:?}", found.t)),
        (Outcome::NoHitOrError | Outcome::Miss, _) => None,
        (Outcome::Either, Answer::Miss) if case.expect.ids.is_empty() => None,
        (Outcome::Hit | Outcome::Either, Answer::Miss) => Some(format!("missed the hit at {:?}", case.expect.t)),
        (Outcome::Hit | Outcome::Either, Answer::Refused(e)) => Some(format!("refused: {e}")),
        (Outcome::Hit | Outcome::Either, Answer::Hit(found)) => wrong_place(case, precision, found),
    };
    match complaint {
        None => Verdict::Passed,
        Some(why) if required(case, precision) => Verdict::Failed(why),
        Some(why) => Verdict::Excused(why),
    }
}

/// What is wrong with a hit. Where only the hit is certain (above the tier's level), its place is not checked.
fn wrong_place(case: &Case, precision: Precision, found: &Found) -> Option<String> {
    let expect = &case.expect;
    let level = expect.level.unwrap_or(Level::F32);
    if level > promised(precision) {
        return None;
    }
    if let Some(id) = found.id
        && !expect.ids.is_empty()
        && !expect.ids.contains(&id)
    {
        return Some(format!("triangle {id}, not one of {:?}", expect.ids));
    }
    if promised(precision) == Level::Exact
        && let (Some(got), Some(exact)) = (found.t, expect.t_f32)
    {
        // Rounding a correctly rounded f64 once more is right but for a tie that no case makes. -0 equals 0.
        #[allow(clippy::cast_possible_truncation, reason = "rounding is what is compared")]
        let rounded = got as f32;
        if rounded != exact.0 {
            return Some(format!("t = {rounded:e}, not {:e} exactly", exact.0));
        }
    }
    let pairs = [
        ("t", found.t, expect.t),
        ("entry", found.stay.map(|s| s[0]), expect.t_enter),
        ("exit", found.stay.map(|s| s[1]), expect.t_exit),
    ];
    for (what, got, exact) in pairs {
        if let (Some(got), Some(exact)) = (got, exact) {
            let tolerance = tolerance(expect, precision, exact);
            // Written so that NaN is wrong; equal infinities are right.
            if !(got == exact || (got - exact).abs() <= tolerance) {
                return Some(format!("{what} = {got:e}, not {exact:e} within {tolerance:e}"));
            }
        }
    }
    if found.stay.is_some() && found.t.is_some() != expect.t.is_some() {
        return Some(format!("surface at {:?}, not {:?}", found.t, expect.t));
    }
    wrong_normal(expect, precision, found)
}

/// `16 kappa u` relative, in f32 not less than 4 ulp; boxes 4 ulp; unlimited where the condition is.
fn tolerance(expect: &Expect, precision: Precision, exact: f64) -> f64 {
    let double = promised(precision) >= Level::F64;
    #[allow(clippy::cast_possible_truncation, reason = "the ulp of the nearest f32 is wanted")]
    let ulp = |t: f64| if double { t.next_up() - t } else { f64::from((t as f32).next_up() - t as f32) };
    let unit = if double { 0.5_f64.powi(53) } else { 0.5_f64.powi(24) };
    let four_ulp = 4.0 * ulp(exact.abs());
    match (expect.t_enter, expect.kappa) {
        (Some(_), _) => four_ulp,
        (None, Some(kappa)) if double => 16.0 * kappa * unit * exact.abs(),
        (None, Some(kappa)) => four_ulp.max(16.0 * kappa * unit * exact.abs()),
        (None, None) => f64::INFINITY,
    }
}

/// A box names one of the faces reached; in double precision any normal is right within 1e-7. (In single precision the
/// normal of a sphere seen from far off is as uncertain as the place of the hit.)
fn wrong_normal(expect: &Expect, precision: Precision, found: &Found) -> Option<String> {
    let normal = found.normal?;
    if !expect.faces.is_empty() {
        let faces = expect.faces.iter().filter_map(|f| face_normal(f));
        return (!faces.clone().any(|f| f == normal)).then(|| format!("face {normal}, not one of {:?}", expect.faces));
    }
    if promised(precision) < Level::F64 {
        return None;
    }
    let exact = expect.n.as_ref()?.iter().map(|x| x.parse().unwrap_or(f64::NAN)).collect::<Vec<f64>>();
    let error = normal.distance(DVec3::from_slice(&exact));
    (!(error <= 1e-7)).then(|| format!("normal off by {error:e}"))
}

/// The outward normal of the face `-x`, `+y`, ...
fn face_normal(face: &str) -> Option<DVec3> {
    let mut characters = face.chars();
    let sign = if characters.next()? == '-' { -1.0 } else { 1.0 };
    let axis = "xyz".find(characters.next()?)?;
    Some(DVec3::AXES[axis] * sign)
}
