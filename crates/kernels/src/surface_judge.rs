use super::shared::*;
use super::{Call, Cells, Real};

/// A larger logarithm of the objective is a rise: batches differ by less.
const RISE: f64 = 0.05;

/// Factors of the steps after a rise, and after a comparison without one.
const SHORTER: f64 = 0.5;
const LONGER: f64 = 1.2;

/// Denominators and arguments of logarithms are at least this; a scale is less than the other.
const LEAST: f64 = 1e-37;
const MOST: f64 = 1e37;

/// Judges a fit: before the first iteration finds the scale of the albedos, later compares the objective with the best one. The
/// weights say what `surface_keep` does then.
pub fn surface_judge<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: weights f, trace u, energies f);
    let mut state = FitState { call, weights, trace, energies };
    if call.push.iteration == 0 { state.place() } else { state.compare() }
}

struct FitState<'j, F> {
    call: &'j Call<'j>,
    weights: &'j mut [F],
    trace: &'j mut [u32],
    energies: &'j [F],
}

impl<F: Real> FitState<'_, F> {
    fn at(&self, index: u32) -> f64 {
        self.weights[index as usize].wide()
    }

    fn put(&mut self, index: u32, value: f64) {
        self.weights[index as usize] = F::of(value);
    }

    fn traced(&self, row: u32, column: u32) -> f64 {
        f64::from(f32::from_bits(self.trace[(row * TRACE_ROW + column) as usize]))
    }

    /// Weighs the prior by the data term that is left.
    fn weigh(&mut self, left: f64) {
        for (weight, share) in [(SURFACE_BEND, SURFACE_BEND_SHARE), (SURFACE_JUMP, SURFACE_JUMP_SHARE)] {
            self.put(weight, self.at(share) * left);
        }
    }

    /// Sets the length of the steps. Steps of another length have other largest gradients.
    fn pace(&mut self, factor: f64) {
        self.put(SURFACE_FACTOR, factor);
        self.put(SURFACE_DEPTH_RATE, factor * self.at(SURFACE_DEPTH_LONGEST));
        self.put(SURFACE_ALBEDO_RATE, factor * self.at(SURFACE_ALBEDO_LONGEST));
        self.put(SURFACE_LARGEST, 0.0);
        self.put(SURFACE_LARGEST + 1, 0.0);
    }

    fn act(&mut self, action: u32) {
        self.put(SURFACE_ACTION, action.into());
    }

    /// The least of |s A v - h|² over s, from s = 0, 1 and 2; then the weights that follow from it.
    fn place(&mut self) {
        let (push, energy) = (self.call.push, self.at(SURFACE_ENERGY));
        let mut explained = energy - self.at(SURFACE_PLACED);
        if push.flags & JUDGE_SCALE != 0 {
            let measured = self.at(SURFACE_COMPARED);
            let [once, twice] = [push.first, push.first + 1].map(|row| self.traced(row, TRACE_OBJECTIVE));
            let rendered = 0.5 * (measured - 2.0 * once + twice);
            let found = 0.5 * (rendered + measured - once) / rendered;
            let explains = rendered != 0.0 && found > 0.0 && found < MOST;
            let scale = if explains { found } else { 1.0 };
            self.put(SURFACE_SCALE, if explains { found * self.at(SURFACE_SCALE) } else { 0.0 });
            self.put(SURFACE_BRIGHTEST, scale * self.at(SURFACE_BRIGHTEST));
            // They are doubled.
            self.put(SURFACE_TIMES, 0.5 * scale);
            explained = if explains { energy * scale * scale * rendered / measured } else { 0.0 };
            self.put(SURFACE_PLACED, energy - explained);
        }
        self.act(ACTION_SCALE);
        if push.flags & JUDGE_GUESS != 0 {
            return;
        }
        let most = self.at(SURFACE_BRIGHTEST);
        for (index, factor) in [
            (SURFACE_JUMP_SHARE, 1.0 / (most * most)),
            (SURFACE_ALBEDO_LONGEST, most),
            (SURFACE_SPARSE, explained / most),
            (SURFACE_FAINT, most),
        ] {
            self.put(index, factor * self.at(index));
        }
        let left = self.at(SURFACE_PLACED);
        self.put(SURFACE_BEST_LEFT, left / energy.max(LEAST));
        self.weigh(left.min(self.at(SURFACE_BEFORE)));
        self.pace(self.at(SURFACE_FACTOR));
    }

    /// Of an iteration: logarithm of the objective over the energy of its pairs, data term over that, objective, plain data loss.
    fn objective(&self, row: u32) -> [f64; 4] {
        let energy = self.energies[(row % self.call.push.last) as usize].wide().max(LEAST);
        let [data, prior, plain] =
            [TRACE_OBJECTIVE, TRACE_L1, TRACE_DATA].map(|column| self.traced(row, column));
        let share = (data + prior) / energy;
        [if share < LEAST { LEAST } else { share }.ln(), data / energy, data + prior, plain]
    }

    fn keep_best(&mut self, [log, left, loss, plain]: [f64; 4]) {
        for (index, value) in [
            (SURFACE_BEST, log),
            (SURFACE_BEST_LEFT, left),
            (SURFACE_BEST_LOSS, loss),
            (SURFACE_BEST_DATA, plain),
        ] {
            self.put(index, value);
        }
    }

    /// Iterations from `push.first` to before `push.iteration`, in the mean over different batches, of which there are `push.last`.
    fn compare(&mut self) {
        let push = self.call.push;
        if push.first == push.iteration {
            // The last iterations are judged already.
            let was_kept = self.at(SURFACE_ACTION) != f64::from(ACTION_NONE);
            self.act(if was_kept { ACTION_NONE } else { ACTION_RESTORE });
            return;
        }
        if push.flags & JUDGE_FIRST != 0 {
            let [log, _, loss, plain] = self.objective(push.first);
            self.keep_best([log, self.at(SURFACE_BEST_LEFT), loss, plain]);
        }
        let rows = push.last.min(push.iteration - push.first);
        let all: Vec<[f64; 4]> =
            (push.iteration - rows..push.iteration).map(|row| self.objective(row)).collect();
        let here: [f64; 4] =
            std::array::from_fn(|k| all.iter().map(|of| of[k]).sum::<f64>() / f64::from(rows));
        let factor = self.at(SURFACE_FACTOR);
        // It may be NaN.
        let rises = here[0].is_nan() || here[0] > self.at(SURFACE_BEST) + RISE;
        let is_best = here[0] <= self.at(SURFACE_BEST);
        if rises {
            self.weigh(self.at(SURFACE_BEST_LEFT) * self.at(SURFACE_ENERGY));
            self.pace(SHORTER * factor);
            self.put(SURFACE_RESTED, push.step.into());
            let best = [SURFACE_BEST_LOSS, SURFACE_BEST_DATA].map(|index| self.at(index));
            let row = &mut self.trace[((push.iteration - 1) * TRACE_ROW) as usize..];
            // The row shows the state that is restored. NaN stays: the host reports it.
            if here[2] < MOST {
                for (column, value) in [(TRACE_OBJECTIVE, best[0]), (TRACE_DATA, best[1]), (TRACE_L1, 0.0)] {
                    row[column as usize] = (value as f32).to_bits();
                }
            }
            self.act(ACTION_RESTORE);
            return;
        }
        self.weigh(self.traced(push.iteration - 1, TRACE_OBJECTIVE));
        if is_best {
            self.keep_best(here);
            if factor < 1.0 {
                self.pace((LONGER * factor).min(1.0));
            }
            self.act(ACTION_KEEP);
        } else {
            self.act(if push.flags & JUDGE_LAST != 0 { ACTION_RESTORE } else { ACTION_NONE });
        }
    }
}
