//! What a build takes of memory, told before it allocates anything.
//!
//! Most of it is told by the numbers of triangles and instances: what is gathered of each, and what the clustering needs.
//! What depends on the mesh, how many nodes the tree has and how full its leaves are, is taken as it is of bad meshes.

use firsthit_geometry::{Aabb, Shape};
use glam::Vec3;

use crate::instance::{Instance, Placed};
use crate::layout::wide8::{Node, Wide8};
use crate::layout::{Bvh2, compact8::Compact8};
use crate::model::{Model, ModelShape};
use crate::{BuildError, BuildOptions, Geometry, Layout, build};

/// Which meshes may be built at the same time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AtOnce {
    All,
    One,
}

/// Bytes.
#[derive(Clone, Copy, Debug)]
struct Need {
    /// Of what is made.
    kept: u64,
    /// Of all there is while it is made, what is kept included.
    most: u64,
}

/// Whether the memory suffices to build these meshes and a tree over so many instances.
pub(crate) fn check(
    meshes: impl IntoIterator<Item = impl AsRef<[Geometry]>>,
    instances: usize,
    options: BuildOptions,
) -> Result<AtOnce, BuildError> {
    let Some(limit) = options.memory_limit else { return Ok(AtOnce::All) };
    let (mut kept, mut all, mut beside) = (0u64, 0u64, 0u64);
    for mesh in meshes {
        let need = of_mesh(mesh.as_ref(), options);
        kept = kept.saturating_add(need.kept);
        all = all.saturating_add(need.most);
        beside = beside.max(need.most - need.kept);
    }
    let placing = kept.saturating_add(of_instances(instances as u64));
    let need = kept.saturating_add(beside).max(placing);
    if need > limit {
        return Err(BuildError::OutOfMemory { need, limit });
    }
    Ok(if all.max(placing) <= limit { AtOnce::All } else { AtOnce::One })
}

/// For what is small, and allocated as it comes.
const SMALL: u64 = 4096;

fn bytes<T>(count: u64) -> u64 {
    count.saturating_mul(size_of::<T>() as u64)
}

fn of_mesh(geometries: &[Geometry], options: BuildOptions) -> Need {
    let (mut triangles, mut vertices, mut others, mut boxed) = (0u64, 0u64, 0u64, 0u64);
    for geometry in geometries {
        match geometry {
            Geometry::Triangles { positions, triangles: indices } => {
                triangles += indices.len() as u64;
                vertices = vertices.max(positions.len() as u64);
            }
            Geometry::Shape(shape) => {
                others += 1;
                boxed += bytes::<Shape<f64>>(1) + vertices_of(shape) * 128;
            }
            Geometry::User(user) => others += u64::from(user.count()),
        }
    }
    let all = triangles.saturating_add(others);
    // In the caller's order: corners, boxes and numbers.
    let gathered = bytes::<[Vec3; 3]>(all) + bytes::<Aabb<f32>>(all) + bytes::<u32>(all);
    // Where everything is, and what is no triangle.
    let places = bytes::<u32>(all) + bytes::<ModelShape>(others) + boxed + bytes::<Model>(1);
    let (topology, clustering) = build::bytes(all);
    let binary = Bvh2::<f32>::bytes_of(all) + bytes::<[Vec3; 3]>(all) + bytes::<u32>(all);
    let (tree, making) = match options.layout {
        // What may go wrong with shapes, or with coordinates of all sizes, is built as a binary tree.
        Layout::Bvh2 => (binary, binary),
        _ if others > 0 => (binary, binary),
        Layout::Wide8 => (Wide8::bytes_of(all).max(binary), Wide8::making_bytes(all)),
        Layout::Compact8 => (Compact8::bytes_of(all), Wide8::making_bytes(all)),
    };
    // Positions divided by the scale are there while triangles are gathered.
    let most = (bytes::<Vec3>(vertices) + bytes::<u32>(all) * 4).max(clustering).max(topology + making);
    // A few for each thread of the clustering.
    let small = SMALL + if all > SMALL { rayon::current_num_threads() as u64 * SMALL } else { 0 };
    Need { kept: places + tree + SMALL, most: places + gathered + most + small }
}

fn vertices_of(shape: &Shape<f64>) -> u64 {
    if let Shape::Polygon(polygon) = shape { polygon.loops().iter().map(|l| l.len() as u64).sum() } else { 0 }
}

/// While a tree is made over so many.
fn of_instances(count: u64) -> u64 {
    let placed = bytes::<Placed>(count) * 2 + bytes::<Instance>(count) + bytes::<u32>(count) * 2;
    let boxes = bytes::<Aabb<f64>>(count) * 2 + bytes::<Aabb<f32>>(count);
    let (topology, clustering) = build::bytes(count);
    // Nodes of three children, in vectors that grow.
    let making = bytes::<Aabb<f32>>(count) + bytes::<Node>(count) + bytes::<u64>(count) * 3;
    placed + boxes + clustering.max(topology + making) + SMALL
}
