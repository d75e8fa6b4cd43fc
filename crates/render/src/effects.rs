//! Which effects a scene calls for: only those are simulated.

use bitflags::bitflags;

bitflags! {
    /// A set of effects.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub struct EffectSet: u32 {
        /// Shadow rays.
        const SHADOWS = 1 << 0;
        /// Point, spot and directional lights.
        const PUNCTUAL_LIGHTS = 1 << 1;
        /// Glowing surfaces, sampled as lights.
        const AREA_LIGHTS = 1 << 2;
        /// Light from around the scene.
        const ENVIRONMENT = 1 << 3;
        /// Mirror and glossy reflection rays.
        const REFLECTION = 1 << 4;
        /// Refraction rays through solids.
        const REFRACTION = 1 << 5;
        /// Thin transmission.
        const TRANSMISSION = 1 << 6;
        /// Surfaces with holes by alpha.
        const ALPHA_MASK = 1 << 7;
        /// Surfaces that cover in part.
        const ALPHA_BLEND = 1 << 8;
        /// Colour and other textures.
        const TEXTURES = 1 << 9;
        /// Normal and bump maps.
        const NORMAL_MAPS = 1 << 10;
        /// Surfaces that glow.
        const EMISSION = 1 << 11;
        /// Absorption inside solids.
        const ABSORPTION = 1 << 12;
        /// Vertex colours.
        const VERTEX_COLORS = 1 << 13;
        /// Surfaces shown as they are.
        const UNLIT = 1 << 14;
        /// Ambient occlusion (never called for by itself).
        const AMBIENT_OCCLUSION = 1 << 15;
        /// Section planes.
        const CLIPPING = 1 << 16;
    }
}
