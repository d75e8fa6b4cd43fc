//! Indices of refraction that differ between colours (KHR_materials_dispersion).
//!
//! A path stays whole until it first goes through a surface that parts colours. There it follows one of the three, with
//! three times its weight, and from then on it is about that colour alone.

use glam::Vec3;

/// Which colours a path is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Colors {
    /// All; where they are parted, it goes on with this one: 0 red, 1 green, 2 blue.
    All(u8),
    /// One of them.
    One(u8),
}

impl Colors {
    /// By a number in [0, 1): which colour is followed once they are parted.
    pub(crate) fn chosen_by(u: f32) -> Self {
        Self::All(((u * 3.0) as u8).min(2))
    }

    /// After a surface that parts them.
    pub(crate) fn parted(self) -> Self {
        match self {
            Self::All(next) | Self::One(next) => Self::One(next),
        }
    }

    /// What the light keeps at a surface that parts colours.
    pub(super) fn share(self) -> Vec3 {
        match self {
            Self::All(next) => Vec3::AXES[usize::from(next)] * 3.0,
            Self::One(_) => Vec3::ONE,
        }
    }

    /// The index of refraction for the colour that is followed; `dispersion`: 20 / Abbe number.
    pub(super) fn ior(self, ior: f32, dispersion: f32) -> f32 {
        let (Self::All(color) | Self::One(color)) = self;
        let half = (ior - 1.0) * 0.025 * dispersion;
        (ior + half * (f32::from(color) - 1.0)).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blue_is_bent_most_by_the_width_that_abbes_number_says() {
        let dispersion = 20.0 / 55.0;
        let n = |color| Colors::One(color).ior(2.4, dispersion);
        assert_eq!(n(1), 2.4);
        assert!(((n(2) - n(0)) - 1.4 / 55.0).abs() < 1e-6);
        assert!(Colors::One(0).ior(1.01, 100.0) >= 1.0);
    }

    #[test]
    fn the_three_colours_together_are_white() {
        let all: Vec3 = [0.0, 0.4, 0.99].into_iter().map(|u| Colors::chosen_by(u).share() / 3.0).sum();
        assert_eq!(all, Vec3::ONE);
        assert_eq!(Colors::chosen_by(0.5).parted(), Colors::One(1));
        assert_eq!(Colors::One(2).share(), Vec3::ONE);
    }
}
