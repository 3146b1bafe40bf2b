//! Submissions in flight, and timeline points.

use std::collections::HashSet;

use ash::vk;

use super::names::Buffer;
use super::schedule::Stage;

/// A value of a timeline semaphore on the device, reached when the semaphore has this value or a larger one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimelinePoint {
    pub(super) semaphore: vk::Semaphore,
    pub(super) value: u64,
}

impl TimelinePoint {
    /// No timeline point.
    pub(super) const NONE: TimelinePoint = TimelinePoint { semaphore: vk::Semaphore::null(), value: 0 };

    /// The point at which `semaphore` reaches `value`.
    ///
    /// # Safety
    /// The semaphore is a timeline semaphore of the device on which the point is used, and outlives the frames that
    /// name it. A value to wait for is eventually signalled; a value to signal exceeds all earlier ones.
    pub unsafe fn new(semaphore: vk::Semaphore, value: u64) -> TimelinePoint {
        TimelinePoint { semaphore, value }
    }
}

/// Identifies a submission for [`super::Executor::wait`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ticket(pub(super) u64);

/// Stage and timestamps of a command in a submission.
pub(super) struct Mark {
    pub kernel: &'static str,
    pub stage: Option<usize>,
    pub from: u32,
    pub to: u32,
}

/// A submission and its objects.
#[derive(Default)]
pub(super) struct Flight {
    pub ticket: Ticket,
    pub commands: vk::CommandBuffer,
    /// Timestamp pool and its size.
    pub queries: vk::QueryPool,
    pub room: u32,
    /// Number of timestamps: one before all commands, one after, and those of `marks`.
    pub stamps: u32,
    /// Timed commands and their stages; empty if not timed.
    pub marks: Vec<Mark>,
    pub stages: Vec<Stage>,
    /// Whether the first stage continues that of the previous submission.
    pub continues_stage: bool,
    /// Maximum loop turns.
    pub work: u64,
    /// Names of the first and the last command.
    pub ends: [&'static str; 2],
    /// Host-visible buffers read and written.
    pub shared: [HashSet<Buffer>; 2],
    /// External timeline points: waited for before, signalled after.
    pub between: [Option<TimelinePoint>; 2],
}

impl Flight {
    /// Names of its commands, for errors.
    pub fn names(&self) -> String {
        match self.ends {
            [first, last] if first == last => format!("`{first}`"),
            [first, last] => format!("`{first}` to `{last}`"),
        }
    }
}
