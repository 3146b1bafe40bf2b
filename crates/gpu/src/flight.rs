//! A submission: what it is while the device is at it, and what it waits for.

use std::collections::HashSet;

use ash::vk;

use super::names::Buffer;
use super::schedule::Stage;

/// A value of a timeline semaphore on the device: something is done when the semaphore has this value or a larger one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moment {
    pub(super) semaphore: vk::Semaphore,
    pub(super) value: u64,
}

impl Moment {
    /// No moment at all.
    pub(super) const NONE: Moment = Moment { semaphore: vk::Semaphore::null(), value: 0 };

    /// The moment when `semaphore` reaches `value`.
    ///
    /// # Safety
    /// It is a timeline semaphore of the device on which the moment is used, and lives until the frames that name it are
    /// over. A value to wait for is signalled sometime; a value to signal is larger than those before.
    pub unsafe fn new(semaphore: vk::Semaphore, value: u64) -> Moment {
        Moment { semaphore, value }
    }
}

/// A submission; [`super::Executor::wait`] waits for it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ticket(pub(super) u64);

/// A command's place in a submission: its stage and its time stamps.
pub(super) struct Mark {
    pub kernel: &'static str,
    pub stage: Option<usize>,
    pub from: u32,
    pub to: u32,
}

/// A submission with what it holds.
#[derive(Default)]
pub(super) struct Flight {
    pub ticket: Ticket,
    pub commands: vk::CommandBuffer,
    /// Time stamps, and how many the pool has room for.
    pub queries: vk::QueryPool,
    pub room: u32,
    /// Time stamps that it takes: one before all commands, one after, and those that `marks` name.
    pub stamps: u32,
    /// Timed commands, and the stages they belong to; empty where they are not timed.
    pub marks: Vec<Mark>,
    pub stages: Vec<Stage>,
    /// Whether the first stage goes on from the submission before.
    pub goes_on: bool,
    /// Turns of kernels' main loops at most.
    pub work: u64,
    /// Its first and its last command by name.
    pub ends: [&'static str; 2],
    /// Host-visible buffers that it reads, and that it writes.
    pub shared: [HashSet<Buffer>; 2],
    /// A caller's moments: it begins after the first, and brings the second about.
    pub between: [Option<Moment>; 2],
}

impl Flight {
    /// Its commands, for errors.
    pub fn names(&self) -> String {
        match self.ends {
            [first, last] if first == last => format!("`{first}`"),
            [first, last] => format!("`{first}` to `{last}`"),
        }
    }
}
