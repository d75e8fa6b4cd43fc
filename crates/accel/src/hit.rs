//! Answers.

use core::ops::{Add, Mul};

use glam::DVec3;

/// Which primitive: by the caller's (or file's) order, never the tree's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct HitId {
    /// Index of the instance.
    pub instance: u32,
    /// Index of the geometry in its mesh.
    pub geometry: u32,
    /// Index of the triangle, or of the user's primitive, in its geometry; 0 for a shape.
    pub primitive: u32,
}

/// Where a ray meets the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// What was hit. Of several at the same `t`, the smallest.
    pub id: HitId,
    /// Ray parameter, in lengths of the ray's direction.
    pub t: f64,
    /// Weight of the triangle's second vertex; a shape's own first parameter.
    pub u: f32,
    /// Weight of the triangle's third vertex; a shape's own second parameter.
    pub v: f32,
    /// The geometric normal in the world, by the winding of the triangle, of any length; never flipped towards the ray. Zero
    /// where there is none (the apex of a cone). [`Hit::normal`] makes it unit, which not every query pays for.
    pub normal_direction: DVec3,
}

impl Hit {
    /// Weights of the triangle's three vertices; they add up to 1. (The parameters of a shape are not weights.)
    #[inline]
    #[must_use]
    pub fn weights(&self) -> [f32; 3] {
        [1.0 - self.u - self.v, self.u, self.v]
    }

    /// What the vertices of the triangle that was hit have, at the point that was hit: normals, texture coordinates, colours, anything that
    /// can be multiplied by an `f32` and added. `corners` are the values of its three vertices, in their order.
    ///
    /// ```
    /// use firsthit_accel::{Geometry, SceneBuilder};
    /// use firsthit_geometry::Ray;
    /// use glam::{DAffine3, DVec3, Vec2, Vec3};
    ///
    /// let (positions, triangles) = (vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X + Vec3::Y], vec![[0, 1, 2], [3, 2, 1]]);
    /// let texture_coordinates = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
    /// let mut builder = SceneBuilder::default();
    /// let mesh = builder.add_mesh(vec![Geometry::Triangles { positions, triangles: triangles.clone() }]);
    /// builder.add_instance(mesh, DAffine3::IDENTITY);
    /// let hit = builder.build()?.closest_hit(&Ray::new(DVec3::new(0.75, 0.5, 2.0), DVec3::NEG_Z)).unwrap();
    ///
    /// let vertices = triangles[hit.id.primitive as usize];
    /// assert_eq!(hit.interpolate(vertices.map(|i: u32| texture_coordinates[i as usize])), Vec2::new(0.75, 0.5));
    /// # Ok::<(), firsthit_accel::BuildError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn interpolate<T: Mul<f32, Output = T> + Add<Output = T>>(&self, [a, b, c]: [T; 3]) -> T {
        let [of_a, of_b, of_c] = self.weights();
        a * of_a + b * of_b + c * of_c
    }

    /// Unit geometric normal in the world, by the winding of the triangle; never flipped towards the ray. Zero where there is
    /// none.
    #[inline]
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal_direction.normalize_or_zero()
    }

    /// [`Hit::normal`] on the side that a ray of this direction comes from.
    #[inline]
    #[must_use]
    pub fn normal_against(&self, direction: DVec3) -> DVec3 {
        let normal = self.normal();
        if normal.dot(direction) > 0.0 { -normal } else { normal }
    }
}

/// A point on a surface, known to within an error bound: what rays start from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point in the world.
    pub position: DVec3,
    /// Unit geometric normal in the world.
    pub normal: DVec3,
    /// The surface lies within this distance of `position` along the normal, with every rounding that a ray from here
    /// undergoes when it enters the instance again included.
    pub error: f64,
}

impl SurfacePoint {
    /// Where a ray towards `direction` may start so that it is on that side of the surface whatever was rounded: the
    /// position moved along the normal by the error bound, no further.
    #[must_use]
    pub fn spawn(&self, direction: DVec3) -> DVec3 {
        let side = if direction.dot(self.normal) < 0.0 { -1.0 } else { 1.0 };
        self.position + self.normal * (side * self.error)
    }
}

/// What a query cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounts {
    /// Boxes tested, in both levels.
    pub boxes: u32,
    /// Leaves visited.
    pub leaves: u32,
    /// Triangles and shapes tested.
    pub primitives: u32,
    /// Hits of triangles, and tests of shapes, that `f64` could not decide or not round correctly: exact numbers were
    /// needed. Only at
    /// [`Precision::Exact`](firsthit_geometry::Precision::Exact).
    pub fallbacks: u32,
}
