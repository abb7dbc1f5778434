//! The target `import`.
#![no_main]

use libfuzzer_sys::fuzz_target;
use navfuse_fuzzing::named;

fuzz_target!(|bytes: &[u8]| {
    (named("import").read)(bytes);
});
