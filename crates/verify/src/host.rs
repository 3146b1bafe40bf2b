//! Schedules on the CPU, in float64, by the reference of each kernel.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use super::device::{code_of, decode, read_words};
use thirdbounce::Result;
use thirdbounce::engine::OnDevice;
use thirdbounce::gpu::{Binding, Buffer, Command, KernelCode, Schedule, View};
use thirdbounce_kernels::{Call, Cells, kernel_of};

/// The buffers of a plan in float64, as they were on the device when they were first used.
#[derive(Debug, Clone, Default)]
pub struct Host {
    buffers: BTreeMap<Buffer, Cells<f64>>,
}

impl Host {
    /// A buffer, read from the device if it is new.
    pub fn get(&mut self, job: &mut OnDevice, buffer: Buffer) -> Result<&mut Cells<f64>> {
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

    /// Runs a dispatch by its reference. Returns the kernel and the buffers that it writes.
    pub fn dispatch(
        &mut self,
        job: &mut OnDevice,
        command: &Command,
    ) -> Result<(&'static KernelCode, Vec<Buffer>)> {
        let Command::Dispatch { kernel, bind, push, .. } = command else { unreachable!("a dispatch") };
        let (code, constants) = code_of(job, *kernel);
        let row = kernel_of(code.name).unwrap_or_else(|| unreachable!("{} has no reference", code.name));
        let (uniform, bound): (Vec<&Binding>, Vec<&Binding>) =
            code.bindings.iter().partition(|b| b.view == View::Uniform);
        let slots = bound.iter().map(|b| b.slot as usize).max().unwrap_or(0);
        // References name buffers that only some variants bind.
        let mut cells = vec![Cells::NONE; slots];
        for b in &bound {
            let buffer = bind.buffer_of(b.block);
            self.get(job, buffer)?;
            cells[b.slot as usize - 1] = self.buffers.remove(&buffer).unwrap_or(Cells::NONE);
        }
        let mut blocks = vec![];
        for b in uniform {
            let words = self.get(job, bind.buffer_of(b.block))?.u().to_vec();
            blocks.push((b.block.to_string(), words));
        }
        let constants: Vec<_> = constants.iter().map(|(constant, value)| (constant.name(), *value)).collect();
        let call = Call::new(&constants, *push, |name| {
            blocks.iter().find(|(block, _)| block == name).map(|(_, words)| words.as_slice())
        });
        (row.reference)(&call, &mut cells);
        for b in &bound {
            let cells = std::mem::replace(&mut cells[b.slot as usize - 1], Cells::NONE);
            self.buffers.insert(bind.buffer_of(b.block), cells);
        }
        let writes = bound.iter().filter(|b| b.writes).map(|b| bind.buffer_of(b.block));
        Ok((code, writes.collect()))
    }
}
