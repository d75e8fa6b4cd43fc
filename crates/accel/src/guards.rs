//! What makes the robust tier robust, piece by piece.

use core::fmt;

bitflags::bitflags! {
    /// The parts of [`Precision::Robust`](firsthit_geometry::Precision::Robust) that keep its promises. All are on by
    /// default, and other tiers ignore them: they are there so that the price of each can be measured, and tests can
    /// show that none is idle. A scene without one of them breaks a promise of its tier.
    ///
    /// ```
    /// use firsthit_accel::Guards;
    /// let names: Vec<String> = Guards::combinations().map(|(name, _)| name).collect();
    /// assert!(names.contains(&"only padding".to_owned()) && names.contains(&"all but watertight".to_owned()));
    /// assert_eq!(Guards::default(), Guards::ALL);
    /// ```
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub struct Guards: u8 {
        /// Boxes are met as if larger by what the ray and the triangles may be off, and a hit that may be off by more
        /// is kept within its triangle's box: no box with a hit is missed, and answers do not depend on the tree.
        /// Without: the plain slab test in f32.
        const PADDING = 1;
        /// Triangles are decided by edge functions that neighbours share (Woop, Benthin and Wald 2013). Without:
        /// Moeller and Trumbore's test in f32.
        const WATERTIGHT = 1 << 1;
        /// Where an edge function of the watertight test is 0, f64 decides. Without: 0 counts as inside, and what
        /// vanishes altogether is missed. Means nothing without [`Guards::WATERTIGHT`].
        const FALLBACK = 1 << 2;
        /// `t` comes from the triangle's plane in f64. Without: from the test's own f32 numbers.
        const PLANE_T = 1 << 3;
        /// [`Scene::surface_point`](crate::Scene::surface_point) gives a bound of the point's error. Without: the
        /// textbook's constant 1e-4 in units of the world, whatever the size of the scene.
        const OFFSET = 1 << 4;
    }
}

impl Guards {
    /// All of them.
    pub const ALL: Self = Self::all();
    /// Each by itself.
    pub const EACH: [Self; 5] = [Self::PADDING, Self::WATERTIGHT, Self::FALLBACK, Self::PLANE_T, Self::OFFSET];

    /// What a measurement loops over, with names for reports: `none`, `only` each that means something alone, `all but`
    /// each, `all`.
    pub fn combinations() -> impl Iterator<Item = (String, Self)> {
        let alone = Self::EACH.into_iter().filter(|&g| g != Self::FALLBACK);
        let only = alone.map(|g| (format!("only {g}"), g));
        let all_but = Self::EACH.into_iter().map(|g| (format!("all but {g}"), Self::ALL.difference(g)));
        let ends = |g: Self| core::iter::once((g.to_string(), g));
        ends(Self::empty()).chain(only).chain(all_but).chain(ends(Self::ALL))
    }

    fn name(self) -> &'static str {
        match self {
            Self::PADDING => "padding",
            Self::WATERTIGHT => "watertight",
            Self::FALLBACK => "fallback",
            Self::PLANE_T => "plane t",
            _ => "offset",
        }
    }
}

/// Guards as a type: known when compiling, or not.
pub(crate) trait GuardSet: Copy {
    fn new(guards: Guards) -> Self;
    fn has(self, guard: Guards) -> bool;
}

/// All of them.
#[derive(Clone, Copy)]
pub(crate) struct AllGuards;

impl GuardSet for AllGuards {
    #[inline(always)]
    fn new(_: Guards) -> Self {
        Self
    }
    #[inline(always)]
    fn has(self, _: Guards) -> bool {
        true
    }
}

impl GuardSet for Guards {
    #[inline(always)]
    fn new(guards: Guards) -> Self {
        guards
    }
    #[inline(always)]
    fn has(self, guard: Guards) -> bool {
        self.contains(guard)
    }
}

impl Default for Guards {
    fn default() -> Self {
        Self::ALL
    }
}

/// `all`, `none`, or the names of those that are on, joined by `+`.
impl fmt::Display for Guards {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::ALL {
            return f.write_str("all");
        }
        let names: Vec<&str> = Self::EACH.into_iter().filter(|g| self.contains(*g)).map(Self::name).collect();
        f.write_str(if names.is_empty() { "none".into() } else { names.join("+") }.as_str())
    }
}
