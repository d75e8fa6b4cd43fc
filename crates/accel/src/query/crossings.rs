//! What counts as one hit.

/// What counts where a ray passes through an edge or a vertex, which several triangles have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Crossings {
    /// Each crossing of a surface once: of the triangles that share the point, one answers for all. The rule is that of
    /// [`Shear::crosses`](firsthit_geometry::triangle::Shear::crosses): the ray is taken as shifted by less than any
    /// number, in a fixed direction. A ray that only touches a surface, at a ridge or a tip, counts 0 or 2.
    ///
    /// A closed mesh is crossed an even number of times by every line, at each tier but `Fast`, which has no such rule:
    /// there it is the same as [`Crossings::Triangles`]. Of analytic shapes every
    /// root counts, a double root once; at `Exact` touching a shape counts nothing.
    Surfaces,
    /// Each triangle that has the point, edges and vertices included.
    Triangles,
}
