//! Embree 4, where `EMBREE_LIB` names its shared library (the Python package `embreex` carries one).

mod api;

use std::ffi::c_int;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicIsize, Ordering::Relaxed};
use std::time::Instant;

use firsthit_measure::mesh::Mesh;
use rayon::prelude::*;

use self::api::{Api, Arguments, Hit, LANES, Packet, Pointer, Ray, RayHit, Valid, api};
use super::{Answer, Batch, Peer, Ray32};
use crate::rays::Kind;

/// A scene of one mesh.
pub struct Embree {
    api: &'static Api,
    device: Pointer,
    scene: Pointer,
    bytes: u64,
    /// Embree reads these where they are.
    _vertices: Vec<f32>,
    _triangles: Vec<[u32; 3]>,
}

// SAFETY: a committed scene may be asked from any thread, and `Drop` has it alone.
unsafe impl Send for Embree {}
// SAFETY: as above.
unsafe impl Sync for Embree {}

/// Bytes that Embree holds, all devices together.
static HELD: AtomicIsize = AtomicIsize::new(0);

unsafe extern "C" fn monitor(_: Pointer, bytes: isize, _: bool) -> bool {
    HELD.fetch_add(bytes, Relaxed);
    true
}

/// The version of the library, as 4.4.0.
///
/// # Errors
/// When there is no library.
pub fn library() -> Result<String, String> {
    let api = api()?;
    // SAFETY: a device is asked for its version, and released.
    let version = unsafe {
        let device = (api.new_device)(c"threads=1".as_ptr());
        let version = (api.device_property)(device, api::VERSION);
        (api.release_device)(device);
        version
    };
    Ok(format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100))
}

impl Embree {
    /// Builds the tree on so many threads: also the seconds that it took. The mesh is copied before.
    ///
    /// # Errors
    /// When there is no library, or it makes no device.
    pub fn new(mesh: &Mesh, robust: bool, high: bool, threads: usize) -> Result<(Self, f64), String> {
        let api = api()?;
        // 16 bytes are read at each vertex: one number after the last.
        let vertices: Vec<f32> = mesh.positions.iter().flat_map(|p| p.to_array()).chain([0.0]).collect();
        let triangles = mesh.triangles.clone();
        let config = format!("threads={threads},set_affinity=0\0");
        // SAFETY: calls in the order of Embree's manual; the buffers outlive the scene, and have so many elements.
        unsafe {
            let device = (api.new_device)(config.as_ptr().cast());
            if device.is_null() {
                return Err("Embree makes no device".into());
            }
            (api.monitor_memory)(device, monitor, null_mut());
            let before = HELD.load(Relaxed);
            let start = Instant::now();
            let scene = (api.new_scene)(device);
            (api.scene_flags)(scene, if robust { api::ROBUST } else { 0 });
            (api.scene_quality)(scene, c_int::from(high) + 1);
            let geometry = (api.new_geometry)(device, api::TRIANGLES);
            let buffer = |kind, format, data, count| (api.shared_buffer)(geometry, kind, 0, format, data, 0, 12, count);
            buffer(api::VERTEX, api::FLOAT3, vertices.as_ptr().cast(), mesh.positions.len());
            buffer(api::INDEX, api::UINT3, triangles.as_ptr().cast(), triangles.len());
            (api.commit_geometry)(geometry);
            (api.attach_geometry)(scene, geometry);
            (api.release_geometry)(geometry);
            (api.commit_scene)(scene);
            let seconds = start.elapsed().as_secs_f64();
            let bytes = (HELD.load(Relaxed) - before).max(0) as u64;
            Ok((Self { api, device, scene, bytes, _vertices: vertices, _triangles: triangles }, seconds))
        }
    }

    /// Asks 16 rays at a time, told to be coherent.
    fn packets(&self, rays: &[Ray32], answers: &mut [Answer]) {
        let mut arguments = Arguments {
            flags: api::COHERENT,
            features: u32::MAX,
            context: null_mut(),
            filter: null_mut(),
            intersect: null_mut(),
            later: [0; 4],
        };
        let mut packet = Packet { ray: [[0; LANES]; 12], hit: [[u32::MAX; LANES]; 9] };
        packet.ray[9] = [u32::MAX; LANES];
        for (rays, answers) in rays.chunks(LANES).zip(answers.chunks_mut(LANES)) {
            let mut valid = Valid([0; LANES]);
            for (k, r) in rays.iter().enumerate() {
                valid.0[k] = -1;
                let (o, d) = (r.origin, r.direction);
                for (field, x) in [o.x, o.y, o.z, r.t_min, d.x, d.y, d.z, 0.0, r.t_max].into_iter().enumerate() {
                    packet.ray[field][k] = x.to_bits();
                }
                packet.hit[6][k] = u32::MAX;
            }
            // SAFETY: the scene is committed, and all pointers are to what the function takes.
            unsafe { (self.api.intersect_packet)(valid.0.as_ptr(), self.scene, &raw mut packet, &raw mut arguments) };
            for (k, answer) in answers.iter_mut().enumerate() {
                let number = |bits: u32| f32::from_bits(bits);
                *answer = match packet.hit[6][k] {
                    u32::MAX => Answer::MISS,
                    _ => Answer {
                        t: f64::from(number(packet.ray[8][k])),
                        triangle: packet.hit[5][k],
                        u: number(packet.hit[3][k]),
                        v: number(packet.hit[4][k]),
                    },
                };
            }
        }
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: both were made by `new`, and nothing uses them any more.
        unsafe {
            (self.api.release_scene)(self.scene);
            (self.api.release_device)(self.device);
        }
    }
}

fn ray(r: &Ray32) -> Ray {
    let (origin, direction) = (r.origin.to_array(), r.direction.to_array());
    Ray { origin, t_near: r.t_min, direction, time: 0.0, t_far: r.t_max, mask: u32::MAX, id: 0, flags: 0 }
}

/// What the hit of a ray says before it is asked.
const NONE: Hit = Hit {
    normal: [0.0; 3],
    u: 0.0,
    v: 0.0,
    primitive: u32::MAX,
    geometry: u32::MAX,
    instance: u32::MAX,
    instance_primitive: u32::MAX,
};

impl Peer for Embree {
    #[inline(always)]
    fn closest(&self, r: &Ray32) -> Option<Answer> {
        let mut asked = RayHit { ray: ray(r), hit: NONE };
        // SAFETY: the scene is committed, and the pointer is to what the function takes; arguments may be null.
        unsafe { (self.api.intersect)(self.scene, &raw mut asked, null_mut()) };
        let hit = asked.hit;
        (hit.geometry != u32::MAX).then_some(Answer {
            t: f64::from(asked.ray.t_far),
            triangle: hit.primitive,
            u: hit.u,
            v: hit.v,
        })
    }

    #[inline(always)]
    fn any(&self, r: &Ray32) -> bool {
        let mut asked = ray(r);
        // SAFETY: as above.
        unsafe { (self.api.occluded)(self.scene, &raw mut asked, null_mut()) };
        asked.t_far < 0.0
    }

    fn closest_each(&self, rays: &[Ray32], answers: &mut [Answer]) {
        without_denormals(|| {
            for (ray, answer) in rays.iter().zip(answers) {
                *answer = self.closest(ray).unwrap_or(Answer::MISS);
            }
        });
    }

    fn any_each(&self, rays: &[Ray32], answers: &mut [bool]) {
        without_denormals(|| {
            for (ray, answer) in rays.iter().zip(answers) {
                *answer = self.any(ray);
            }
        });
    }

    /// Packets of 16; they make sense for camera rays.
    fn batch<'a>(&'a self, rays: &[Ray32], kind: Kind) -> Option<Box<dyn Batch + 'a>> {
        let packets = || Packets { embree: self, rays: rays.to_vec(), answers: vec![Answer::MISS; rays.len()] };
        (kind == Kind::Primary).then(|| Box::new(packets()) as Box<dyn Batch>)
    }

    fn own_bytes(&self) -> Option<u64> {
        Some(self.bytes)
    }
}

struct Packets<'a> {
    embree: &'a Embree,
    rays: Vec<Ray32>,
    answers: Vec<Answer>,
}

impl Batch for Packets<'_> {
    fn ask(&mut self, parallel: bool) {
        /// Rays that one task takes.
        const CHUNK: usize = 4096;
        let ask = |rays: &[Ray32], answers: &mut [Answer]| without_denormals(|| self.embree.packets(rays, answers));
        if parallel {
            self.rays.par_chunks(CHUNK).zip(self.answers.par_chunks_mut(CHUNK)).for_each(|(r, a)| ask(r, a));
        } else {
            ask(&self.rays, &mut self.answers);
        }
    }

    fn answers(&self) -> Vec<Answer> {
        self.answers.clone()
    }
}

/// Does something with denormal numbers taken for 0, as Embree's manual asks for.
fn without_denormals<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    {
        /// Flush to zero, and denormals are zero.
        const BITS: u32 = 0x8040;
        let mut old = 0_u32;
        // SAFETY: stores the control word of SSE, which every x86-64 has.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut old, options(nostack)) };
        let new = old | BITS;
        // SAFETY: loads a valid control word; the old one comes back below.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const new, options(nostack, readonly)) };
        let result = work();
        // SAFETY: the word that was there before.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const old, options(nostack, readonly)) };
        result
    }
    #[cfg(not(target_arch = "x86_64"))]
    work()
}

#[cfg(test)]
mod tests {
    use super::*;
    use firsthit_measure::mesh::icosphere;
    use glam::Vec3;

    /// Single rays, any hit and packets agree. Without a library there is nothing to be tested.
    #[test]
    fn all_forms_give_the_same() {
        let Ok(version) = library() else { return };
        assert!(version.starts_with("4."), "{version}");
        let (embree, _) = Embree::new(&icosphere(3), true, false, 1).unwrap();
        let rays: Vec<Ray32> = (0..100)
            .map(|k| Ray32::new(Vec3::new(0.0, 0.0, -3.0), Vec3::new(0.01 * k as f32 - 0.5, 0.1, 1.0)))
            .collect();
        let mut one = vec![Answer::MISS; rays.len()];
        embree.closest_each(&rays, &mut one);
        let mut packets = embree.batch(&rays, Kind::Primary).unwrap();
        packets.ask(false);
        let hits = |answers: &[Answer]| answers.iter().map(Answer::is_hit).collect::<Vec<_>>();
        assert_eq!(hits(&one), hits(&packets.answers()));
        assert!(hits(&one).iter().zip(&rays).all(|(&hit, r)| hit == embree.any(r)));
        assert!(hits(&one).contains(&true) && hits(&one).contains(&false));
        assert!(embree.own_bytes() > Some(1280 * 30));
    }
}
