//! Schedules: device work as plain data over named kernels and buffers.

use std::fmt;

use super::names::{Buffer, Kernel};
use super::short_list::ShortList;

/// Words of push constants, the same for every kernel.
pub(super) const PUSH_WORDS: usize = 7;

/// Workgroup counts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Size {
    /// Counts along x, y and z.
    Groups([u32; 3]),
    /// Read from a buffer by the device: (buffer, byte offset of three counts, upper bounds if known).
    Indirect(Buffer, u64, Option<[u32; 3]>),
}

/// Maximum number of rebound blocks of a dispatch.
const MOST_BINDS: usize = 6;

/// Maximum number of values of a stage.
const MOST_NUMBERS: usize = 4;

/// Blocks bound to buffers of other names: (block, buffer).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Binds(ShortList<(Buffer, Buffer), MOST_BINDS>);

impl Default for Binds {
    fn default() -> Binds {
        Binds(ShortList::empty((Buffer::named(""), Buffer::named(""))))
    }
}

impl Binds {
    /// The buffer bound to `block`.
    pub fn buffer_of(&self, block: Buffer) -> Buffer {
        self.0.iter().find(|(b, _)| *b == block).map_or(block, |(_, buffer)| *buffer)
    }
}

/// A command of a schedule.
#[derive(Debug, Clone, PartialEq, Eq)]
#[expect(
    clippy::large_enum_variant,
    reason = "nearly all commands are dispatches, and a schedule is one allocation"
)]
pub enum Command {
    /// Runs a kernel.
    Dispatch {
        /// Name of the kernel in the executor.
        kernel: Kernel,
        /// Workgroup counts.
        size: Size,
        /// Blocks bound to buffers of other names.
        bind: Binds,
        /// Push constants as words.
        push: [u32; PUSH_WORDS],
        /// Upper bound of its loop turns over all invocations.
        work: u64,
        /// First workgroup along x, y and z. Nonzero only in dispatches divided by the executor.
        first: [u32; 3],
    },
    /// Copies between buffers.
    Copy {
        /// Source.
        from: Buffer,
        /// First byte in the source.
        from_offset: u64,
        /// Target.
        to: Buffer,
        /// First byte in the target.
        to_offset: u64,
        /// Bytes to copy.
        bytes: u64,
    },
    /// Fills a buffer with one word.
    Fill {
        /// Target.
        buffer: Buffer,
        /// First byte.
        offset: u64,
        /// Bytes to fill, a multiple of 4.
        bytes: u64,
        /// The 32-bit word.
        value: u32,
    },
    /// Starts a stage: a group of commands in labels and timelines, up to the next stage. No effect on the device.
    Stage(Stage),
}

/// A named part of the work, with identifying values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stage {
    /// Its name, such as "iteration".
    pub name: &'static str,
    /// Values by name.
    pub values: ShortList<(&'static str, u64), MOST_NUMBERS>,
}

impl Stage {
    /// A stage with up to four values.
    ///
    /// # Panics
    /// More than four values.
    pub fn new(name: &'static str, values: &[(&'static str, u64)]) -> Stage {
        let mut stage = Stage { name, values: ShortList::empty(("", 0)) };
        values.iter().for_each(|value| stage.values.add(*value));
        stage
    }

    /// The value of that name, if present.
    pub fn value(&self, name: &str) -> Option<u64> {
        self.values.iter().find(|(n, _)| *n == name).map(|(_, v)| *v)
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)?;
        self.values.iter().try_for_each(|(n, v)| write!(f, " {n}={v}"))
    }
}

/// A list of commands in order, without barriers, which the executor derives from reads and writes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Schedule {
    /// The commands in order.
    pub commands: Vec<Command>,
}

impl Schedule {
    /// The commands that `write` adds to an empty schedule.
    pub fn of(write: impl FnOnce(&mut Schedule)) -> Schedule {
        let mut s = Schedule::default();
        write(&mut s);
        s
    }

    /// Removes all commands and keeps the memory.
    pub fn clear(&mut self) {
        self.commands.clear();
    }

    /// Adds a dispatch of `groups` workgroups along x, y and z. `turns` is an upper bound of the turns of its main
    /// loop over all invocations (one per invocation without a loop). The executor divides long dispatches and
    /// schedules by it, below the driver's watchdog timeout, and derives its own timeout from it.
    pub fn dispatch(&mut self, kernel: impl Into<Kernel>, groups: [u32; 3], turns: u64) -> &mut Command {
        self.sized(kernel.into(), Size::Groups(groups), turns)
    }

    /// Adds a dispatch whose three counts the device reads from `buffer` at byte `offset`. Divided only with bounds
    /// ([`Command::at_most`]). `turns` as for [`Schedule::dispatch`].
    pub fn indirect(
        &mut self,
        kernel: impl Into<Kernel>,
        buffer: Buffer,
        offset: u64,
        turns: u64,
    ) -> &mut Command {
        self.sized(kernel.into(), Size::Indirect(buffer, offset, None), turns)
    }

    fn sized(&mut self, kernel: Kernel, size: Size, work: u64) -> &mut Command {
        let (bind, push, first) = (Binds::default(), [0; PUSH_WORDS], [0; 3]);
        self.push(Command::Dispatch { kernel, size, bind, push, work, first })
    }

    /// Copies the first `bytes` bytes of `from` to the beginning of `to`.
    pub fn copy(&mut self, from: Buffer, to: Buffer, bytes: u64) {
        self.push(Command::Copy { from, from_offset: 0, to, to_offset: 0, bytes });
    }

    /// Copies `bytes` bytes of `from`, starting at byte `offset`, to the beginning of `to`.
    pub fn copy_from(&mut self, [from, to]: [Buffer; 2], offset: u64, bytes: u64) {
        self.push(Command::Copy { from, from_offset: offset, to, to_offset: 0, bytes });
    }

    /// Fills the first `bytes` bytes of a buffer with the word `value`.
    pub fn fill(&mut self, buffer: Buffer, bytes: u64, value: u32) {
        self.push(Command::Fill { buffer, offset: 0, bytes, value });
    }

    /// Sets the 32-bit word `index` of a buffer.
    pub fn set(&mut self, buffer: Buffer, index: u32, value: u32) {
        self.commands.push(Command::Fill { buffer, offset: 4 * u64::from(index), bytes: 4, value });
    }

    /// Starts a stage.
    pub fn stage(&mut self, name: &'static str, values: &[(&'static str, u64)]) {
        self.commands.push(Command::Stage(Stage::new(name, values)));
    }

    /// Moves all commands of `other` to the end.
    pub fn append(&mut self, other: &mut Schedule) {
        self.commands.append(&mut other.commands);
    }

    fn push(&mut self, command: Command) -> &mut Command {
        self.commands.push(command);
        self.commands.last_mut().expect("just pushed")
    }
}

impl Command {
    /// Binds `block` to a buffer of another name. For dispatches.
    pub fn bind(&mut self, block: Buffer, buffer: Buffer) -> &mut Command {
        if let Command::Dispatch { bind, .. } = self {
            bind.0.add((block, buffer));
        }
        self
    }

    /// Upper bounds of the counts read by the device; workgroups beyond the counts have no effect. Allows the
    /// executor to divide the dispatch. For indirect dispatches.
    pub fn at_most(&mut self, groups: [u32; 3]) -> &mut Command {
        if let Command::Dispatch { size: Size::Indirect(_, _, most), .. } = self {
            *most = Some(groups);
        }
        self
    }

    /// Sets the push constants, zero-padded. For dispatches.
    ///
    /// # Panics
    /// More words than a kernel has.
    pub fn with(&mut self, values: impl bytemuck::NoUninit) -> &mut Command {
        if let Command::Dispatch { push, .. } = self {
            let given = bytemuck::bytes_of(&values);
            *push = [0; PUSH_WORDS];
            bytemuck::bytes_of_mut(push)[..given.len()].copy_from_slice(given);
        }
        self
    }

    /// Upper bound of the loop turns; 0 for all but dispatches.
    pub fn work(&self) -> u64 {
        if let Command::Dispatch { work, .. } = self { *work } else { 0 }
    }

    /// Kernel name, "copy", "fill", or the name of the stage.
    pub fn name(&self) -> &'static str {
        match self {
            Command::Dispatch { kernel, .. } => kernel.name(),
            Command::Copy { .. } => "copy",
            Command::Fill { .. } => "fill",
            Command::Stage(stage) => stage.name,
        }
    }
}

/// One line per command.
impl fmt::Display for Schedule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in &self.commands {
            match c {
                Command::Dispatch { kernel, size, bind, push, .. } => {
                    write!(f, "{kernel}")?;
                    match size {
                        Size::Groups([x, y, z]) => write!(f, " {x}x{y}x{z}")?,
                        Size::Indirect(buffer, offset, _) => write!(f, " by {buffer}+{offset}")?,
                    }
                    for (block, buffer) in &*bind.0 {
                        write!(f, " {block}={buffer}")?;
                    }
                    writeln!(f, " {push:?}")?;
                }
                Command::Copy { from, to, bytes, .. } => writeln!(f, "copy {from} -> {to} {bytes}")?,
                Command::Fill { buffer, bytes, value, .. } => {
                    writeln!(f, "fill {buffer} {bytes} {value:#x}")?
                }
                Command::Stage(stage) => writeln!(f, "-- {stage}")?,
            }
        }
        Ok(())
    }
}
