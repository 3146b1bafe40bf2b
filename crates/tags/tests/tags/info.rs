//! What `info` shows of time tags, and other verbs say of them.

use fixtures::command::{fail, succeed};
use serde_json::Value;
use thirdbounce::files::archive::npz_bytes;
use thirdbounce::files::array::Array;

#[test]
fn time_tags_are_known_to_every_verb() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let writer = tag_fixtures::tags::scanned(0x0001_0207);
    let (ptu, csv) = (path("scan.ptu"), path("scan.csv"));
    std::fs::write(&ptu, writer.file(4e-12, 1e-7, &[])).unwrap();
    let shown = succeed(&["info", &ptu]);
    for words in [
        "tags      generic (MultiHarp, PicoHarp 330), T2",
        "channel   2: 468 photons",
        "marker    1: 13",
        "marker    3: 4",
        "11.3350 MHz",
        "duration  ",
        "thirdbounce histogram ",
        " --wall SIZE --lines 1,2 ",
    ] {
        assert!(shown.contains(words), "{words} is not in\n{shown}");
    }
    let json: Value = serde_json::from_str(&succeed(&["info", &ptu, "--json"])).unwrap();
    assert_eq!((json["channels"][0][1].as_u64(), json["markers"][0][1].as_u64()), (Some(468), Some(13)));
    for arguments in
        [&["convert", &ptu, &path("made.npz")][..], &["reconstruct", &ptu, "--out", &path("out")]]
    {
        fail(arguments, 1, "holds PicoQuant time tags (.ptu), without the wall points of a capture");
    }
    // Unspecified channels are guessed: laser pulses have the most tags.
    let tags = tag_fixtures::tags::csv(&writer.wanted).replace("\n0,", "\n1,");
    std::fs::write(&csv, &tags).unwrap();
    let shown = succeed(&["info", &csv]);
    assert!(shown.contains("channel   2: 468 photons") && shown.contains("--sync-channel 1"), "{shown}");
    // Arrays are known by their names.
    let column = |at: usize| -> Vec<i64> {
        tags.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().trim().parse().unwrap()).collect()
    };
    let arrays = ["channels", "timestamps"].iter().enumerate().map(|(at, name)| {
        let values = column(at);
        (*name, Array::from_i64(&[values.len()], &values))
    });
    std::fs::write(path("tags.npz"), npz_bytes(&arrays.collect::<Vec<_>>()).unwrap()).unwrap();
    assert!(succeed(&["info", &path("tags.npz")]).contains("channel   2: 468 photons"));
    fail(&["reconstruct", &path("tags.npz"), "--out", &path("out")], 1, "holds time tags as arrays");
}
