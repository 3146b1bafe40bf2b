//! Sums over several devices that work at the same time, each driven by a thread of its own.
//!
//! Where a schedule has a [`Command::Exchange`](super::Command::Exchange), an executor copies the sums of its device to the
//! host, waits until all others have come as far, and goes on with the sums over all. These are added in the order of the
//! devices, so every device gets the same bits. A member that is dropped breaks the exchange off: nobody waits for it.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::execute::Executor;
use super::{Buffer, Command};
use crate::advice::advice;
use crate::{Error, Result};

/// Buffer on the host that sums go through. A plan with an exchange has it ([`room_for`]).
pub const EXCHANGED: Buffer = Buffer::named("exchanged");

/// Floats at the beginning of a buffer that are added up over all devices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summed {
    /// The buffer.
    pub buffer: Buffer,
    /// Bytes at most.
    pub bytes: u64,
    /// Exchange only the items that a word on the device counts; `None`: all bytes.
    pub counted: Option<Counted>,
}

/// Items that are counted on the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counted {
    /// Buffer with the count.
    pub buffer: Buffer,
    /// The 32-bit word of it that holds the count.
    pub word: u32,
    /// Bytes of an item.
    pub bytes: u64,
}

impl Summed {
    /// Bytes that are exchanged if so many items are counted.
    fn size(&self, count: u32) -> u64 {
        self.counted.map_or(self.bytes, |of| (u64::from(count) * of.bytes).min(self.bytes))
    }
}

/// Bytes of [`EXCHANGED`] that these sums take.
pub fn room_for(sums: &[Summed]) -> u64 {
    sums.iter().map(|s| 4 + s.bytes).sum()
}

/// What an executor has exchanged.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Exchanged {
    /// How often.
    pub times: u64,
    /// Bytes that went to the host, and as many back.
    pub bytes: u64,
    /// Seconds from the end of the work before to the last copy back, waiting for other devices included.
    pub seconds: f64,
}

/// One of several devices whose sums are added up.
pub struct Exchange {
    shared: Arc<Shared>,
    number: usize,
}

struct Shared {
    state: Mutex<State>,
    /// A round ended, or a device left.
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// What each device has brought so far: counts and values.
    brought: Vec<Option<(Vec<u32>, Vec<f32>)>>,
    /// The result of the last round, and how many rounds there were.
    sum: Option<Arc<Vec<f32>>>,
    round: u64,
    /// A device left.
    broken: bool,
}

impl Exchange {
    /// The members of an exchange among so many devices, in order.
    pub fn among(count: usize) -> Vec<Exchange> {
        let state = State { brought: vec![None; count], ..State::default() };
        let shared = Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new() });
        (0..count).map(|number| Exchange { shared: shared.clone(), number }).collect()
    }

    /// Its number among the devices.
    pub fn number(&self) -> usize {
        self.number
    }

    /// Replaces `values` by their sums over all devices. Waits until all have come. `counts` must be the same on all.
    ///
    /// # Errors
    /// A device left ([`is_left`]), or counts differ.
    pub fn add_up(&self, counts: &[u32], values: &mut Vec<f32>) -> Result<()> {
        let mut state = self.state();
        if state.broken {
            return Err(left());
        }
        state.brought[self.number] = Some((counts.to_vec(), std::mem::take(values)));
        let round = state.round;
        if state.brought.iter().all(Option::is_some) {
            let all: Vec<_> = state.brought.iter_mut().filter_map(Option::take).collect();
            state.sum = sum(all).map(Arc::new);
            state.round += 1;
            self.shared.changed.notify_all();
        }
        while state.round == round {
            if state.broken {
                return Err(left());
            }
            state = self.shared.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        // The next round cannot end before this device has come to it.
        let sum = state.sum.clone().ok_or_else(differ)?;
        drop(state);
        values.extend_from_slice(&sum);
        Ok(())
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Every change leaves a whole state.
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Exchange {
    fn drop(&mut self) {
        self.state().broken = true;
        self.shared.changed.notify_all();
    }
}

/// The sums in the order of the devices; `None` if these disagree on how many there are.
fn sum(all: Vec<(Vec<u32>, Vec<f32>)>) -> Option<Vec<f32>> {
    let mut all = all.into_iter();
    let (counts, mut sum) = all.next()?;
    for (of_other, values) in all {
        if of_other != counts || values.len() != sum.len() {
            return None;
        }
        sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
    }
    Some(sum)
}

const LEFT: &str = "another device that shares the solve broke off";

fn left() -> Error {
    Error::device(LEFT, "see the error of that device")
}

fn differ() -> Error {
    Error::device(
        "the devices that share the solve disagree on the active voxels: they round differently",
        advice!["name devices of one kind and driver, or one " Device],
    )
}

/// Whether an error only says that another device broke off.
pub fn is_left(error: &Error) -> bool {
    error.what == LEFT
}

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
        self.submit_as_it_is(&back)?;
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
        self.submit_as_it_is(&all)?;
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
    use std::time::Duration;

    use super::*;
    use crate::{Arena, BufferPlan, Gpu, GpuOptions, Place, Schedule};

    const STATE: Buffer = Buffer::named("state");
    const LOSS: Buffer = Buffer::named("loss");
    const COUNT: Buffer = Buffer::named("count");
    const BACK: Buffer = Buffer::named("back");

    #[test]
    fn all_get_the_same_sums_in_every_round() {
        let members = Exchange::among(3);
        let run = |member: Exchange| {
            let mut all = vec![];
            for round in 0..50u32 {
                let own = member.number as f32 + 0.1 * round as f32;
                let mut values = vec![own, 1e8 * (member.number as f32 - 1.0)];
                member.add_up(&[round], &mut values).unwrap();
                all.push(values);
            }
            // Nobody leaves before all are done.
            (all, member)
        };
        let done: Vec<_> = thread::scope(|s| {
            let all: Vec<_> = members.into_iter().map(|m| s.spawn(move || run(m))).collect();
            all.into_iter().map(|t| t.join().unwrap()).collect()
        });
        for round in 0..50 {
            let want = (0..3).map(|n| n as f32 + 0.1 * round as f32).fold(0.0, |a, b| a + b);
            assert!(done.iter().all(|(all, _)| all[round] == [want, 0.0]), "round {round}");
        }
    }

    #[test]
    fn who_leaves_keeps_nobody_waiting_and_who_differs_is_found() {
        let mut members = Exchange::among(3);
        let last = members.pop().unwrap();
        let waiting: Vec<_> = members
            .into_iter()
            .map(|m| thread::spawn(move || m.add_up(&[], &mut vec![1.0]).unwrap_err()))
            .collect();
        thread::sleep(Duration::from_millis(20));
        drop(last);
        assert!(waiting.into_iter().all(|w| is_left(&w.join().unwrap())));
        let members = Exchange::among(2);
        let errors = thread::scope(|s| {
            let of = |m, counts: &'static [u32]| s.spawn(move || Exchange::add_up(m, counts, &mut vec![1.0]));
            [of(&members[0], &[5]), of(&members[1], &[6])].map(|t| t.join().unwrap().unwrap_err())
        });
        assert!(errors.iter().all(|e| e.what.contains("disagree") && !is_left(e)), "{errors:?}");
    }

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
            let number = member.number as f32;
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
