//! An executor as one of several devices that share the work.
//!
//! Where a schedule has a [`Command::Exchange`], an executor copies the sums of its device to the host, waits until all others
//! have come as far, and goes on with the sums over all.

use std::time::Instant;

use super::exchange::{EXCHANGED, Exchange, Exchanged};
use super::executor::Executor;
use super::names::Buffer;
use super::schedule::{Command, Counted, Summed};
use crate::Result;

impl Executor {
    /// Lets this executor run schedules with exchanges, as one of the devices among which sums are exchanged.
    pub fn join(&mut self, exchange: Exchange) {
        self.exchange = Some(exchange);
    }

    /// What was exchanged so far.
    pub fn exchanged(&self) -> Exchanged {
        self.exchanged
    }

    /// Adds `sums` up over all devices, after what was submitted before.
    ///
    /// # Errors
    /// This device or another one fails.
    ///
    /// # Panics
    /// The executor has joined no exchange, or the arena has too little room for it.
    pub(super) fn add_up(&mut self, sums: &[Summed]) -> Result<()> {
        self.settle()?;
        let (gpu, begun) = (self.gpu.clone(), Instant::now());
        let _span = gpu.span("exchange");
        // What was counted the last time holds mostly: then one submission brings counts and sums.
        let mut there: Vec<u64> = sums.iter().map(|s| self.size_before(s)).collect();
        let counts = self.bring(sums, &there)?;
        let sizes: Vec<u64> = sums.iter().zip(&counts).map(|(s, count)| s.size(*count)).collect();
        if sizes.iter().zip(&there).any(|(size, there)| size > there) {
            there = sizes.clone();
            self.bring(sums, &there)?;
        }
        let mut values = vec![];
        for ([at, _], bytes) in places(sums, &there).into_iter().zip(&sizes) {
            values.extend(self.read::<f32>(EXCHANGED, at as usize / 4..(at + bytes) as usize / 4));
        }
        self.exchange.as_ref().expect("a schedule with an exchange").add_up(&counts, &mut values)?;
        let placed = places(sums, &sizes);
        self.write_at(EXCHANGED, placed[0][0], bytemuck::cast_slice(&values));
        let back = sums.iter().zip(&placed).filter(|(_, [_, bytes])| *bytes > 0);
        let back: Vec<_> =
            back.map(|(s, [at, bytes])| copy([EXCHANGED, s.buffer], [*at, 0], *bytes)).collect();
        self.submit_part(&back, None)?;
        self.sizes_before.extend(sums.iter().map(|s| s.buffer).zip(sizes.iter().copied()));
        self.exchanged.times += 1;
        self.exchanged.bytes += sizes.iter().sum::<u64>();
        self.exchanged.seconds += begun.elapsed().as_secs_f64();
        Ok(())
    }

    /// Copies so many bytes of each of `sums` to the host, and what counts them. Returns the counts; 0 where there is none.
    fn bring(&mut self, sums: &[Summed], sizes: &[u64]) -> Result<Vec<u32>> {
        let mut all = vec![];
        for (i, of) in (0..).zip(sums) {
            if let Some(Counted { buffer, word, .. }) = of.counted {
                all.push(copy([buffer, EXCHANGED], [4 * u64::from(word), 4 * i], 4));
            }
        }
        let some = sums.iter().zip(places(sums, sizes)).filter(|(_, [_, bytes])| *bytes > 0);
        all.extend(some.map(|(s, [at, bytes])| copy([s.buffer, EXCHANGED], [0, at], bytes)));
        self.submit_part(&all, None)?;
        self.settle()?;
        let words = self.read::<u32>(EXCHANGED, ..sums.len());
        Ok(sums.iter().zip(words).map(|(s, word)| if s.counted.is_some() { word } else { 0 }).collect())
    }

    /// Bytes that were counted the last time, or all that need no count.
    fn size_before(&self, of: &Summed) -> u64 {
        match of.counted {
            Some(_) => self.sizes_before.get(&of.buffer).map_or(0, |before| *before.min(&of.bytes)),
            None => of.bytes,
        }
    }
}

/// Where so many bytes of each of `sums` lie in [`EXCHANGED`]: first byte, bytes. A word for each lies before them.
fn places(sums: &[Summed], sizes: &[u64]) -> Vec<[u64; 2]> {
    let mut at = 4 * sums.len() as u64;
    let place = |bytes: &u64| {
        at += bytes;
        [at - bytes, *bytes]
    };
    sizes.iter().map(place).collect()
}

fn copy([from, to]: [Buffer; 2], [from_offset, to_offset]: [u64; 2], bytes: u64) -> Command {
    Command::Copy { from, from_offset, to, to_offset, bytes }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;
    use crate::{Arena, BufferPlan, Gpu, GpuOptions, Place, Schedule, room_for};

    const STATE: Buffer = Buffer::named("state");
    const LOSS: Buffer = Buffer::named("loss");
    const COUNT: Buffer = Buffer::named("count");
    const BACK: Buffer = Buffer::named("back");

    /// Three floats of an item are summed, as many items as are counted, and what lies behind them stays.
    #[test]
    fn a_schedule_goes_on_with_the_sums_of_all_devices() {
        let open =
            || Gpu::open(&GpuOptions::default()).expect("a Vulkan device: `make setup` installs lavapipe");
        let sums = [
            Summed { buffer: STATE, bytes: 96, counted: Some(Counted { buffer: COUNT, word: 2, bytes: 12 }) },
            Summed { buffer: LOSS, bytes: 8, counted: None },
        ];
        let run = |member: Exchange| {
            let number = member.number() as f32;
            let gpu = open();
            let plan = [
                BufferPlan::new(STATE, 96, Place::Device),
                BufferPlan::new(LOSS, 64, Place::Device),
                BufferPlan::new(COUNT, 16, Place::Device),
                BufferPlan::new(BACK, 160, Place::Readback),
                BufferPlan::new(EXCHANGED, room_for(&sums), Place::Readback),
            ];
            let mut executor = Executor::new(&gpu, Arena::new(&gpu, &plan, None).unwrap()).unwrap();
            executor.join(member);
            let mut s = Schedule::default();
            s.fill(LOSS, 64, (10.0 + number).to_bits());
            // More, then fewer than were counted before.
            for count in [2, 7, 3] {
                s.fill(STATE, 96, (1.0 + number).to_bits());
                s.set(COUNT, 2, count);
                s.exchange(&sums);
            }
            s.copy(STATE, BACK, 96);
            s.commands.push(copy([LOSS, BACK], [0, 96], 64));
            executor.run(&s).unwrap();
            (executor.read::<f32>(BACK, ..), executor.exchanged(), executor)
        };
        let done: Vec<_> = thread::scope(|s| {
            let all: Vec<_> = Exchange::among(2).into_iter().map(|m| s.spawn(|| run(m))).collect();
            all.into_iter().map(|t| t.join().unwrap()).collect()
        });
        for (number, (back, exchanged, _)) in done.iter().enumerate() {
            assert_eq!(back[..9], [3.0; 9]);
            assert_eq!(back[9..24], [1.0 + number as f32; 15], "not counted");
            assert_eq!(back[24..26], [84.0; 2], "summed three times");
            assert_eq!(back[26..], [10.0 + number as f32; 14]);
            assert_eq!((exchanged.times, exchanged.bytes), (3, 12 * 12 + 24));
        }
    }
}
