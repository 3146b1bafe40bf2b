#![no_main]

use libfuzzer_sys::fuzz_target;
use thirdbounce_fuzz::{open, wall};

fuzz_target!(|bytes: &[u8]| open(bytes, "ccsocr.mat", &wall()));
