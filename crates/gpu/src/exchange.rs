//! Sums over several devices that work at the same time, each driven by a thread of its own.
//!
//! They are added in the order of the devices, so every device gets the same bits. A member that is dropped breaks the
//! exchange off: nobody waits for it.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use super::names::Buffer;
use super::schedule::Summed;
use crate::advice::advice;
use crate::{Error, Result};

/// Buffer on the host that sums go through. A plan with an exchange has it ([`room_for`]).
pub const EXCHANGED: Buffer = Buffer::named("exchanged");

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

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::Duration;

    use super::*;

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
}
