//! Reads and writes of commands, and the barriers that their hazards require.

use super::code::Binding;
use super::names::{Buffer, Kernel};
use super::schedule::{Command, Size};

/// Buffers read and written by commands.
#[derive(Debug, Default)]
pub(super) struct Accesses {
    pub(super) reads: Vec<Buffer>,
    pub(super) writes: Vec<Buffer>,
}

impl Accesses {
    /// Replaces the content by the accesses of `command`. `bound`: bindings of a kernel.
    pub fn take(&mut self, command: &Command, bound: impl Fn(Kernel) -> &'static [Binding]) {
        self.clear();
        match command {
            Command::Dispatch { size, bind, kernel, .. } => {
                let bindings = bound(*kernel);
                let named = |b: &Binding| bind.buffer_of(b.block);
                self.reads.extend(bindings.iter().filter(|b| b.reads).map(named));
                if let Size::Indirect(buffer, ..) = size {
                    self.reads.push(*buffer);
                }
                self.writes.extend(bindings.iter().filter(|b| b.writes).map(named));
            }
            Command::Copy { from, to, .. } => {
                self.reads.push(*from);
                self.writes.push(*to);
            }
            Command::Fill { buffer, .. } => self.writes.push(*buffer),
            Command::Stage(_) => {}
        }
    }

    /// Whether a barrier is required between these and the `next` accesses.
    pub fn conflicts(&self, next: &Accesses) -> bool {
        next.reads.iter().any(|r| self.writes.contains(r))
            || next.writes.iter().any(|w| self.writes.contains(w) || self.reads.contains(w))
    }

    /// Adds the accesses of a later command.
    pub fn add(&mut self, more: &Accesses) {
        self.reads.extend_from_slice(&more.reads);
        self.writes.extend_from_slice(&more.writes);
    }

    /// Removes all accesses.
    pub fn clear(&mut self) {
        self.reads.clear();
        self.writes.clear();
    }

    /// Whether one of `buffers` is written.
    pub(super) fn write_any(&self, buffers: &[Buffer]) -> bool {
        self.writes.iter().any(|w| buffers.contains(w))
    }
}

/// Appends to `into` the buffers from which dispatches among `commands` read their sizes.
pub(super) fn sizes_of(commands: &[Command], into: &mut Vec<Buffer>) {
    into.clear();
    for command in commands {
        if let Command::Dispatch { size: Size::Indirect(buffer, ..), .. } = command
            && !into.contains(buffer)
        {
            into.push(*buffer);
        }
    }
}

/// Number of barriers between `commands`, executed in order. `bound`: bindings of a kernel.
pub fn barriers(commands: &[Command], bound: impl Fn(Kernel) -> &'static [Binding]) -> usize {
    let [mut now, mut pending] = [Accesses::default(), Accesses::default()];
    let mut count = 0;
    for command in commands {
        now.take(command, &bound);
        if pending.conflicts(&now) {
            count += 1;
            pending.clear();
        }
        pending.add(&now);
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Schedule;

    #[test]
    fn a_barrier_stands_where_there_is_a_hazard_and_only_there() {
        let mut p = Accesses::default();
        let of =
            |reads: &[Buffer], writes: &[Buffer]| Accesses { reads: reads.into(), writes: writes.into() };
        let [a, b, c, d] = ["a", "b", "c", "d"].map(Buffer::named);
        assert!(!p.conflicts(&of(&[a], &[b])));
        p.add(&of(&[a], &[b]));
        assert!(!p.conflicts(&of(&[a, c], &[d])), "read after read, and other buffers");
        assert!(p.conflicts(&of(&[b], &[])), "read after write");
        assert!(p.conflicts(&of(&[], &[a])), "write after read");
        assert!(p.conflicts(&of(&[], &[b])), "write after write");
        assert!(!p.conflicts(&of(&[b.at(0)], &[a.at(0)])), "one of several is another buffer");
        assert!(p.write_any(&[c, b]) && !p.write_any(&[a, c]));
        p.clear();
        assert!(!p.conflicts(&of(&[b], &[a, b])));
    }

    #[test]
    fn sizes_are_read_and_barriers_are_counted() {
        let [a, b, sizes] = ["a", "b", "sizes"].map(Buffer::named);
        let mut s = Schedule::default();
        s.fill(sizes, 12, 1);
        s.fill(b, 4, 0);
        // A kernel without buffers whose size depends on the device.
        s.indirect(Kernel::named("k"), sizes, 0, 1);
        s.copy(a, b, 4);
        s.copy(b, a, 4);
        assert_eq!(barriers(&s.commands, |_| &[]), 2);
        let mut all = vec![a];
        sizes_of(&s.commands, &mut all);
        assert_eq!(all, [sizes]);
    }
}
