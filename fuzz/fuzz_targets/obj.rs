#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    reprobe_fuzz::obj(data);
});
