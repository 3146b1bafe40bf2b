//! Pages as a browser shows them.

use std::io::BufReader;
use std::path::Path;
use std::process::{Command, Output};

/// The first of these programs that is installed.
pub fn browser() -> Option<&'static str> {
    let there = |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success());
    ["chromium", "chromium-browser", "google-chrome"].into_iter().find(there)
}

/// Opens a page in a window of this size, and lets five seconds of the page's own time pass. Its profile lies in `folder`.
pub fn look(browser: &str, address: &str, size: &str, folder: &Path, more: &[&str]) -> Output {
    let profile = format!("--user-data-dir={}", folder.join("profile").display());
    let size = format!("--window-size={size}");
    // WebGL without a GPU.
    let drawn = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
    let common = ["--headless", "--no-sandbox", "--virtual-time-budget=5000"];
    Command::new(browser)
        .args(common)
        .args(drawn)
        .args([&profile, &size])
        .args(more)
        .arg(address)
        .output()
        .unwrap()
}

/// How many colours a PNG has.
pub fn image_colours(path: &Path) -> usize {
    let file = BufReader::new(std::fs::File::open(path).expect("the browser wrote a picture"));
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let size = info.color_type.samples();
    bytes.chunks_exact(size).map(|p| p.to_vec()).collect::<std::collections::BTreeSet<_>>().len()
}
