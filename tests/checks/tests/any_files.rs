//! The checks of files: on random bytes, on examples that were changed a little, and on every file on which one of
//! them ever failed.

use std::fs;
use std::path::Path;

use firsthit_checks::files::{Counting, FILES};

#[global_allocator]
static COUNTING: Counting = Counting;

/// The files of `fuzz/FOLDER/TARGET/`, each with its name.
fn stored(folder: &str, target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz").join(folder).join(target);
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let file = |path: &Path| (path.display().to_string(), fs::read(path).expect("a readable file"));
    let mut files: Vec<_> = entries.map(|e| file(&e.expect("a readable folder").path())).collect();
    files.sort();
    files
}

/// The same numbers in every run: exploring is for the fuzzer. SplitMix64.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) % n as u64) as usize
    }

    fn byte(&mut self) -> u8 {
        self.below(256) as u8
    }

    /// A few bytes are others, or missing, or there twice.
    fn change(&mut self, data: &mut Vec<u8>) {
        for _ in 0..1 + self.below(4) {
            let at = self.below(data.len().max(1));
            let end = data.len().min(at + 1 + self.below(8));
            match self.below(5) {
                0 => data.truncate(at),
                1 => drop(data.drain(at..end)),
                2 => data.extend_from_within(at..end),
                _ => data.iter_mut().skip(at).take(1).for_each(|b| *b = self.byte()),
            }
        }
    }
}

#[test]
fn files_of_any_bytes() {
    let mut numbers = Numbers(1);
    for (name, check) in FILES {
        for _ in 0..100 {
            let length = numbers.below(400);
            let data: Vec<u8> = (0..length).map(|_| numbers.byte()).collect();
            check(&data);
        }
        println!("{name}");
    }
}

#[test]
fn examples_are_read_whole_and_damaged() {
    let mut numbers = Numbers(2);
    for (name, check) in FILES {
        let examples = stored("examples", name);
        assert!(!examples.is_empty(), "{name}");
        for (file, whole) in examples {
            println!("{file}");
            assert!(check(&whole), "{file} is sound");
            for _ in 0..100 {
                let mut data = whole.clone();
                numbers.change(&mut data);
                check(&data);
            }
        }
    }
}

/// `fuzz/regressions/TARGET/` holds what the fuzzer found; it must stay mended.
#[test]
fn what_once_failed_stays_mended() {
    for (name, check) in FILES {
        for (file, data) in stored("regressions", name) {
            println!("{file}");
            check(&data);
        }
    }
}
