//! Results of suites and training ledgers.
#![no_main]

use libfuzzer_sys::fuzz_target;
use wheelarm_tests::decoders;

fuzz_target!(|bytes: &[u8]| decoders::suite_results(bytes));
