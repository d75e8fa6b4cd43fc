//! The lobes of a surface at one point, in their frame.

use glam::Vec3;

use super::lobes::Lobe;
use crate::kernel::Kernel;
use crate::warp;

/// The sum of a few lobes around a shading normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bsdf<K: Kernel> {
    x: Vec3,
    y: Vec3,
    /// The shading normal, unit, on the viewer's side.
    pub(crate) normal: Vec3,
    lobes: K::Lobes,
    count: usize,
}

impl<K: Kernel> Bsdf<K> {
    /// Black.
    pub(crate) fn new(normal: Vec3) -> Self {
        let (x, y) = warp::frame(normal);
        Self { x, y, normal, lobes: K::NO_LOBES, count: 0 }
    }

    /// Black, with an x axis along the surface that lies as near to `tangent` as the normal lets it.
    pub(crate) fn along(normal: Vec3, tangent: Vec3) -> Self {
        match (tangent - normal * normal.dot(tangent)).try_normalize() {
            Some(x) => Self { x, y: normal.cross(x), ..Self::new(normal) },
            None => Self::new(normal),
        }
    }

    /// Adds a lobe: at most as many as the kernel has room for. In place, since lobes are large.
    #[inline(always)]
    pub(crate) fn add(&mut self, lobe: Lobe) {
        self.lobes.as_mut()[self.count] = lobe;
        self.count += 1;
    }

    pub(crate) fn lobes(&self) -> &[Lobe] {
        &self.lobes.as_ref()[..self.count]
    }

    /// A world direction in the frame of the lobes.
    pub(crate) fn local(&self, w: Vec3) -> Vec3 {
        Vec3::new(w.dot(self.x), w.dot(self.y), w.dot(self.normal))
    }

    /// A direction of the lobes' frame in the world.
    pub(crate) fn world(&self, w: Vec3) -> Vec3 {
        self.x * w.x + self.y * w.y + self.normal * w.z
    }
}
