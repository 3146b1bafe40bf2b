//! Compiled kernels that are kept between runs: a Vulkan pipeline cache, in a file for each device, driver and version of
//! this crate. A file is only a cache: one that is damaged, too large or of another device counts as none, and one that
//! cannot be written is left out.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::SystemTime;

use ash::vk;

use super::owned::OwnedDevice;

/// Bytes of a driver's cache at most.
const LARGEST: u64 = 64 << 20;

/// Files that stay in the folder: the newest. Others are of devices, drivers or versions that are gone.
const FILES: usize = 16;

/// Bytes of a cache without kernels: the header that every driver writes.
const EMPTY: usize = 32;

/// What a file begins with. After it: the checksum of its name, then the bytes of the cache and their checksum.
const MAGIC: [u8; 8] = *b"3bounceK";
const HEADER: usize = 32;

/// How the names of files end, and of those that are being written.
const ENDING: &str = ".kernels";
const UNFINISHED: &str = ".kernels-part";

/// A device's pipeline cache. It lives as long as the device is open, with or without a file.
pub(super) struct Cache {
    pub handle: vk::PipelineCache,
    file: Option<PathBuf>,
    /// Bytes of the cache as it was read from the file.
    found: usize,
    /// The cache is a caller's, who destroys it.
    is_callers: bool,
    device: Arc<OwnedDevice>,
}

impl Cache {
    /// The cache of a device, with what its file in `folder` holds.
    pub fn open(
        device: Arc<OwnedDevice>,
        folder: Option<&Path>,
        properties: &vk::PhysicalDeviceProperties,
    ) -> Cache {
        let file = folder.map(|folder| folder.join(name_of(properties)));
        let kept = file.as_deref().and_then(read).unwrap_or_default();
        let handle = create(&device, &kept);
        Cache { handle, file, found: kept.len().max(EMPTY), is_callers: false, device }
    }

    /// A caller's cache. Null: one of its own, without a file.
    pub fn of_caller(device: Arc<OwnedDevice>, handle: vk::PipelineCache) -> Cache {
        let is_callers = handle != vk::PipelineCache::null();
        let handle = if is_callers { handle } else { create(&device, &[]) };
        Cache { handle, file: None, found: EMPTY, is_callers, device }
    }

    /// Writes the file if there are more kernels than it held. What another process has kept meanwhile stays.
    fn save(&self) {
        let Some(file) = &self.file else { return };
        if self.data().len() <= self.found {
            return;
        }
        if let Some(other) = read(file).filter(|kept| kept.len() > self.found) {
            let other = create(&self.device, &other);
            // SAFETY: both caches are the device's, and no other thread uses them.
            unsafe {
                // Without the other process's kernels this one's are still worth keeping.
                let _ = self.device.raw.merge_pipeline_caches(self.handle, &[other]);
                self.device.raw.destroy_pipeline_cache(other, None);
            }
        }
        let data = self.data();
        if data.len() as u64 <= LARGEST && write(file, &data).is_ok() {
            file.parent().into_iter().for_each(tidy);
        }
    }

    fn data(&self) -> Vec<u8> {
        if self.handle == vk::PipelineCache::null() {
            return vec![];
        }
        // SAFETY: the cache is alive.
        unsafe { self.device.raw.get_pipeline_cache_data(self.handle) }.unwrap_or_default()
    }
}

impl Drop for Cache {
    fn drop(&mut self) {
        if self.device.has_hung() || self.is_callers {
            return;
        }
        self.save();
        // SAFETY: pipelines do not need the cache after they were made; a null handle is allowed.
        unsafe { self.device.raw.destroy_pipeline_cache(self.handle, None) };
    }
}

/// A cache that begins with `kept`. Null, which is no cache, if the driver refuses.
fn create(device: &OwnedDevice, kept: &[u8]) -> vk::PipelineCache {
    let info = vk::PipelineCacheCreateInfo::default().initial_data(kept);
    // SAFETY: the device is alive, and the data outlives the call. A driver takes only data with its own header.
    unsafe { device.raw.create_pipeline_cache(&info, None) }.unwrap_or_default()
}

/// The file of a device with its driver.
fn name_of(p: &vk::PhysicalDeviceProperties) -> String {
    let uuid: String = p.pipeline_cache_uuid.iter().map(|byte| format!("{byte:02x}")).collect();
    let version = env!("CARGO_PKG_VERSION");
    format!("{:04x}-{:04x}-{:08x}-{uuid}-{version}{ENDING}", p.vendor_id, p.device_id, p.driver_version)
}

/// The cache in a file; `None` if there is none, or if it is damaged, too large or of another name.
fn read(file: &Path) -> Option<Vec<u8>> {
    let name = file.file_name()?.to_string_lossy().into_owned();
    let mut all = vec![];
    File::open(file).ok()?.take(HEADER as u64 + LARGEST + 1).read_to_end(&mut all).ok()?;
    if all.len() < HEADER {
        return None;
    }
    let data = all.split_off(HEADER);
    (all == header(&name, &data) && data.len() as u64 <= LARGEST).then_some(data)
}

/// Writes a cache: first to a file of another name, so that a reader sees the old one or the new one.
fn write(file: &Path, data: &[u8]) -> std::io::Result<()> {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let name = file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let part = format!("{}-{}{UNFINISHED}", std::process::id(), NUMBER.fetch_add(1, Relaxed));
    let part = file.with_file_name(part);
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder)?;
    }
    let written = File::create(&part).and_then(|mut to| {
        to.write_all(&header(&name, data))?;
        to.write_all(data)?;
        fs::rename(&part, file)
    });
    if written.is_err() {
        let _ = fs::remove_file(&part);
    }
    written
}

fn header(name: &str, data: &[u8]) -> Vec<u8> {
    let words = [checksum(name.as_bytes()), data.len() as u64, checksum(data)];
    MAGIC.into_iter().chain(words.into_iter().flat_map(u64::to_le_bytes)).collect()
}

/// FNV-1a over words of eight bytes, and over the rest by bytes.
fn checksum(bytes: &[u8]) -> u64 {
    let step = |hash: u64, word: u64| (hash ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
    let words = bytes.chunks_exact(8);
    let rest = words.remainder();
    let hash = words
        .map(|w| u64::from_le_bytes(w.try_into().expect("eight bytes")))
        .fold(0xcbf2_9ce4_8422_2325, step);
    rest.iter().map(|byte| u64::from(*byte)).fold(hash, step)
}

/// Removes all but the newest files of caches from a folder.
fn tidy(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut all: Vec<(SystemTime, PathBuf)> = entries
        .flatten()
        .filter(|e| {
            let name = e.file_name().to_string_lossy().into_owned();
            name.ends_with(ENDING) || name.ends_with(UNFINISHED)
        })
        .filter_map(|e| Some((e.metadata().ok()?.modified().ok()?, e.path())))
        .collect();
    all.sort();
    for (_, file) in all.iter().rev().skip(FILES) {
        let _ = fs::remove_file(file);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Gpu, GpuOptions};

    fn place() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("of/device.kernels");
        (folder, file)
    }

    fn bytes(seed: u8, count: usize) -> Vec<u8> {
        (0..count).map(|i| (i as u8).wrapping_mul(31) ^ seed).collect()
    }

    #[test]
    fn a_file_is_read_as_it_was_written_and_damage_makes_it_none() {
        let (_folder, file) = place();
        assert_eq!(read(&file), None);
        let data = bytes(3, 1003);
        write(&file, &data).unwrap();
        assert_eq!(read(&file).as_ref(), Some(&data));
        let whole = fs::read(&file).unwrap();
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 1 << (at % 8);
            fs::write(&file, &damaged).unwrap();
            assert_eq!(read(&file), None, "byte {at}");
        }
        for length in [0, 1, HEADER - 1, HEADER, whole.len() - 1] {
            fs::write(&file, &whole[..length]).unwrap();
            assert_eq!(read(&file), None, "cut after {length}");
        }
        fs::write(&file, [&whole[..], &[0]].concat()).unwrap();
        assert_eq!(read(&file), None, "longer");
        let other = file.with_file_name("other.kernels");
        fs::write(&other, &whole).unwrap();
        assert_eq!(read(&other), None, "of another device");
    }

    #[test]
    fn what_is_too_large_is_none() {
        let (_folder, file) = place();
        write(&file, &bytes(1, 64)).unwrap();
        File::options().write(true).open(&file).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(read(&file), None);
    }

    #[test]
    fn readers_see_one_of_two_files_while_both_are_written() {
        let (_folder, file) = place();
        let both = [bytes(1, 70_001), bytes(2, 90_002)];
        write(&file, &both[0]).unwrap();
        std::thread::scope(|scope| {
            for data in &both {
                scope.spawn(|| (0..200).for_each(|_| write(&file, data).unwrap()));
            }
            for _ in 0..400 {
                let seen = read(&file).expect("a whole file at all times");
                assert!(both.contains(&seen));
            }
        });
        tidy(file.parent().unwrap());
        assert_eq!(fs::read_dir(file.parent().unwrap()).unwrap().count(), 1, "nothing is left behind");
    }

    #[test]
    fn the_newest_files_stay() {
        let (_folder, file) = place();
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        let names: Vec<_> = (0..FILES + 5).map(|i| file.with_file_name(format!("{i}{ENDING}"))).collect();
        for (i, name) in names.iter().enumerate() {
            fs::write(name, "x").unwrap();
            let then = SystemTime::now() - std::time::Duration::from_secs(1000 - i as u64);
            File::options().write(true).open(name).unwrap().set_modified(then).unwrap();
        }
        let foreign = file.with_file_name("letter.txt");
        fs::write(&foreign, "not ours").unwrap();
        tidy(file.parent().unwrap());
        let stay: Vec<bool> = names.iter().map(|n| n.exists()).collect();
        assert_eq!(stay, [vec![false; 5], vec![true; FILES]].concat());
        assert!(foreign.exists());
    }

    #[test]
    fn a_place_that_cannot_be_written_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "x").unwrap();
        let inside = file.join("kernels");
        let options = GpuOptions { pipeline_cache: Some(inside.clone()), ..GpuOptions::default() };
        let gpu = Gpu::open(&options).expect("a Vulkan device: `make setup` installs lavapipe");
        drop(gpu);
        assert!(write(&inside.join("d.kernels"), b"x").is_err());
        assert_eq!(fs::read(&file).unwrap(), b"x");
    }
}
