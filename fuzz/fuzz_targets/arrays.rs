#![no_main]

use libfuzzer_sys::fuzz_target;
use thirdbounce_fuzz::histogram;

fuzz_target!(|bytes: &[u8]| histogram(bytes, "tags"));
