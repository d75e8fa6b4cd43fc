//! The part of Embree 4's C interface that is used, opened at run time.

use std::ffi::{c_char, c_int, c_uint, c_void};
use std::sync::OnceLock;

use libloading::Library;

pub(super) type Pointer = *mut c_void;

/// `RTCRay`.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
pub(super) struct Ray {
    pub(super) origin: [f32; 3],
    pub(super) t_near: f32,
    pub(super) direction: [f32; 3],
    pub(super) time: f32,
    pub(super) t_far: f32,
    pub(super) mask: u32,
    pub(super) id: u32,
    pub(super) flags: u32,
}

/// `RTCHit`.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
pub(super) struct Hit {
    pub(super) normal: [f32; 3],
    pub(super) u: f32,
    pub(super) v: f32,
    pub(super) primitive: u32,
    pub(super) geometry: u32,
    pub(super) instance: u32,
    pub(super) instance_primitive: u32,
}

/// `RTCRayHit`.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
pub(super) struct RayHit {
    pub(super) ray: Ray,
    pub(super) hit: Hit,
}

/// Rays of a packet (`RTCRayHit16`): each field of all rays, then the next. Floats are kept as their bits.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub(super) struct Packet {
    /// In the order of [`Ray`].
    pub(super) ray: [[u32; LANES]; 12],
    /// In the order of [`Hit`].
    pub(super) hit: [[u32; LANES]; 9],
}

/// Rays of a packet.
pub(super) const LANES: usize = 16;

/// Which rays of a packet there are: -1, else 0.
#[repr(C, align(64))]
pub(super) struct Valid(pub(super) [i32; LANES]);

/// `RTCIntersectArguments`, and room for what a later version may add.
#[repr(C)]
pub(super) struct Arguments {
    pub(super) flags: u32,
    pub(super) features: u32,
    pub(super) context: Pointer,
    pub(super) filter: Pointer,
    pub(super) intersect: Pointer,
    pub(super) later: [u64; 4],
}

/// `RTC_RAY_QUERY_FLAG_COHERENT`.
pub(super) const COHERENT: u32 = 1 << 16;
/// `RTC_SCENE_FLAG_ROBUST`.
pub(super) const ROBUST: c_int = 1 << 2;
/// `RTC_GEOMETRY_TYPE_TRIANGLE`.
pub(super) const TRIANGLES: c_int = 0;
/// `RTC_BUFFER_TYPE_INDEX`.
pub(super) const INDEX: c_int = 0;
/// `RTC_BUFFER_TYPE_VERTEX`.
pub(super) const VERTEX: c_int = 1;
/// `RTC_FORMAT_UINT3`.
pub(super) const UINT3: c_int = 0x5003;
/// `RTC_FORMAT_FLOAT3`.
pub(super) const FLOAT3: c_int = 0x9003;
/// `RTC_DEVICE_PROPERTY_VERSION`.
pub(super) const VERSION: c_int = 0;

/// Tells of memory taken and given back.
pub(super) type Monitor = unsafe extern "C" fn(Pointer, isize, bool) -> bool;

/// Declares the functions once: their fields, and how they are found.
macro_rules! functions {
    ($($field:ident = $name:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The functions of the library.
        pub(super) struct Api {
            $(pub(super) $field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
            /// Never closed: Embree's threads may outlive its last device.
            _library: Library,
        }

        impl Api {
            fn open(path: &std::ffi::OsStr) -> Result<Self, libloading::Error> {
                // SAFETY: the user names this library to be run; its types are those of Embree 4's headers.
                unsafe {
                    let library = Library::new(path)?;
                    Ok(Self { $($field: *library.get(concat!($name, "\0").as_bytes())?,)* _library: library })
                }
            }
        }
    };
}

functions! {
    new_device = "rtcNewDevice": fn(*const c_char) -> Pointer;
    release_device = "rtcReleaseDevice": fn(Pointer);
    device_property = "rtcGetDeviceProperty": fn(Pointer, c_int) -> isize;
    monitor_memory = "rtcSetDeviceMemoryMonitorFunction": fn(Pointer, Monitor, Pointer);
    new_scene = "rtcNewScene": fn(Pointer) -> Pointer;
    release_scene = "rtcReleaseScene": fn(Pointer);
    scene_flags = "rtcSetSceneFlags": fn(Pointer, c_int);
    scene_quality = "rtcSetSceneBuildQuality": fn(Pointer, c_int);
    commit_scene = "rtcCommitScene": fn(Pointer);
    new_geometry = "rtcNewGeometry": fn(Pointer, c_int) -> Pointer;
    shared_buffer = "rtcSetSharedGeometryBuffer":
        fn(Pointer, c_int, c_uint, c_int, *const c_void, usize, usize, usize);
    commit_geometry = "rtcCommitGeometry": fn(Pointer);
    attach_geometry = "rtcAttachGeometry": fn(Pointer, Pointer) -> c_uint;
    release_geometry = "rtcReleaseGeometry": fn(Pointer);
    intersect = "rtcIntersect1": fn(Pointer, *mut RayHit, *mut Arguments);
    occluded = "rtcOccluded1": fn(Pointer, *mut Ray, *mut c_void);
    intersect_packet = "rtcIntersect16": fn(*const i32, Pointer, *mut Packet, *mut Arguments);
}

/// The library that `EMBREE_LIB` names, opened once.
pub(super) fn api() -> Result<&'static Api, String> {
    static API: OnceLock<Result<Api, String>> = OnceLock::new();
    let open = || {
        let path = std::env::var_os("EMBREE_LIB").ok_or("EMBREE_LIB names no library")?;
        Api::open(&path).map_err(|e| format!("EMBREE_LIB: {e}"))
    };
    API.get_or_init(open).as_ref().map_err(Clone::clone)
}
