//! The target `imc`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use navfuse_fuzzing::named;

fuzz_target!(|bytes: &[u8]| {
    (named("imc").read)(bytes);
});
