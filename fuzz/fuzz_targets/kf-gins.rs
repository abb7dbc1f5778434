//! The target `kf-gins`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use navfuse_fuzzing::named;

fuzz_target!(|bytes: &[u8]| {
    (named("kf-gins").read)(bytes);
});
