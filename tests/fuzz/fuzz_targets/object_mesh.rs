//! Meshes of objects that are imported.
#![no_main]

use libfuzzer_sys::fuzz_target;
use wheelarm_tests::decoders;

fuzz_target!(|bytes: &[u8]| decoders::object_mesh(bytes));
