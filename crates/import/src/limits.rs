//! How much a file may ask for.

/// Limits against hostile files, checked before anything is allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Largest file that is read, in bytes (also after decompression).
    pub file_bytes: u64,
    /// Most bytes that decompression may make of each compressed byte, beyond the 256 MiB that any file may become.
    pub expansion: u64,
    /// Most vertices, and most triangles, in one scene before instancing.
    pub elements: u64,
    /// Most instances, lights and cameras in one scene; one of a long name counts as several.
    pub instances: u64,
    /// Widest or highest image, in pixels.
    pub image_side: u32,
    /// Most bytes of decoded images in all.
    pub image_bytes: u64,
    /// Deepest nesting of nodes or of files that include files.
    pub depth: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 4 << 30,
            expansion: 64,
            elements: 1 << 30,
            instances: 1 << 22,
            image_side: 1 << 15,
            image_bytes: 8 << 30,
            depth: 4096,
        }
    }
}

impl Limits {
    /// Most bytes that so many compressed ones may become.
    pub(crate) fn decompressed(&self, compressed: u64) -> u64 {
        const FREE: u64 = 256 << 20;
        self.file_bytes.min(compressed.saturating_mul(self.expansion).saturating_add(FREE))
    }
}
