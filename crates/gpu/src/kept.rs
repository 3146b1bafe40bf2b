//! The pipeline cache in a file: the driver's data unchanged. A file with another vendor, device or driver in its
//! header, or above the size limit, is discarded; write failures are ignored.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ash::vk;

use super::owned::OwnedDevice;

/// Maximum file size, bytes.
const LARGEST: u64 = 64 << 20;

/// Bytes of `VkPipelineCacheHeaderVersionOne`: header size, version, vendor, device, UUID of the pipeline cache.
const HEADER: usize = 32;

const FILE: &str = "pipelines.bin";

/// Whether a folder holds the kernels of an earlier run.
#[doc(hidden)]
pub fn kernels_are_kept(folder: &Path) -> bool {
    folder.join(FILE).is_file()
}

/// A device's pipeline cache, with or without a file.
pub(super) struct Cache {
    pub handle: vk::PipelineCache,
    file: Option<PathBuf>,
    /// Bytes of the cache as read from the file.
    found: usize,
    /// The cache belongs to the application.
    is_external: bool,
    device: Arc<OwnedDevice>,
}

impl Cache {
    /// Cache of a device, initialised from the file in `folder`.
    pub fn open(
        device: Arc<OwnedDevice>,
        folder: Option<&Path>,
        properties: &vk::PhysicalDeviceProperties,
    ) -> Cache {
        let file = folder.map(|folder| folder.join(FILE));
        let kept = file.as_deref().and_then(|file| read(file, &header(properties))).unwrap_or_default();
        let handle = create(&device, &kept);
        Cache { handle, file, found: kept.len().max(HEADER), is_external: false, device }
    }

    /// An application's cache. Null: a new one without a file.
    pub fn of_external(device: Arc<OwnedDevice>, handle: vk::PipelineCache) -> Cache {
        let is_external = handle != vk::PipelineCache::null();
        let handle = if is_external { handle } else { create(&device, &[]) };
        Cache { handle, file: None, found: HEADER, is_external, device }
    }

    /// Writes the file if pipelines were added.
    fn save(&self) {
        let Some(file) = self.file.as_ref().filter(|_| self.handle != vk::PipelineCache::null()) else {
            return;
        };
        // SAFETY: the cache is alive.
        let data = unsafe { self.device.raw.get_pipeline_cache_data(self.handle) }.unwrap_or_default();
        if data.len() > self.found && data.len() as u64 <= LARGEST {
            // Failure only costs time.
            let _ = write(file, &data);
        }
    }
}

impl Drop for Cache {
    fn drop(&mut self) {
        if self.device.has_hung() || self.is_external {
            return;
        }
        self.save();
        // SAFETY: pipelines do not depend on the cache; a null handle is allowed.
        unsafe { self.device.raw.destroy_pipeline_cache(self.handle, None) };
    }
}

/// A cache initialised from `kept`. Null if the driver refuses.
fn create(device: &OwnedDevice, kept: &[u8]) -> vk::PipelineCache {
    let info = vk::PipelineCacheCreateInfo::default().initial_data(kept);
    // SAFETY: the device is alive, and the data outlives the call. Drivers verify the header.
    unsafe { device.raw.create_pipeline_cache(&info, None) }.unwrap_or_default()
}

/// Header written by this driver for this device.
fn header(p: &vk::PhysicalDeviceProperties) -> Vec<u8> {
    let version = vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32;
    let words = [HEADER as u32, version, p.vendor_id, p.device_id].map(u32::to_le_bytes);
    [words.as_flattened(), &p.pipeline_cache_uuid].concat()
}

/// Cache data in a file; `None` without a matching header.
fn read(file: &Path, header: &[u8]) -> Option<Vec<u8>> {
    let mut all = vec![];
    File::open(file).ok()?.take(LARGEST + 1).read_to_end(&mut all).ok()?;
    (all.starts_with(header) && all.len() as u64 <= LARGEST).then_some(all)
}

/// Replaces the file atomically.
fn write(file: &Path, data: &[u8]) -> std::io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let mut part = tempfile::NamedTempFile::new_in(folder)?;
    part.write_all(data)?;
    part.persist(file)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Gpu, GpuOptions};

    #[test]
    fn a_file_of_another_driver_or_too_large_is_discarded() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("of").join(FILE);
        let mut properties = vk::PhysicalDeviceProperties { vendor_id: 0x10005, ..Default::default() };
        properties.pipeline_cache_uuid[3] = 7;
        let own = header(&properties);
        assert_eq!((own.len(), read(&file, &own)), (HEADER, None));
        let data = [&own[..], b"pipelines"].concat();
        write(&file, &data).unwrap();
        assert_eq!(read(&file, &own), Some(data.clone()));
        let other = |change: fn(&mut vk::PhysicalDeviceProperties)| {
            let mut other = properties;
            change(&mut other);
            read(&file, &header(&other))
        };
        assert_eq!(other(|p| p.vendor_id += 1), None);
        assert_eq!(other(|p| p.device_id += 1), None);
        assert_eq!(other(|p| p.pipeline_cache_uuid[15] += 1), None);
        fs::write(&file, &data[..HEADER - 1]).unwrap();
        assert_eq!(read(&file, &own), None, "cut");
        write(&file, &data).unwrap();
        File::options().write(true).open(&file).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(read(&file, &own), None);
        assert_eq!(fs::read_dir(file.parent().unwrap()).unwrap().count(), 1, "nothing is left behind");
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
        assert!(write(&inside.join(FILE), b"x").is_err());
        assert_eq!(fs::read(&file).unwrap(), b"x");
    }
}
