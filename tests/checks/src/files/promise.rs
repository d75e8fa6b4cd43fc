//! What is promised of any file, and of the memory and time that reading it takes.

use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::BTreeSet;
use std::fs;
use std::panic;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use firsthit_import::{Imported, Options, Play, open};
use tempfile::TempDir;

use super::sound;

/// Files that lie beside those of every check, for theirs to name.
const NEIGHBOURS: [(&str, &[u8]); 4] = [
    ("a.png", &sound::PIXEL),
    ("a.obj", b"mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n"),
    ("a.mtl", b"newmtl a\nKd 1 0 0\nmap_Kd a.png\n"),
    ("a.toml", b"objects = [{ shape = 'model', file = 'a.obj' }]"),
];

/// Longest that a file of the size that fuzzers send may be read.
const LONGEST: Duration = Duration::from_secs(20);

/// Opens the first of the files; what that gives.
///
/// - It ends: with a scene or an error, without a panic, within [`LONGEST`].
/// - It takes no more memory than 64 bytes for each byte of the files, and 256 MiB.
/// - An error names one of the files, in few words.
/// - Whatever a scene says can be relied on, see [`sound`].
/// - The same holds at a moment of its animations, if it has any.
pub fn promise(files: &[(&str, &[u8])]) -> Option<Imported> {
    let desk = Desk::take();
    let folder = desk.0.as_ref().expect("laid open").path();
    for (name, bytes) in files {
        fs::write(folder.join(name), bytes).expect("room for a file");
    }
    let bytes: usize = files.iter().chain(&NEIGHBOURS).map(|(_, bytes)| bytes.len()).sum();
    let first = folder.join(files[0].0);
    let read = |options: &Options| {
        let before = Counting::restart();
        let start = Instant::now();
        let result = open(&first, options);
        let (took, most) = (start.elapsed(), Counting::most().saturating_sub(before));
        assert!(took < LONGEST, "{bytes} bytes took {took:?}");
        assert!(most <= 64 * bytes + (256 << 20), "{bytes} bytes took {} MiB of memory", most >> 20);
        match result {
            Ok(imported) => {
                sound::check(&imported);
                Some(imported)
            }
            Err(e) => {
                let known = e.file == first || e.file.starts_with(folder) && e.file.exists();
                let said = e.to_string();
                assert!(known && said.starts_with(&*e.file.to_string_lossy()), "{said}");
                assert!(!e.kind.to_string().is_empty() && said.len() < 2000, "{} characters: {said}", said.len());
                None
            }
        }
    };
    let imported = read(&Options::default());
    if imported.as_ref().is_some_and(|i| !i.report.animations.is_empty()) {
        read(&Options { play: Some(Play { time: 0.3, shutter: 0.1, ..Play::default() }), ..Options::default() });
    }
    for (name, _) in files {
        fs::remove_file(folder.join(name)).expect("the file that was written");
    }
    imported
}

/// The folder where files are laid open, in memory where the system has such a place. One check at a time has it: what
/// others allocate must not be counted.
struct Desk(MutexGuard<'static, Option<TempDir>>);

impl Desk {
    fn take() -> Self {
        static DESK: Mutex<Option<TempDir>> = Mutex::new(None);
        let mut desk = Self(DESK.lock().unwrap_or_else(PoisonError::into_inner));
        desk.0.get_or_insert_with(|| {
            let mut named = tempfile::Builder::new();
            named.prefix("firsthit-check-");
            let folder = named.tempdir_in("/dev/shm").or_else(|_| named.tempdir()).expect("a temporary folder");
            for (name, bytes) in NEIGHBOURS {
                fs::write(folder.path().join(name), bytes).expect("room for a file");
            }
            folder
        });
        desk
    }
}

static NOW: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, which counts for the checks how much memory is taken at most. Without it as a program's
/// `#[global_allocator]`, memory is not checked.
#[derive(Clone, Copy, Debug)]
pub struct Counting;

impl Counting {
    /// Forgets what was the most; how much is taken now.
    pub fn restart() -> usize {
        let now = NOW.load(Relaxed);
        MOST.store(now, Relaxed);
        now
    }

    /// How much was taken at most since then.
    pub fn most() -> usize {
        MOST.load(Relaxed)
    }

    fn add(bytes: usize) {
        MOST.fetch_max(NOW.fetch_add(bytes, Relaxed) + bytes, Relaxed);
    }
}

// SAFETY: all is passed on to the system's allocator; only sizes are added up beside.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::add(layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        Self::add(layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // What moves is there twice for a while, but only the new pages are written.
        Self::add(size);
        NOW.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.realloc(at, layout, size) }
    }
}

/// Before fuzzing: all work is done in this thread, and a panic ends the program where it happens. Only those in the
/// libraries of others, which readers may catch, are let pass; each place where that happens is told once.
pub fn prepare() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    pool.expect("nothing has run in parallel before");
    let abort = panic::take_hook();
    let told = Mutex::new(BTreeSet::new());
    panic::set_hook(Box::new(move |info| {
        let Some(place) = info.location().filter(|l| l.file().contains("/registry/src/")) else { return abort(info) };
        if told.lock().unwrap_or_else(PoisonError::into_inner).insert((place.file().to_owned(), place.line())) {
            eprintln!("CAUGHT? {info}");
        }
    }));
}
