//! Host memory available to this process, checked before every allocation whose size a file determines.
//!
//! The available memory is the minimum of the system's (`MemAvailable`), the control groups' (version 2 or 1), the
//! limit of address space (`ulimit -v`), and [`set_limit`]. Unlimited if none of these is known.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::advice::{Advice, advice};
use crate::error::{Error, Result};

/// Allocations below this size, in bytes, are not checked.
const SMALL: u64 = 1 << 20;
/// Arrays up to this size, in bytes, may have any compression ratio.
const ORDINARY: u64 = 64 << 20;

/// Memory limit of this process, bytes.
static LIMIT: AtomicU64 = AtomicU64::new(u64::MAX);

/// Sets the memory limit of this process in bytes, or removes it. Applies to later allocations of all threads.
pub fn set_limit(bytes: Option<u64>) {
    LIMIT.store(bytes.unwrap_or(u64::MAX), Ordering::Relaxed);
}

/// Available bytes, at most those that [`set_limit`] leaves.
pub fn free() -> u64 {
    available().min(left_of_limit())
}

/// Available bytes without the limit of [`set_limit`].
pub fn available() -> u64 {
    free_below(Path::new("/"))
}

fn left_of_limit() -> u64 {
    match LIMIT.load(Ordering::Relaxed) {
        u64::MAX => u64::MAX,
        limit => limit.saturating_sub(held("VmRSS:", Path::new("/")).unwrap_or(0)),
    }
}

/// Available bytes by system, control groups and limit of address space. `root` is the root of their files.
fn free_below(root: &Path) -> u64 {
    let text = |path: &str| fs::read_to_string(root.join(path)).unwrap_or_default();
    let available = kilobytes(&text("proc/meminfo"), "MemAvailable:");
    let limits = text("proc/self/limits");
    let space =
        limits.lines().find_map(|line| line.strip_prefix("Max address space")?.split_whitespace().next());
    let space = space.and_then(|soft| soft.parse::<u64>().ok());
    let space = space.map(|soft| soft.saturating_sub(held("VmSize:", root).unwrap_or(0)));
    let groups = groups(&text("proc/self/cgroup"), &root.join("sys/fs/cgroup"));
    let groups = groups.iter().filter_map(|(folder, names)| left_in(folder, names)).min();
    [available, space, groups].into_iter().flatten().min().unwrap_or(u64::MAX)
}

/// Bytes held by this process, from a line of its status.
fn held(line: &str, root: &Path) -> Option<u64> {
    kilobytes(&fs::read_to_string(root.join("proc/self/status")).ok()?, line)
}

fn kilobytes(text: &str, line: &str) -> Option<u64> {
    let value = text.lines().find_map(|l| l.strip_prefix(line))?.split_whitespace().next()?;
    Some(value.parse::<u64>().ok()?.saturating_mul(1024))
}

/// Files of a control group: limit, usage, and the line of its statistics with reclaimable cache.
type Names = [&'static str; 3];

/// Memory control groups of this process and their ancestors. In a container, a group's path may be that of the host
/// and not exist; the container's root is then its group.
fn groups(listed: &str, mounted: &Path) -> Vec<(PathBuf, Names)> {
    const TWO: Names = ["memory.max", "memory.current", "inactive_file "];
    const ONE: Names = ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file "];
    let mut all = vec![];
    for line in listed.lines() {
        let mut parts = line.splitn(3, ':');
        let (Some(_), Some(kinds), Some(path)) = (parts.next(), parts.next(), parts.next()) else { continue };
        let (top, names) = match kinds {
            "" => (mounted.to_path_buf(), TWO),
            kinds if kinds.split(',').any(|kind| kind == "memory") => (mounted.join("memory"), ONE),
            _ => continue,
        };
        let lowest = top.join(path.trim_start_matches('/'));
        let within = lowest.ancestors().take_while(|folder| folder.starts_with(&top));
        all.extend(within.map(|folder| (folder.to_path_buf(), names)));
    }
    all
}

/// Available bytes of a control group; `None` without a limit.
fn left_in(folder: &Path, [limit, used, cached]: &Names) -> Option<u64> {
    let text = |name: &str| fs::read_to_string(folder.join(name)).ok();
    let number = |name: &str| text(name)?.trim().parse::<u64>().ok();
    let statistics = text("memory.stat").unwrap_or_default();
    let cached = statistics.lines().find_map(|line| line.strip_prefix(cached)?.trim().parse::<u64>().ok());
    let used = number(used)?.saturating_sub(cached.unwrap_or(0));
    Some(number(limit)?.saturating_sub(used))
}

/// Bytes of `count` elements of `size` bytes, saturating.
pub fn bytes(count: usize, size: usize) -> u64 {
    (count as u64).saturating_mul(size as u64)
}

/// Checks that `bytes` of memory are available for `what`, before allocation.
///
/// # Errors
/// `Kind::Memory`, with requested and available bytes.
pub fn ask(what: &str, bytes: u64) -> Result<()> {
    if bytes < SMALL {
        return Ok(());
    }
    let free = free();
    if bytes <= free { Ok(()) } else { Err(refused(what, bytes, free)) }
}

fn refused(what: &str, bytes: u64, free: u64) -> Error {
    let hint: Advice = match LIMIT.load(Ordering::Relaxed) {
        u64::MAX => advice!["use a smaller part of the capture, or close other programs"].into(),
        _ => advice!["use a smaller part of the capture, or allow more with " HostMemory].into(),
    };
    Error::memory(
        format!("{what} needs {} MiB of memory, and {} MiB are free", bytes >> 20, free >> 20),
        hint,
    )
}

/// An empty vector with capacity for `count` elements.
///
/// # Errors
/// `Kind::Memory`, as [`ask`].
pub fn room<T>(what: &str, count: usize) -> Result<Vec<T>> {
    let bytes = bytes(count, size_of::<T>());
    ask(what, bytes)?;
    let mut all = Vec::new();
    all.try_reserve_exact(count).map_err(|_| refused(what, bytes, free()))?;
    Ok(all)
}

/// A vector of `count` equal elements.
///
/// # Errors
/// `Kind::Memory`, as [`ask`].
pub fn filled<T: Clone>(what: &str, count: usize, value: T) -> Result<Vec<T>> {
    let mut all = room(what, count)?;
    all.resize(count, value);
    Ok(all)
}

/// A vector of `count` zeros, whose pages the system provides as they are written.
///
/// # Errors
/// `Kind::Memory`, as [`ask`].
pub fn zeros(what: &str, count: usize) -> Result<Vec<f32>> {
    room::<f32>(what, count)?;
    Ok(vec![0.0; count])
}

/// A vector of `count` elements of an iterator.
///
/// # Errors
/// `Kind::Memory`, as [`ask`].
pub fn collected<T>(what: &str, count: usize, values: impl IntoIterator<Item = T>) -> Result<Vec<T>> {
    let mut all = room(what, count)?;
    all.extend(values.into_iter().take(count));
    Ok(all)
}

/// Whether a large array has a compression ratio above `times`.
pub fn swells(bytes: u64, packed: u64, times: u64) -> bool {
    bytes > ORDINARY && bytes / times > packed
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        root
    }

    #[test]
    fn the_least_of_what_the_system_leaves_is_free() {
        let meminfo = ("proc/meminfo", "MemTotal:  9000 kB\nMemAvailable:    8000 kB\n");
        let limits = |soft| {
            format!("Limit   Soft Limit  Hard Limit  Units\nMax address space   {soft}   unlimited   bytes\n")
        };
        let status = ("proc/self/status", "VmSize:\t 1000 kB\nVmRSS:\t 500 kB\n");
        let free = |files: &[(&str, &str)]| free_below(system(files).path());
        assert_eq!(free(&[]), u64::MAX);
        assert_eq!(free(&[meminfo, ("proc/self/limits", &limits("unlimited")), status]), 8000 << 10);
        assert_eq!(free(&[meminfo, ("proc/self/limits", &limits("4096000")), status]), 3000 << 10);
        assert_eq!(free(&[meminfo, ("proc/self/limits", &limits("1000")), status]), 0);
        // Version 2: the group above has the smaller limit, and cached files count as free.
        let two = [
            meminfo,
            ("proc/self/cgroup", "0::/a/b\n"),
            ("sys/fs/cgroup/a/b/memory.max", "max\n"),
            ("sys/fs/cgroup/a/b/memory.current", "900\n"),
            ("sys/fs/cgroup/a/memory.max", "5000\n"),
            ("sys/fs/cgroup/a/memory.current", "3000\n"),
            ("sys/fs/cgroup/a/memory.stat", "anon 1\ninactive_file 1200\n"),
        ];
        assert_eq!(free(&two), 3200);
        // Version 1, in a container where the group's path does not exist.
        let one = [
            meminfo,
            ("proc/self/cgroup", "5:cpu:/x\n4:memory:/docker/1234\n"),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", "7000\n"),
            ("sys/fs/cgroup/memory/memory.usage_in_bytes", "6500\n"),
        ];
        assert_eq!(free(&one), 500);
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_size() {
        let error = room::<f32>("array H", usize::MAX / 8).unwrap_err();
        assert_eq!(error.kind, crate::Kind::Memory);
        assert!(error.what.contains("array H needs") && error.what.contains("MiB are free"), "{error}");
        assert!(room::<u64>("array H", usize::MAX).is_err(), "more than 64 bits can tell");
        assert_eq!(filled("points", 3, 7).unwrap(), [7; 3]);
        assert_eq!(collected("points", 2, 0..9).unwrap(), [0, 1]);
    }
}
