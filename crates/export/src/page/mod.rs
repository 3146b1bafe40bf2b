//! `report.html`: a result as one self-contained page: headline, maps with axes and linked cursors, measured
//! histograms and the light of the maps, the surface in 3D, the trace, settings and notes. Colours follow the
//! reader's light or dark setting.
//!
//! The page renders everything from maps and histograms quantised to 16 bits and from the report.

use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};

use super::report::Report;
use super::text::escaped;
use super::{depth_difference, png, print};
use crate::capture::Capture;
use crate::error::{Error, Result};
use crate::files::atomic;
use crate::maps::{Maps, Truth};

const PAGE: &str = include_str!("page.html");
const SCRIPT: &str = include_str!("page.js");

/// Maximum number of histogram values on the page, and pixels along a side of its maps, which keeps the page below 2.4
/// MB.
const MOST_COUNTS: usize = 280_000;
const MOST_PIXELS: usize = 256;

/// Histograms of a page: fewer pairs and wider bins than a large capture has.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PageHistograms {
    all_pairs: usize,
    all_bins: usize,
    bins: usize,
    bin_width: f64,
    t_start: f64,
    /// x, y, z of each pair, metres.
    laser: Vec<f32>,
    sensor: Vec<f32>,
    /// Whether the laser is the scanned side.
    laser_scans: bool,
    /// Full width at half maximum of the impulse response, metres of path.
    pulse: f64,
    counts: QuantisedValues,
}

impl PageHistograms {
    /// The histograms of a capture, reduced.
    pub fn of(capture: &Capture) -> PageHistograms {
        // Bins are halved before pairs: a histogram's shape remains recognisable.
        let (mut sum, mut step) = (1, 1);
        let size = |sum: usize, step: usize| capture.bins.div_ceil(sum) * capture.pair_count().div_ceil(step);
        while size(sum, step) > MOST_COUNTS {
            if capture.bins / sum > 128 { sum *= 2 } else { step += 1 }
        }
        let pairs = (0..capture.pair_count()).step_by(step);
        let row = |pair: usize| capture.histogram(pair).chunks(sum).map(|bins| bins.iter().sum::<f32>());
        let points = |all: &[glam::DVec3]| -> Vec<f32> {
            pairs.clone().flat_map(|p| all[p].to_array().map(|v| v as f32)).collect()
        };
        let counts: Vec<f32> = pairs.clone().flat_map(row).collect();
        PageHistograms {
            all_pairs: capture.pair_count(),
            all_bins: capture.bins,
            bins: capture.bins.div_ceil(sum),
            bin_width: capture.bin_width * sum as f64,
            t_start: capture.t_start,
            laser: points(&capture.laser),
            sensor: points(&capture.sensor),
            laser_scans: capture.laser_scans(),
            pulse: capture.pulse.as_ref().map_or(0.0, |p| p.fwhm()),
            counts: QuantisedValues::of(counts.into_iter()),
        }
    }
}

/// Values quantised to 16 bits over their range; 65535 is NaN.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct QuantisedValues {
    low: f32,
    high: f32,
    /// Little-endian words in base64.
    values: String,
}

impl QuantisedValues {
    fn of(values: impl Iterator<Item = f32> + Clone) -> QuantisedValues {
        let finite = || values.clone().filter(|v| v.is_finite());
        let low = finite().fold(f32::INFINITY, f32::min);
        let high = finite().fold(f32::NEG_INFINITY, f32::max);
        let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
        let scale = if high > low { 65534.0 / (f64::from(high) - f64::from(low)) } else { 0.0 };
        let word = |v: f32| match v.is_finite() {
            true => ((f64::from(v) - f64::from(low)) * scale).round() as u16,
            false => u16::MAX,
        };
        let bytes: Vec<u8> = values.flat_map(|v| word(v).to_le_bytes()).collect();
        QuantisedValues { low, high, values: STANDARD.encode(bytes) }
    }
}

#[derive(Serialize)]
struct PageMaps {
    nx: usize,
    ny: usize,
    extent: [f64; 4],
    albedo: QuantisedValues,
    depth: QuantisedValues,
    depth_error: Option<QuantisedValues>,
    probability: Option<QuantisedValues>,
    /// x, y, z times 127.
    normal: String,
    mask: String,
}

impl PageMaps {
    fn of(maps: &Maps) -> PageMaps {
        let step = maps.nx.max(maps.ny).div_ceil(MOST_PIXELS).max(1);
        let [nx, ny] = [maps.nx, maps.ny].map(|n| n / step);
        let pixels: Vec<usize> = (0..nx)
            .flat_map(|x| (0..ny).map(move |y| (x, y)))
            .map(|(x, y)| x * step * maps.ny + y * step)
            .collect();
        let of = |all: &[f32]| QuantisedValues::of(pixels.iter().map(|p| all[*p]));
        // The range of the values, and so their steps, is that of pixels that are shown.
        let of_surface = |all: &[f32]| {
            QuantisedValues::of(pixels.iter().map(|p| if maps.mask[*p] { all[*p] } else { f32::NAN }))
        };
        let normal = pixels.iter().flat_map(|p| maps.normal[*p]);
        let normal: Vec<u8> = normal.map(|v| (v * 127.0).round() as i8 as u8).collect();
        let mask: Vec<u8> = pixels.iter().map(|p| maps.mask[*p].into()).collect();
        PageMaps {
            nx,
            ny,
            extent: maps.extent,
            albedo: of(&maps.albedo),
            depth: of_surface(&maps.depth),
            depth_error: maps.depth_error.as_deref().map(of_surface),
            probability: maps.probability.as_deref().map(of),
            normal: STANDARD.encode(normal),
            mask: STANDARD.encode(mask),
        }
    }
}

#[derive(Serialize)]
struct Data<'d> {
    title: &'d str,
    maps: PageMaps,
    light: &'d PageHistograms,
    report: &'d Report,
    /// PNG of the depth differences in base64.
    #[serde(skip_serializing_if = "Option::is_none")]
    difference: Option<String>,
    /// SVG of [`print::figure`].
    figure: String,
}

/// Writes the page of a result with the given title, and the differences from truth.
///
/// # Errors
/// `Kind::Input` if the maps' sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(
    path: &Path,
    title: &str,
    maps: &Maps,
    light: &PageHistograms,
    report: &Report,
    truth: Option<&Truth>,
) -> Result<()> {
    maps.check()?;
    let packed = |truth: &Truth| -> Result<String> {
        truth.check()?;
        Ok(STANDARD.encode(png::packed(&depth_difference::picture(maps, truth))?))
    };
    let difference = truth.map(packed).transpose()?;
    let figure = print::figure(maps, MOST_PIXELS)?.svg();
    let data = Data { title, maps: PageMaps::of(maps), light, report, difference, figure };
    let json = serde_json::to_string(&data).map_err(|e| {
        Error::output(format!("{}: the page has no JSON ({e})", path.display()), "report this as a defect")
    })?;
    atomic::write(path, page(title, &json).as_bytes())
}

/// The page with its placeholders replaced in order; inserted text is not searched for placeholders.
fn page(title: &str, json: &str) -> String {
    let (mut page, mut rest) = (String::new(), PAGE);
    // No text may end its containing element.
    let (title, json) = (escaped(title), json.replace('<', "\\u003c"));
    for (gap, text) in [("TITLE", &*title), ("DATA", &json), ("SCRIPT", SCRIPT)] {
        let (before, after) = rest.split_once(gap).unwrap_or((rest, ""));
        page.extend([before, text]);
        rest = after;
    }
    page + rest
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn a_title_is_no_gap() {
        let page = page("DATA.npz of LIBRARY", r#"{"title":"</script>"}"#);
        assert!(page.contains("<title>thirdbounce: DATA.npz of LIBRARY</title>"));
        assert!(
            page.contains(r#"<script id="data" type="application/json">{"title":"\u003c/script>"}</script>"#)
        );
        assert!(page.ends_with(&format!("{SCRIPT}</script>\n</html>\n")));
    }

    #[test]
    fn numbers_are_words_over_their_range() {
        let numbers = QuantisedValues::of([1.0, f32::NAN, 3.0, 2.0].into_iter());
        assert_eq!((numbers.low, numbers.high), (1.0, 3.0));
        let words = STANDARD.decode(numbers.values).unwrap();
        assert_eq!(words, [0u16, 65535, 65534, 32767].map(u16::to_le_bytes).concat());
        let none = QuantisedValues::of([f32::NAN].into_iter());
        assert_eq!((none.low, none.high), (0.0, 0.0));
        let same = QuantisedValues::of([5.0; 2].into_iter());
        assert_eq!(STANDARD.decode(same.values).unwrap(), [0; 4]);
    }

    #[test]
    fn the_largest_depth_and_error_are_those_of_pixels_that_are_shown() {
        let maps = Maps {
            depth: vec![0.5, 0.6, 40.0, 0.7],
            depth_error: Some(vec![0.001, 0.004, 25.0, 0.002]),
            mask: vec![true, true, false, true],
            ..Maps::empty([2, 2], [0.0, 1.0, 0.0, 1.0])
        };
        let shown = PageMaps::of(&maps);
        let error = shown.depth_error.unwrap();
        assert_eq!((shown.depth.high, error.low, error.high), (0.7, 0.001, 0.004));
        let words = STANDARD.decode(error.values).unwrap();
        assert_eq!(words[2..6], [65534u16, 65535].map(u16::to_le_bytes).concat());
    }

    #[test]
    fn large_captures_show_fewer_pairs_and_wider_bins() {
        let points: Vec<DVec3> = (0..10_000).map(|i| DVec3::new(f64::from(i), 0.0, 0.0)).collect();
        let mut capture = Capture::new([100, 100], points.clone(), points, 600, 0.01, vec![1.0; 6_000_000]);
        capture.t_start = 0.5;
        let light = PageHistograms::of(&capture);
        let pairs = light.laser.len() / 3;
        assert!(
            pairs * light.bins <= MOST_COUNTS && pairs > 1000 && light.bins >= 64,
            "{pairs} x {}",
            light.bins
        );
        assert_eq!((light.all_pairs, light.all_bins, light.t_start), (10_000, 600, 0.5));
        assert_eq!(light.bin_width, 0.01 * (600 / light.bins) as f64);
        let words = STANDARD.decode(&light.counts.values).unwrap();
        assert_eq!(words.len(), 2 * pairs * light.bins);
    }

    #[test]
    fn no_text_ends_the_page_early() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("report.html");
        let maps = Maps {
            albedo: vec![1.0],
            depth: vec![0.5],
            normal: vec![[0.0, 0.0, -1.0]],
            mask: vec![true],
            ..Maps::empty([1, 1], [0.0, 1.0, 0.0, 1.0])
        };
        let light = PageHistograms::of(&Capture::new(
            [1, 1],
            vec![DVec3::ZERO],
            vec![DVec3::ZERO],
            2,
            0.5,
            vec![1.0, 0.0],
        ));
        let report: Report = serde_json::from_value(serde_json::json!({
            "version": "0", "device": {"name": "d", "driver": "", "kind": ""}, "settings": {"notes": ["</script><b>"]}, "trace": [], "metrics": null,
            "capture": crate::capture::Summary::of(&Capture::new([1, 1], vec![DVec3::ZERO], vec![DVec3::ZERO], 1, 0.5, vec![1.0])),
            "plan": {"variants": [], "left_out": [], "buffers": {}, "full": false},
            "totals": {"load_s": 0.0, "solve_s": 0.0, "export_s": 0.0, "pairs": 0.0, "pairs_per_s": 0.0, "peak_device_bytes": 0},
        }))
        .unwrap();
        write(&file, "a </script> & \"b\"", &maps, &light, &report, None).unwrap();
        let page = std::fs::read_to_string(&file).unwrap();
        assert_eq!(page.matches("</script>").count(), 2, "one for each element");
        assert!(page.contains("<title>thirdbounce: a &lt;/script&gt; &amp; &quot;b&quot;</title>"));
        assert!(!page.contains("http://") || !page.contains("src=\"http"), "nothing is fetched");
        assert!(page.len() < 2_400_000);
    }
}
