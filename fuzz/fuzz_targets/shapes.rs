#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    firsthit_checks::shapes(data);
});
