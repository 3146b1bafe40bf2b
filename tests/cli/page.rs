//! The page in a result's folder.

use fixtures::command::*;

use crate::browser::{browser, image_colours, look};

#[test]
fn a_result_has_a_page_that_a_browser_shows() {
    let folder = tempfile::tempdir().unwrap();
    let [file, out] = ["c.npz", "result"].map(|n| folder.path().join(n).display().to_string());
    succeed(&[
        "simulate",
        "letter-Z",
        "--out",
        &file,
        "--scan",
        "12",
        "--bin-width",
        "0.03",
        "--noise",
        "0.1",
    ]);
    succeed(&[
        "reconstruct",
        &file,
        "--out",
        &out,
        "--lateral",
        "24",
        "--iterations",
        "12",
        "--model",
        "cosine",
    ]);
    let page = std::path::Path::new(&out).join("report.html");
    let text = std::fs::read_to_string(&page).unwrap();
    assert!(text.len() < 3_000_000, "{} bytes", text.len());
    for fetched in ["src=\"http", "href=\"http", "fetch(", "import("] {
        let own =
            text.split("<script>").filter(|script| !script.contains("three.js")).any(|s| s.contains(fetched));
        assert!(!own, "the page needs no network: {fetched}");
    }
    fail(&["view", folder.path().to_str().unwrap()], 1, "there is no report.html");
    let Some(browser) = browser() else {
        eprintln!("skipped: no chromium is installed");
        return;
    };
    let address = format!("file://{}", page.display());
    let dom = stdout(&look(browser, &address, "1600,1700", folder.path(), &["--dump-dom"]));
    let shown = |id: &str| {
        let from = dom.find(&format!("id=\"{id}\"")).unwrap_or_else(|| panic!("{id}: {dom}"));
        dom[from..].chars().take(600).collect::<String>()
    };
    assert!(shown("title").contains("c.npz"));
    assert!(shown("about").contains("144 pairs") && shown("about").contains("24 x 24 pixels"));
    assert!(shown("readout").contains("depth 0."), "a pixel is chosen: {}", shown("readout"));
    assert!(shown("light").contains("measured (bars)"));
    assert!(
        !shown("space").contains("no 3D view") && shown("space").contains("<canvas"),
        "{}",
        shown("space")
    );
    let picture = folder.path().join("page.png");
    look(browser, &address, "1600,1700", folder.path(), &[&format!("--screenshot={}", picture.display())]);
    assert!(image_colours(&picture) > 200, "maps, light and surface are drawn");
}
