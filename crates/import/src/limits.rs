//! How much a file may ask for.

use crate::ErrorKind;

/// Limits against hostile files, checked before anything is allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Largest file that is read, in bytes (also after decompression).
    pub file_bytes: u64,
    /// Most bytes that may be made of each byte of the files, beyond the 256 MiB that any may become: by decompression,
    /// by decoding images, in the scene as a whole.
    pub expansion: u64,
    /// Most bytes that may be made of the files, in place of what [`expansion`](Self::expansion) says.
    pub memory: Option<u64>,
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
    /// Whether files may name others that lie outside their folder: by absolute paths, `file:` URIs, `..` or symbolic
    /// links.
    pub allow_outside: bool,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 4 << 30,
            expansion: 64,
            memory: None,
            elements: 1 << 30,
            instances: 1 << 22,
            image_side: 1 << 15,
            image_bytes: 8 << 30,
            depth: 4096,
            allow_outside: false,
        }
    }
}

impl Limits {
    /// Most bytes that may be made of so many.
    pub(crate) fn made_of(&self, read: u64) -> u64 {
        const FREE: u64 = 256 << 20;
        self.memory.unwrap_or_else(|| read.saturating_mul(self.expansion).saturating_add(FREE))
    }

    /// Most instances in a scene of so many bytes: one takes a few hundred, and twice that while it is made.
    pub(crate) fn instances_of(&self, read: u64) -> u64 {
        self.instances.min(self.made_of(read) / 1024)
    }

    /// Most bytes that so many compressed ones may become.
    pub(crate) fn decompressed(&self, compressed: u64) -> u64 {
        self.file_bytes.min(self.made_of(compressed))
    }

    /// Checks what is held against what may be made of so many bytes. `what` is in the plural.
    pub(crate) fn check_memory(&self, what: &str, held: u64, read: u64) -> Result<(), ErrorKind> {
        let most = self.made_of(read);
        if held <= most {
            return Ok(());
        }
        let why = match self.memory {
            Some(_) => "the limit on memory".to_owned(),
            None => format!("what files of {read} bytes may become"),
        };
        Err(ErrorKind::Limit(format!("{what} take {held} bytes, more than {most}, {why}")))
    }
}
