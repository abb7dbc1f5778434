//! The target `lcm`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use navfuse_fuzzing::named;

fuzz_target!(|bytes: &[u8]| {
    (named("lcm").read)(bytes);
});
