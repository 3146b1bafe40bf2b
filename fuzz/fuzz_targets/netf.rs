#![no_main]

use libfuzzer_sys::fuzz_target;
use thirdbounce::capture::ReadOptions;
use thirdbounce_fuzz::open;

fuzz_target!(|bytes: &[u8]| open(bytes, "netf.mat", &ReadOptions::default()));
