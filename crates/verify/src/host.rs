//! Schedules on the CPU, in float64, by the twins.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use super::device::{code_of, decode, read_words};
use crate::twin::{Call, Cells, Twin, twin_of};
use thirdbounce::Result;
use thirdbounce::gpu::{Buffer, Command, KernelCode, Schedule, View};
use thirdbounce::solve::OnDevice;
use thirdbounce::transport::Model;
use thirdbounce::transport::kernels::buffer;

/// The buffers of a plan in float64, as they were on the device when they were first used.
#[derive(Debug, Clone, Default)]
pub struct Host {
    buffers: BTreeMap<Buffer, Cells>,
}

impl Host {
    /// A buffer, read from the device if it is new.
    pub fn get(&mut self, job: &mut OnDevice, buffer: Buffer) -> Result<&mut Cells> {
        match self.buffers.entry(buffer) {
            Entry::Occupied(known) => Ok(known.into_mut()),
            Entry::Vacant(new) => {
                let words = read_words(job, buffer)?;
                Ok(new.insert(decode(job, buffer, words)?))
            }
        }
    }

    /// What a schedule begins with: all buffers that it uses, unchanged.
    pub fn before(job: &mut OnDevice, s: &Schedule) -> Result<Host> {
        let (mut after, mut before) = (Host::default(), Host::default());
        after.run(job, s)?;
        after.buffers.keys().try_for_each(|buffer| before.get(job, *buffer).map(drop))?;
        Ok(before)
    }

    /// Runs a schedule.
    pub fn run(&mut self, job: &mut OnDevice, s: &Schedule) -> Result<()> {
        s.commands.iter().try_for_each(|command| match command {
            Command::Dispatch { .. } => self.dispatch(job, command).map(drop),
            Command::Fill { buffer, offset, bytes, value } => {
                let (at, end) = (*offset as usize / 4, (offset + bytes) as usize / 4);
                match self.get(job, *buffer)? {
                    Cells::Words(all) => all[at..end].fill(*value),
                    Cells::Floats(all) => {
                        let end = end.min(all.len());
                        all[at..end].fill(f32::from_bits(*value).into());
                    }
                }
                Ok(())
            }
            Command::Copy { .. } | Command::Stage(_) => Ok(()),
        })
    }

    /// Runs a dispatch by its twin. Returns the kernel and the buffers that it writes.
    pub fn dispatch(
        &mut self,
        job: &mut OnDevice,
        command: &Command,
    ) -> Result<(&'static KernelCode, Vec<Buffer>)> {
        let Command::Dispatch { kernel, bind, push, .. } = command else { unreachable!("a dispatch") };
        let (code, constants) = code_of(job, *kernel);
        let (_, twin) = twin_of(code.name).unwrap_or_else(|| unreachable!("{} has no twin", code.name));
        let bound: Vec<_> = code.bindings.iter().filter(|b| b.view != View::Uniform).collect();
        let slots = bound.iter().map(|b| b.slot as usize).max().unwrap_or(0);
        // Twins name buffers that only some variants bind.
        let mut cells = vec![Cells::Words(vec![]); slots];
        for b in &bound {
            let buffer = bind.buffer_of(b.block);
            self.get(job, buffer)?;
            cells[b.slot as usize - 1] = self.buffers.remove(&buffer).unwrap_or(Cells::Words(vec![]));
        }
        let scene = bind.buffer_of(buffer::SCENE);
        let mut uniform = |block: Buffer| -> Result<Vec<u32>> {
            let is_bound = code.bindings.iter().any(|b| b.block == block);
            Ok(if is_bound { self.get(job, bind.buffer_of(block))?.u().to_vec() } else { vec![] })
        };
        let (words, paper) = (uniform(buffer::SCENE)?, uniform(buffer::PAPER)?);
        let levels = &job.plan.levels.volume;
        let level = levels.iter().find(|l| [l.scene, l.rendered.scene].contains(&scene));
        let (grid, model): (_, &Model) = (level.unwrap_or(job.plan.finest()).grid, &job.model);
        let call = Call {
            twin: Twin { model, grid: &grid },
            scene: bytemuck::try_pod_read_unaligned(bytemuck::cast_slice(&words)).unwrap_or_default(),
            paper: bytemuck::try_pod_read_unaligned(bytemuck::cast_slice(&paper)).unwrap_or_default(),
            push: bytemuck::cast(*push),
            constants,
        };
        twin(&call, &mut cells);
        for b in &bound {
            let cells = std::mem::replace(&mut cells[b.slot as usize - 1], Cells::Words(vec![]));
            self.buffers.insert(bind.buffer_of(b.block), cells);
        }
        let writes = bound.iter().filter(|b| b.writes).map(|b| bind.buffer_of(b.block));
        Ok((code, writes.collect()))
    }
}
