#![no_main]

use libfuzzer_sys::fuzz_target;
use thirdbounce_fuzz::{open, wall_and_bins};

fuzz_target!(|bytes: &[u8]| open(bytes, "one_array.h5", &wall_and_bins()));
