//! The page in a result's folder.

use fixtures::command::*;

use fixtures::browser::{browser, image_colours, look};

/// A program in place of the browser's opener writes down what it is to show.
#[test]
#[cfg(target_os = "linux")]
fn the_page_opens_at_the_end() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let [file, out, shown] = ["c.npz", "result", "shown"].map(|n| folder.path().join(n));
    succeed(&["simulate", "plane", "--out", file.to_str().unwrap(), "--scan", "6", "--bin-width", "0.05"]);
    let run = || {
        std::process::Command::new(program())
            .args(["reconstruct", file.to_str().unwrap(), "--out", out.to_str().unwrap(), "--open"])
            .args(["--model", "cosine", "--lateral", "8", "--iterations", "3"])
            .env("PATH", folder.path())
            .output()
            .unwrap()
    };
    let done = run();
    assert!(done.status.success(), "{}", stderr(&done));
    assert!(stderr(&done).contains("note: no program opens"), "{}", stderr(&done));
    let opener = folder.path().join("xdg-open");
    std::fs::write(&opener, format!("#!/bin/sh\necho \"$1\" > {}\n", shown.display())).unwrap();
    std::fs::set_permissions(&opener, std::fs::Permissions::from_mode(0o755)).unwrap();
    let done = run();
    let page = out.canonicalize().unwrap().join("report.html");
    assert!(done.status.success() && !stderr(&done).contains("no program opens"), "{}", stderr(&done));
    let start = std::time::Instant::now();
    while !std::fs::read_to_string(&shown).is_ok_and(|text| text.ends_with('\n')) {
        assert!(start.elapsed().as_secs() < 10, "the opener was not started");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    assert_eq!(std::fs::read_to_string(&shown).unwrap().trim_end(), page.to_str().unwrap());
}

#[test]
fn a_result_has_a_page_that_a_browser_shows() {
    let folder = tempfile::tempdir().unwrap();
    let [file, truth, out] =
        ["c.npz", "truth.npz", "result"].map(|n| folder.path().join(n).display().to_string());
    succeed(&[
        "simulate",
        "letter-Z",
        "--out",
        &file,
        "--truth",
        &truth,
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
        "--truth",
        &truth,
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
    assert!(text.len() < 2_400_000, "{} bytes", text.len());
    for fetched in ["src=\"http", "href=\"http", "fetch(", "import("] {
        assert!(!text.contains(fetched), "the page needs no network: {fetched}");
    }
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
    assert!(shown("light").contains("laser point"), "{}", shown("light"));
    for card in [
        "Found",
        "Depth range",
        "Median depth error",
        "esidual",
        "Solve time",
        "Warnings",
        "IoU",
        "Depth error",
        "Normal error",
    ] {
        assert!(dom.contains(&format!("{card}</dt>")), "the headline lacks {card}");
    }
    assert!(
        dom.contains("<section id=\"truth\">")
            && shown("difference").contains("src=\"data:image/png;base64,")
    );
    assert!(dom.contains("Paper: depth, mean and RMS error"), "the paper's measure is on the page");
    let labelled = |label: &str| dom.contains(&format!("aria-label=\"{label}"));
    let alt = [
        "Albedo map",
        "Depth map",
        "Map of surface normals",
        "Map of the expected",
        "Total counts",
        "Histogram of pair",
    ];
    for label in alt.iter().chain(&["The surface in 3D", "Loss against"]) {
        assert!(labelled(label), "no alternative text begins with {label}");
    }
    assert!(
        !shown("space").contains("no 3D view") && shown("space").contains("<canvas"),
        "{}",
        shown("space")
    );
    assert!(
        shown("resolutions").contains("change of resolution, at which the loss rises"),
        "the loss is explained"
    );
    // The histogram follows a drag over the wall, arrow keys and the slider, and no script fails.
    let dragged = folder.path().join("dragged.html");
    let drag = "<script>addEventListener('load', () => setTimeout(() => { \
                 const say = name => document.body.append(`[${name}: ${light.innerText}${state()}]`), box = wall.getBoundingClientRect(); \
                 function state() { return ` ${slider.value} ${slider.getAttribute('aria-valuetext')} ${common.checked}`; } \
                 const point = (kind, u, v) => wall.dispatchEvent(new PointerEvent(kind, { pointerId: 1, clientX: box.left + u * box.width, clientY: box.top + v * box.height })); \
                 let pressed = false; wall.setPointerCapture = () => { pressed = true; }, wall.hasPointerCapture = () => pressed; \
                 slider.value = 1, slider.dispatchEvent(new Event('input')), say('first'); \
                 point('pointermove', .5, .5), say('hovered'), point('pointerdown', .2, .2), say('pressed'), point('pointermove', .7, .7), say('moved'); \
                 wall.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowUp' })), say('up'); \
                 slider.value = 144, slider.dispatchEvent(new Event('input')), common.click(), say('last'); }, 500));</script></html>";
    let caught = "<main><script>addEventListener('error', event => document.body.append(`[failed: ${event.message}]`));</script>";
    std::fs::write(&dragged, text.replace("<main>", caught).replace("</html>", drag)).unwrap();
    let address_of_drag = format!("file://{}", dragged.display());
    let dom = stdout(&look(browser, &address_of_drag, "900,900", folder.path(), &["--dump-dom"]));
    let said = |name: &str| {
        let from = dom.rfind(&format!("[{name}: ")).unwrap_or_else(|| panic!("{name}: {dom}"));
        dom[from..].split_once(']').unwrap().0.to_owned()
    };
    let pair = |name: &str| said(name).split(' ').nth(2).unwrap().parse::<usize>().unwrap() - 1;
    assert_eq!([pair("first"), pair("hovered"), pair("last")], [0, 0, 143], "without a press nothing moves");
    // Indices run along +y first; the wall is shown with +x to the left and +y up.
    let [press, moved, up] = ["pressed", "moved", "up"].map(pair);
    assert!(press / 12 > moved / 12 && press % 12 > moved % 12 && up == moved + 1, "{press} {moved} {up}");
    assert!(
        said("moved").contains(&format!(" {} pair {} of 144, wall point x ", moved + 1, moved + 1)),
        "{}",
        said("moved")
    );
    assert!(
        said("last").ends_with("true") && said("last").contains("bins of 30 mm, 100 ps"),
        "{}",
        said("last")
    );
    // Once in the script above.
    assert_eq!(dom.matches("[failed: ").count(), 1, "a script failed: {}", said("failed"));
    // Both kinds of files for papers are saved by buttons.
    let pressed = folder.path().join("pressed.html");
    let press = "<script>HTMLAnchorElement.prototype.click = function () { document.body.append(`[${this.download}:${this.href.slice(0, 14)}]`); }; \
                 document.querySelectorAll('#figure, #maps button').forEach(button => button.click());</script></html>";
    std::fs::write(&pressed, text.replace("</html>", press)).unwrap();
    let dom = stdout(&look(
        browser,
        &format!("file://{}", pressed.display()),
        "900,900",
        folder.path(),
        &["--dump-dom"],
    ));
    for file in
        ["[c maps.svg:blob:", "[c depth.png:data:image/png", "[c expected depth error.png:data:image/png"]
    {
        assert!(dom.contains(file), "{file}: {}", &dom[dom.rfind("<script").unwrap_or(0)..]);
    }
    let picture = folder.path().join("page.png");
    look(browser, &address, "1600,1700", folder.path(), &[&format!("--screenshot={}", picture.display())]);
    assert!(image_colours(&picture) > 200, "maps, light and surface are drawn");
}
