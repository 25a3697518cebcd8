//! Homes of world packs.
#![no_main]

use libfuzzer_sys::fuzz_target;
use wheelarm_tests::decoders;

fuzz_target!(|bytes: &[u8]| decoders::home_toml(bytes));
