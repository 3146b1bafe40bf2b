//! Transient images of Bonn: blocks in their order, points between the corners, what is refused.

use fixtures::captures::{assert_error, histogram, place};
use fixtures::readers::transient_image;
use glam::dvec3;
use thirdbounce::capture::{Opened, PairKind, ReadOptions, read_given};
use thirdbounce::{Kind, Result};

fn opened(bytes: &[u8], given: &ReadOptions) -> Result<Opened> {
    let (_folder, path) = place("made.ti");
    std::fs::write(&path, bytes).unwrap();
    read_given(&path, given)
}

/// The image with a word of a block replaced.
fn with(block: usize, word: usize, value: [u8; 4]) -> Result<Opened> {
    let mut blocks = transient_image();
    blocks[block][4 * word..4 * word + 4].copy_from_slice(&value);
    opened(&blocks.concat(), &ReadOptions::default())
}

#[test]
fn a_transient_image_has_its_points_between_its_corners() {
    let json = br#"{"scene": "letter"}"#;
    let bytes = [&transient_image().concat()[..], json].concat();
    let Opened { capture: c, notes, dropped, .. } = opened(&bytes, &ReadOptions::default()).unwrap();
    assert_eq!((c.scan, c.bins, c.bin_width, c.t_start, dropped), ([3, 2], 20, 0.25, 0.0, 0));
    assert!(c.integer_counts && matches!(c.pair_kind(), PairKind::OneLaser), "{:?}", c.pair_kind());
    // Pixel (u, v) holds 20 (3 v + u) and on: u runs from the left to the right, v downwards, as the corners' names say.
    for (u, v) in [(0, 0), (2, 0), (0, 1), (1, 1)] {
        let first = (20 * (3 * v + u)) as f32;
        let pair = (0..6).find(|p| histogram(&c, *p)[0] == first).unwrap();
        assert_eq!(histogram(&c, pair)[19], first + 19.0);
        let wanted = dvec3(-0.5 + 0.5 * u as f64, 0.25 - 0.5 * v as f64, 0.0);
        assert!(c.sensor[pair].distance(wanted) < 1e-6, "{u} {v}: {}", c.sensor[pair]);
        assert!(c.laser[pair].length() < 1e-6);
    }
    assert_eq!(c.sensor[0].x, -0.5);
    assert_eq!(c.sensor_normal.as_ref().unwrap()[0].distance(dvec3(0.0, 0.0, 1.0)), 0.0);
    let told = notes.join("\n");
    for words in ["0.125 as the middle of the first bin", "corners", "faces (0.000, 1.000, 0.000)"] {
        assert!(told.contains(words), "{words}: {told}");
    }
}

#[test]
fn other_images_are_refused() {
    assert_error(with(0, 0, *b"TI01"), Kind::Input, &["made.ti", "TI01", "no points"]);
    assert_error(with(0, 1, [0; 4]), Kind::Input, &["mode 0", "npz"]);
    assert_error(with(0, 2, [5, 0, 0, 0]), Kind::Input, &["5 pixels"]);
    assert_error(with(0, 3, [0xFF; 4]), Kind::Input, &["does not fit"]);
    assert_error(with(0, 5, (-0.25f32).to_le_bytes()), Kind::Input, &["bin"]);
    assert_error(with(0, 6, [56, 0, 0, 0]), Kind::Input, &["56 bytes"]);
    assert_error(with(2, 15, 0.75f32.to_le_bytes()), Kind::Input, &["laser", "off the reflector"]);
    let mut flat = transient_image();
    flat[2][8..].fill(0);
    assert_error(opened(&flat.concat(), &ReadOptions::default()), Kind::Input, &["corners"]);
    let whole = transient_image().concat();
    assert_error(
        opened(&whole[..whole.len() - 1], &ReadOptions::default()),
        Kind::Input,
        &["cut or damaged"],
    );
    assert_error(
        opened(&whole, &ReadOptions::default().with_bin_width(0.01)),
        Kind::Options,
        &["leave the bin width"],
    );
}
