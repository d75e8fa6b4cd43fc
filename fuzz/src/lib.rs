//! What the fuzz targets of file formats have in common.

/// A fuzz target of a check of files: one that counts memory too.
#[macro_export]
macro_rules! files {
    ($check:ident) => {
        #[global_allocator]
        static COUNTING: firsthit_checks::files::Counting = firsthit_checks::files::Counting;

        libfuzzer_sys::fuzz_target!(init: firsthit_checks::files::prepare(), |data: &[u8]| {
            firsthit_checks::files::$check(data);
        });
    };
}
