//! What the inner loops are compiled for.
//!
//! Which effects a scene calls for is known before the first ray. What costs time even where it does nothing is therefore
//! not asked again at each hit: tracing and shading are compiled once for each of a few groups of effects, and the
//! smallest one that can do a stage is chosen for a whole render. They share one source, so that a smaller kernel gives
//! the very bits of the full one. Effects that cost next to nothing where they are absent have no kernels of their own:
//! with each group that is told apart, the program would double.

use std::fmt;

use crate::material::lobes::Lobe;

/// What a kernel is compiled for.
pub(crate) trait Kernel: Copy + fmt::Debug + Send + Sync + 'static {
    /// Materials may have textures.
    const TEXTURES: bool;
    /// Some hits have to be asked about before they count (alpha, culled back faces, clear surfaces in the way of light).
    const FILTERED: bool;
    /// Light may go through surfaces.
    const THROUGH: bool;
    /// Materials may have something laid over their base: then `THROUGH` holds as well.
    const LAYERS: bool;
    /// There may be fog, things that move, or a camera with a lens.
    const RARE: bool;
    /// Room for the lobes of a surface.
    type Lobes: Copy + fmt::Debug + AsRef<[Lobe]> + AsMut<[Lobe]>;
    /// No lobes.
    const NO_LOBES: Self::Lobes;
}

/// The most lobes of a surface: diffuse, reflection, transmission, diffuse transmission, sheen, coat.
pub(crate) const MAX_LOBES: usize = if cfg!(feature = "without-layers") { 3 } else { 6 };

macro_rules! kernels {
    ($($(#[$doc:meta])* $name:ident: $textures:literal, $filtered:literal, $through:literal, $layers:literal, $rare:literal, $lobes:expr;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $name;

        impl Kernel for $name {
            const TEXTURES: bool = $textures;
            const FILTERED: bool = $filtered;
            const THROUGH: bool = $through;
            const LAYERS: bool = $layers && cfg!(not(feature = "without-layers"));
            const RARE: bool = $rare;
            type Lobes = [Lobe; $lobes];
            const NO_LOBES: Self::Lobes = [Lobe::Nothing; $lobes];
        }
    )*};
}

// Textures, filtered, through, layers, rare, most lobes.
kernels! {
    /// Diffuse surfaces and mirrors of one colour each.
    Plain: false, false, false, false, false, 2;
    /// With textures.
    Textured: true, false, false, false, false, 2;
    /// With hits that do not count.
    Filtered: false, true, false, false, false, 2;
    /// With textures, and hits that do not count: most glTF files, whose back faces are not there.
    TexturedFiltered: true, true, false, false, false, 2;
    /// With clear sheets and solids too.
    Clear: true, true, true, false, false, 3;
    /// Everything.
    Full: true, true, true, true, true, MAX_LOBES;
}

/// Which of the compiled kernels renders a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum KernelChoice {
    /// Diffuse surfaces and mirrors of one colour each.
    Plain,
    /// The same with textures.
    Textured,
    /// `Plain` where some hits do not count: by alpha, or as back faces that are culled.
    Filtered,
    /// `Textured` where some hits do not count.
    TexturedFiltered,
    /// The same, and light goes through surfaces.
    Clear,
    /// Everything.
    Full,
}

impl KernelChoice {
    /// The smallest kernel that does all of this.
    pub(crate) fn new(textures: bool, filtered: bool, through: bool, layers: bool, rare: bool) -> Self {
        match (textures, filtered, through, layers || rare) {
            (.., true) => Self::Full,
            (.., true, false) => Self::Clear,
            (true, true, ..) => Self::TexturedFiltered,
            (false, true, ..) => Self::Filtered,
            (true, false, ..) => Self::Textured,
            (false, false, ..) => Self::Plain,
        }
    }

    /// Its name in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Textured => "textured",
            Self::Filtered => "filtered",
            Self::TexturedFiltered => "textured and filtered",
            Self::Clear => "clear",
            Self::Full => "full",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_chosen_does_all_that_is_asked() {
        fn does<K: Kernel>() -> [bool; 5] {
            [K::TEXTURES, K::FILTERED, K::THROUGH, K::LAYERS, K::RARE]
        }
        for bits in 0..32 {
            let asked = [1, 2, 4, 8, 16].map(|b| bits & b != 0);
            let [textures, filtered, through, layers, rare] = asked;
            let done = match KernelChoice::new(textures, filtered, through, layers, rare) {
                KernelChoice::Plain => does::<Plain>(),
                KernelChoice::Textured => does::<Textured>(),
                KernelChoice::Filtered => does::<Filtered>(),
                KernelChoice::TexturedFiltered => does::<TexturedFiltered>(),
                KernelChoice::Clear => does::<Clear>(),
                KernelChoice::Full => does::<Full>(),
            };
            assert!(asked.iter().zip(done).all(|(asked, done)| !asked || done), "{asked:?} by {done:?}");
        }
    }
}
