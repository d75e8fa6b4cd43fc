//! Pictures beside the colour.

/// A picture beside the colour ("arbitrary output variable").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Aov {
    /// Distance from the camera to the first hit, world units; infinite where there is none.
    Depth,
    /// World shading normal.
    Normal,
    /// World geometric normal.
    GeometricNormal,
    /// Base colour.
    Albedo,
    /// Texture coordinates.
    Uv,
    /// Barycentric coordinates.
    Barycentric,
    /// Instance id as a distinct colour.
    InstanceId,
    /// Material id as a distinct colour.
    MaterialId,
    /// Primitive id as a distinct colour.
    PrimitiveId,
    /// Boxes and primitives tested, as a heat map.
    Heat,
}
