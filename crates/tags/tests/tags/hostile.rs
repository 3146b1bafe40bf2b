//! Damaged files of time tags: an error or a sound capture, never a panic.

use fixtures::files::noise;
use tag_fixtures::tags::{WAYS, every_reader, in_a_way};

#[test]
fn damaged_tags_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let (mut made, mut refused) = (0, 0);
    for (at, (_, name, good)) in every_reader().into_iter().enumerate() {
        let path = folder.path().join(name);
        let mut noise = noise(at as u64 + 1);
        let mut random = || noise() >> 8;
        // As many as a second or two allow; the first is whole.
        for damage in 0..24 {
            let mut bad = good.clone();
            for _ in 0..damage.min(1 + damage % 4) {
                let place = random() % bad.len();
                bad[place] = random() as u8;
            }
            if damage % 6 == 5 {
                bad.truncate(random() % good.len());
            }
            std::fs::write(&path, &bad).unwrap();
            match in_a_way(&path, damage % WAYS) {
                true => made += 1,
                false => refused += 1,
            }
        }
    }
    assert!(made > 20 && refused > 20, "{made} made, {refused} refused");
}
