//! Checkpoint files: the state of a solve, with the figures and snapshots so far.
//!
//! Layout: 8 bytes that identify the format, 8 bytes with the length of the head, the head as JSON, one zlib stream of
//! all buffers and then all maps, 4 bytes of CRC-32 over everything before. All numbers are little-endian.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufWriter, Read, Write};
use std::path::Path;

use flate2::{Compression, Crc, read::ZlibDecoder, write::ZlibEncoder};
use serde::{Deserialize, Serialize};

use super::Request;
use crate::files::atomic::{self, cannot};
use crate::maps::Maps;
use crate::measure::Metrics;
use crate::solve::{Checkpoint, Identity, TracePoint};
use crate::estimation::Estimates;
use crate::{Error, Result};

/// The last byte is the version of the format.
const MAGIC: [u8; 8] = *b"TBSTATE\x02";

/// A solver's state, and what the caller gathered until then.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
    /// The solver's state.
    pub state: Checkpoint,
    /// Figures after the measured iterations.
    pub along: BTreeMap<usize, Metrics>,
    /// Maps after the iterations that were asked for.
    pub snapshots: Vec<(usize, Maps)>,
    /// What trials found before the solve.
    pub found: Estimates,
}

impl Kept {
    /// Checks that the request asks for no snapshot that is over.
    ///
    /// # Errors
    /// The request asks for maps of an iteration that is over, and the checkpoint does not hold them.
    pub(super) fn check(&self, request: &Request) -> Result<()> {
        let done = self.state.iteration;
        let missing = |i: &&usize| **i <= done && !self.snapshots.iter().any(|s| s.0 == **i);
        match request.snapshots.iter().find(missing) {
            Some(beyond) => Err(Error::options(
                format!("the checkpoint after iteration {done} has no snapshot of iteration {beyond}"),
                format!("ask for snapshots after iteration {done}, or start without the checkpoint"),
            )),
            None => Ok(()),
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Head {
    identity: Identity,
    iteration: usize,
    level: usize,
    first: usize,
    active: usize,
    pending: Vec<[usize; 3]>,
    /// Bits of the values: JSON cannot hold a loss that is infinite or NaN.
    trace: Vec<[u64; 9]>,
    pairs: u64,
    seconds: f64,
    gpu_seconds: f64,
    along: BTreeMap<usize, Metrics>,
    snapshots: Vec<SnapshotHead>,
    found: Estimates,
    buffers: Vec<(String, usize)>,
}

#[derive(Serialize, Deserialize)]
struct SnapshotHead {
    iteration: usize,
    nx: usize,
    ny: usize,
    extent: [f64; 4],
    mask_fraction: Option<f64>,
}

/// Writes a checkpoint, whole or not at all.
///
/// # Errors
/// A file that cannot be written.
pub fn write(path: &Path, kept: &Kept) -> Result<()> {
    let state = &kept.state;
    let head = Head {
        identity: state.identity.clone(),
        iteration: state.iteration,
        level: state.level,
        first: state.first,
        active: state.active,
        pending: state.pending.clone(),
        trace: state.trace.iter().map(bits).collect(),
        pairs: state.pairs,
        seconds: state.seconds,
        gpu_seconds: state.gpu_seconds,
        along: kept.along.clone(),
        snapshots: kept.snapshots.iter().map(|(iteration, m)| snapshot_head(*iteration, m)).collect(),
        found: kept.found.clone(),
        buffers: state.buffers.iter().map(|(n, b)| (n.clone(), b.len())).collect(),
    };
    let head = serde_json::to_vec(&head).map_err(|e| {
        Error::output(format!("{}: cannot be packed: {e}", path.display()), "report this as a bug")
    })?;
    atomic::replace(path, |temporary| {
        let pack = || -> std::io::Result<()> {
            let mut file = Summed { to: BufWriter::new(File::create(temporary)?), crc: Crc::new() };
            file.write_all(&MAGIC)?;
            file.write_all(&(head.len() as u64).to_le_bytes())?;
            file.write_all(&head)?;
            // A state is large and soon replaced, so the fastest level is used.
            let mut packed = ZlibEncoder::new(file, Compression::fast());
            for content in state.buffers.values() {
                packed.write_all(content)?;
            }
            for (_, maps) in &kept.snapshots {
                packed.write_all(bytemuck::cast_slice(&maps.albedo))?;
                packed.write_all(bytemuck::cast_slice(&maps.depth))?;
                packed.write_all(bytemuck::cast_slice(&maps.normal))?;
            }
            let Summed { mut to, crc } = packed.finish()?;
            to.write_all(&crc.sum().to_le_bytes())?;
            to.flush()
        };
        pack().map_err(|e| cannot(path, &e))
    })
}

/// Reads a checkpoint.
///
/// # Errors
/// A file that cannot be read, is not a checkpoint, or is cut off or damaged; each with its path.
pub fn read(path: &Path) -> Result<Kept> {
    let unread = |e: std::io::Error| {
        Error::input(format!("the checkpoint cannot be read: {e}"), "check the path of the checkpoint")
    };
    let whole = fs::read(path).map_err(unread).and_then(|bytes| parse(&bytes));
    whole.map_err(|e| e.at(path.display()))
}

fn parse(bytes: &[u8]) -> Result<Kept> {
    let mend = "give a file that an earlier run wrote as its checkpoint";
    if bytes.len() < 20 || bytes[..7] != MAGIC[..7] {
        return Err(Error::input("this is not a checkpoint", mend));
    }
    if bytes[7] != MAGIC[7] {
        return Err(Error::input(
            format!("the checkpoint has format {}, this program reads {}", bytes[7], MAGIC[7]),
            "resume with the version that wrote it, or start without the checkpoint",
        ));
    }
    let damaged = || Error::input("the checkpoint is cut off or damaged", "start without the checkpoint");
    let (body, sum) = bytes.split_at(bytes.len() - 4);
    let mut crc = Crc::new();
    crc.update(body);
    if crc.sum().to_le_bytes() != sum {
        return Err(damaged());
    }
    let length = u64::from_le_bytes(body[8..16].try_into().map_err(|_| damaged())?);
    let length = usize::try_from(length).ok().filter(|l| *l <= body.len() - 16).ok_or_else(damaged)?;
    let (head, packed) = body[16..].split_at(length);
    let head: Head = serde_json::from_slice(head).map_err(|_| damaged())?;
    let maps = head.snapshots.iter().map(|s| s.nx.saturating_mul(s.ny).saturating_mul(20));
    let claimed = head.buffers.iter().map(|b| b.1).chain(maps).fold(0usize, usize::saturating_add);
    // Deflate compresses by a factor of about a thousand at most.
    if claimed / 1100 > packed.len() {
        return Err(damaged());
    }
    let mut content = ZlibDecoder::new(packed);
    let mut take = |bytes: usize| -> Result<Vec<u8>> {
        let mut all = vec![0; bytes];
        content.read_exact(&mut all).map_err(|_| damaged())?;
        Ok(all)
    };
    let mut buffers = BTreeMap::new();
    for (name, bytes) in &head.buffers {
        buffers.insert(name.clone(), take(*bytes)?);
    }
    let mut snapshots = vec![];
    for s in &head.snapshots {
        let n = s.nx * s.ny;
        let albedo: Vec<f32> = bytemuck::pod_collect_to_vec(&take(n * 4)?);
        let mut maps = Maps {
            nx: s.nx,
            ny: s.ny,
            extent: s.extent,
            depth: bytemuck::pod_collect_to_vec(&take(n * 4)?),
            normal: bytemuck::pod_collect_to_vec(&take(n * 12)?),
            mask: vec![],
            mask_fraction: s.mask_fraction,
            confidence: None,
            behind: None,
            albedo,
        };
        maps.set_mask(s.mask_fraction);
        snapshots.push((s.iteration, maps));
    }
    let state = Checkpoint {
        identity: head.identity,
        iteration: head.iteration,
        level: head.level,
        first: head.first,
        active: head.active,
        pending: head.pending,
        trace: head.trace.iter().map(point).collect(),
        pairs: head.pairs,
        seconds: head.seconds,
        gpu_seconds: head.gpu_seconds,
        buffers,
    };
    Ok(Kept { state, along: head.along, snapshots, found: head.found })
}

fn snapshot_head(iteration: usize, m: &Maps) -> SnapshotHead {
    SnapshotHead { iteration, nx: m.nx, ny: m.ny, extent: m.extent, mask_fraction: m.mask_fraction }
}

fn bits(p: &TracePoint) -> [u64; 9] {
    let [iteration, lateral, pairs, active] = [p.iteration, p.lateral, p.pairs, p.active].map(|n| n as u64);
    let [seconds, gpu, ratio, loss, data] =
        [p.seconds, p.gpu_seconds, p.active_ratio, p.loss, p.data_loss].map(f64::to_bits);
    [iteration, seconds, gpu, lateral, pairs, active, ratio, loss, data]
}

fn point(bits: &[u64; 9]) -> TracePoint {
    let [iteration, seconds, gpu, lateral, pairs, active, ratio, loss, data] = *bits;
    TracePoint {
        iteration: iteration as usize,
        seconds: f64::from_bits(seconds),
        gpu_seconds: f64::from_bits(gpu),
        lateral: lateral as usize,
        pairs: pairs as usize,
        active: active as usize,
        active_ratio: f64::from_bits(ratio),
        loss: f64::from_bits(loss),
        data_loss: f64::from_bits(data),
    }
}

/// A writer that computes the CRC-32 of what passes through.
struct Summed<W> {
    to: W,
    crc: Crc,
}

impl<W: Write> Write for Summed<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let n = self.to.write(bytes)?;
        self.crc.update(&bytes[..n]);
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.to.flush()
    }
}
