//! Execution of schedules and division of long ones.

use std::ops::ControlFlow;

use super::device::Gpu;
use super::executor::DeviceExecutor;
use super::flight::Ticket;
use super::instance::DeviceKind;
use super::memory::{DeviceArena, SIZE_BACK};
use super::pace::{divided, parts};
use super::place::Place;
use super::schedule::{Command, Schedule, Size};
use crate::Result;

impl DeviceExecutor {
    /// An executor for the buffers of `arena`, initially without kernels.
    ///
    /// # Errors
    /// The device cannot create the queue's objects.
    pub fn new(gpu: &Gpu, arena: DeviceArena) -> Result<DeviceExecutor> {
        let mut executor = DeviceExecutor::with(gpu, arena)?;
        executor.poison()?;
        executor.set_canaries()?;
        Ok(executor)
    }

    /// Submits `schedule` after earlier submissions without waiting. Long schedules are divided so that no part
    /// approaches a driver's watchdog timeout; the ticket is that of the last part.
    ///
    /// # Errors
    /// The device fails.
    pub fn submit(&mut self, schedule: &Schedule) -> Result<Ticket> {
        let uploads = |c: &Command| matches!(c, Command::Copy { from, .. } if self.arena.get(*from).place == Place::Upload);
        let all = !schedule.commands.is_empty() && schedule.commands.iter().all(uploads);
        let gpu = self.gpu.clone();
        let _span = all.then(|| gpu.span("upload"));
        if self.gpu.faults().shuffle.is_some() {
            self.submit_shuffled(schedule)
        } else {
            self.submit_as_it_is(&schedule.commands)
        }
    }

    /// As [`DeviceExecutor::submit`]. Where the host's processors are the device, the schedule runs in parts of about a tenth of a
    /// second, and `hear` is called after each: `None` if it breaks, which leaves the rest out.
    ///
    /// # Errors
    /// The device fails.
    pub fn submit_heard(
        &mut self,
        schedule: &Schedule,
        hear: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Ticket>> {
        if self.gpu.info.kind != DeviceKind::Cpu || self.gpu.faults().shuffle.is_some() {
            return self.submit(schedule).map(Some);
        }
        let most = self.pace.heard().min(self.gpu.limits.work).min(self.pace.submission());
        self.submit_parts(&schedule.commands, [most; 2], &mut |executor, part| {
            executor.wait(part)?;
            Ok(hear())
        })
    }

    fn submit_as_it_is(&mut self, commands: &[Command]) -> Result<Ticket> {
        let most = [self.gpu.limits.work, self.pace.submission()];
        let last = self.submit_parts(commands, most, &mut |_, _| Ok(ControlFlow::Continue(())))?;
        Ok(last.unwrap_or(Ticket(self.submitted)))
    }

    /// Submits commands with at most these loop turns in a dispatch and in a part, and calls `after` after each part: `None` if
    /// it breaks.
    fn submit_parts(
        &mut self,
        commands: &[Command],
        [of_dispatch, of_part]: [u64; 2],
        after: &mut dyn FnMut(&mut DeviceExecutor, Ticket) -> Result<ControlFlow<()>>,
    ) -> Result<Option<Ticket>> {
        let commands = &*divided(commands, of_dispatch);
        let mut open = None;
        let mut last = Ticket(self.submitted);
        for part in parts(commands, of_part) {
            let commands = &commands[part];
            last = self.submit_part(commands, open)?;
            if after(self, last)?.is_break() {
                return Ok(None);
            }
            let mut stages =
                commands.iter().filter_map(|c| if let Command::Stage(s) = c { Some(s) } else { None });
            open = stages.next_back().or(open);
        }
        Ok(Some(last))
    }

    /// Submits a schedule with its dispatches in pieces and in shuffled order. Reads the sizes of indirect dispatches
    /// back first: only direct ones can start at any workgroup.
    fn submit_shuffled(&mut self, schedule: &Schedule) -> Result<Ticket> {
        let mut part = Schedule::default();
        for command in &schedule.commands {
            let mut command = command.clone();
            if let Command::Dispatch { size, .. } = &mut command
                && let Size::Indirect(buffer, offset, _) = *size
            {
                part.commands.push(Command::Copy {
                    from: buffer,
                    from_offset: offset,
                    to: SIZE_BACK,
                    to_offset: 0,
                    bytes: 12,
                });
                let ticket = self.submit_as_it_is(&std::mem::take(&mut part).commands)?;
                self.wait(ticket)?;
                *size = Size::Groups(self.read::<[u32; 3]>(SIZE_BACK, ..1)[0]);
            }
            part.commands.push(command);
        }
        self.submit_as_it_is(&part.commands)
    }
}

impl Drop for DeviceExecutor {
    fn drop(&mut self) {
        if self.gpu.has_hung() {
            // The device may still use these objects: leak them.
            return;
        }
        self.check_canaries();
        self.destroy();
    }
}
