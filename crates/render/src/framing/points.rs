//! What there is to see, as points.

use firsthit_geometry::{Aabb, Primitive, Ray, Shape};
use firsthit_import::SceneDesc;
use firsthit_import::scene::{SurfaceDesc, TriangleMesh};
use glam::{DAffine3, DVec3};

/// About how many points stand for the whole scene.
const POINTS: usize = 100_000;

/// Points of the surfaces that a picture should show.
pub(super) struct Points {
    pub(super) all: Vec<DVec3>,
    pub(super) bounds: Aabb<f64>,
    /// Mean over the area of the unit normals: short for a solid, long for a sheet.
    pub(super) mean_normal: DVec3,
    /// Whether a ground much larger than what stands on it does not count.
    pub(super) ground_left_out: bool,
}

/// The points of one geometry of one instance.
#[derive(Clone)]
struct Group {
    points: Vec<DVec3>,
    bounds: Aabb<f64>,
    /// Sum of area times normal, and of area.
    normal: DVec3,
    area: f64,
}

impl Points {
    pub(super) fn visible(desc: &SceneDesc) -> Self {
        let mut groups = groups(desc);
        let ground = ground(&groups);
        if let Some(i) = ground {
            groups.remove(i);
        }
        let area: f64 = groups.iter().map(|g| g.area).sum();
        let normal: DVec3 = groups.iter().map(|g| g.normal).sum();
        Self {
            bounds: groups.iter().fold(Aabb::empty(), |b, g| b.union(g.bounds)),
            mean_normal: if area > 0.0 { normal / area } else { DVec3::ZERO },
            ground_left_out: ground.is_some(),
            all: groups.into_iter().flat_map(|g| g.points).collect(),
        }
    }
}

fn groups(desc: &SceneDesc) -> Vec<Group> {
    let surfaces = || {
        desc.instances.iter().flat_map(|i| {
            let geometries = desc.meshes.get(i.mesh).map_or(&[][..], |m| &m.geometries);
            geometries.iter().map(|g| (&g.surface, &i.transform))
        })
    };
    let triangles: usize = surfaces()
        .map(|(s, _)| match s {
            SurfaceDesc::Triangles(mesh) => mesh.triangles.len(),
            SurfaceDesc::Shape(_) => 0,
        })
        .sum();
    let step = (3 * triangles / POINTS).max(1);
    surfaces()
        .filter_map(|(surface, transform)| match surface {
            SurfaceDesc::Triangles(mesh) => mesh_group(mesh, transform, step),
            SurfaceDesc::Shape(shape) => shape_group(shape, transform),
        })
        .collect()
}

/// The corners of every `step`-th triangle, and the outermost corners of all.
fn mesh_group(mesh: &TriangleMesh, transform: &DAffine3, step: usize) -> Option<Group> {
    let mut group = Group { points: Vec::new(), bounds: Aabb::empty(), normal: DVec3::ZERO, area: 0.0 };
    // A mirroring transform turns the winding round, but not the side that is the front.
    let mirrored = transform.matrix3.determinant().signum();
    let mut outermost: Option<[DVec3; 6]> = None;
    for (i, triangle) in mesh.triangles.iter().enumerate() {
        let Some(corners) = corners(mesh, triangle) else { continue };
        let corners = corners.map(|p| transform.transform_point3(p));
        let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]) * mirrored;
        group.normal += 0.5 * cross;
        group.area += 0.5 * cross.length();
        for p in corners {
            let extremes = outermost.get_or_insert([p; 6]);
            for axis in 0..3 {
                if p[axis] < extremes[axis][axis] {
                    extremes[axis] = p;
                }
                if p[axis] > extremes[axis + 3][axis] {
                    extremes[axis + 3] = p;
                }
            }
        }
        if i % step == 0 {
            group.points.extend(corners);
        }
    }
    group.points.extend(outermost?);
    group.bounds = Aabb::from_points(group.points.iter().copied());
    group.bounds.is_finite().then_some(group)
}

fn corners(mesh: &TriangleMesh, triangle: &[u32; 3]) -> Option<[DVec3; 3]> {
    let [a, b, c] = triangle.map(|i| mesh.positions.get(i as usize));
    Some([a?.as_dvec3(), b?.as_dvec3(), c?.as_dvec3()])
}

/// Points of a shape's surface: where a grid of rays along each axis meets it. Unbounded shapes have none.
fn shape_group(shape: &Shape<f64>, transform: &DAffine3) -> Option<Group> {
    const GRID: usize = 12;
    let bounds = shape.bounds();
    if bounds.is_empty() || !bounds.is_finite() {
        return None;
    }
    let size = bounds.extent();
    let away = size.max_element();
    let mut points = Vec::new();
    for axis in 0..3 {
        let along = DVec3::AXES[axis];
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        for (i, j) in (0..=GRID).flat_map(|i| (0..=GRID).map(move |j| (i, j))) {
            let share = |k: usize| k as f64 / GRID as f64;
            let across = DVec3::AXES[a] * size[a] * share(i) + DVec3::AXES[b] * size[b] * share(j);
            let (low, high) = (bounds.min + across - along * away, bounds.min + across + along * (size[axis] + away));
            for ray in [Ray::new(low, along), Ray::new(high, -along)] {
                points.extend(shape.closest_hit(&ray).map(|hit| ray.at(hit.t)));
            }
        }
    }
    if points.is_empty() {
        points.extend(bounds.corners());
    }
    let points: Vec<DVec3> = points.into_iter().map(|p| transform.transform_point3(p)).collect();
    let bounds = Aabb::from_points(points.iter().copied());
    bounds.is_finite().then_some(Group { points, bounds, normal: DVec3::ZERO, area: 0.0 })
}

/// The flat, level geometry that is much larger than all that stands on it, if there is one.
fn ground(groups: &[Group]) -> Option<usize> {
    const MUCH_LARGER: f64 = 3.0;
    let (i, ground) =
        groups.iter().enumerate().max_by(|(_, a), (_, b)| width(&a.bounds).total_cmp(&width(&b.bounds)))?;
    let rest = groups.iter().enumerate().filter(|(j, _)| *j != i).fold(Aabb::empty(), |b, (_, g)| b.union(g.bounds));
    let size = rest.extent().max_element();
    let level = ground.bounds.extent().y <= 0.01 * width(&ground.bounds);
    let below = ground.bounds.max.y <= rest.min.y + 0.1 * size;
    (!rest.is_empty() && size > 0.0 && level && below && width(&ground.bounds) > MUCH_LARGER * size).then_some(i)
}

/// The larger of the two level extents.
fn width(bounds: &Aabb<f64>) -> f64 {
    bounds.extent().x.max(bounds.extent().z)
}
