//! Why a scene cannot be built.

/// A scene that cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A vertex is NaN or infinite.
    #[error("mesh {mesh}, geometry {geometry}: vertex {vertex} is not finite")]
    NotFinite {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the geometry.
        geometry: usize,
        /// Index of the vertex.
        vertex: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error("mesh {mesh}, geometry {geometry}, triangle {triangle}: vertex {index} does not exist (there are {count})")]
    IndexOutOfRange {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the geometry.
        geometry: usize,
        /// Index of the triangle.
        triangle: usize,
        /// The vertex it names.
        index: u32,
        /// How many vertices there are.
        count: usize,
    },
    /// An instance names a mesh that is not there.
    #[error("instance {instance}: mesh {mesh} does not exist (there are {count})")]
    NoSuchMesh {
        /// Index of the instance.
        instance: usize,
        /// The mesh it names.
        mesh: usize,
        /// How many meshes there are.
        count: usize,
    },
    /// An instance's transform cannot be inverted well enough.
    #[error("instance {instance}: its transform is not finite, is singular, or has a condition number above 2^20")]
    IllConditioned {
        /// Index of the instance.
        instance: usize,
    },
    /// The box of a primitive of the user's own is empty or no box.
    #[error(
        "mesh {mesh}, geometry {geometry}: the box of primitive {primitive} is empty or has coordinates that are no numbers"
    )]
    UnusableBounds {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the geometry.
        geometry: usize,
        /// Index of the primitive.
        primitive: u32,
    },
    /// A mask or an update names an instance that is not there.
    #[error("instance {instance} does not exist (there are {count})")]
    NoSuchInstance {
        /// The instance that is named.
        instance: usize,
        /// How many there are.
        count: usize,
    },
    /// A group is placed, or is part of another one, that is not there (yet).
    #[error("group {group} does not exist (there are {count})")]
    NoSuchGroup {
        /// The group that is named.
        group: usize,
        /// How many there are.
        count: usize,
    },
    /// [`BuildOptions::memory_limit`](crate::BuildOptions::memory_limit) is too little. Nothing was built.
    #[error("building takes up to {need} bytes of memory, and {limit} are allowed")]
    OutOfMemory {
        /// Bytes that are enough.
        need: u64,
        /// Bytes that are allowed.
        limit: u64,
    },
    /// Whoever watched it had enough.
    #[error("the build was cancelled")]
    Cancelled,
    /// More elements than indices can count.
    #[error("{what}: {count} are more than the {limit} that can be indexed")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        count: u64,
        /// How many there may be.
        limit: u64,
    },
    /// A refit of a mesh that is not there.
    #[error("mesh {mesh} does not exist (there are {count})")]
    UnknownMesh {
        /// Index of the mesh.
        mesh: usize,
        /// How many meshes there are.
        count: usize,
    },
    /// A refit keeps the number of a mesh's geometries.
    #[error("mesh {mesh} was built of {before} geometries, and now has {now}")]
    GeometriesChanged {
        /// Index of the mesh.
        mesh: usize,
        /// How many there were.
        before: usize,
        /// How many there are.
        now: usize,
    },
    /// A refit keeps the number of a geometry's triangles.
    #[error("mesh {mesh}, geometry {geometry} was built of {before} primitives, and now has {now}")]
    TrianglesChanged {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the geometry.
        geometry: usize,
        /// How many there were.
        before: usize,
        /// How many there are.
        now: usize,
    },
    /// A refit makes no shape of triangles, nor the other way round.
    #[error("mesh {mesh}, geometry {geometry} was built of triangles and is now a shape, or the other way round")]
    KindChanged {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the geometry.
        geometry: usize,
    },
    /// New transforms are given for all instances.
    #[error("{instances} instances were given {transforms} transforms")]
    TransformsChanged {
        /// How many instances there are.
        instances: usize,
        /// How many transforms were given.
        transforms: usize,
    },
}
