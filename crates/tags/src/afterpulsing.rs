//! Afterpulses: counts of a detector without light, some time after a photon.
//!
//! Photons of different laser pulses know nothing of each other. So as many pairs of photons should be 1 to 31 laser pulses apart
//! as 33 to 63. Afterpulses make more of the near ones, a dead time longer than the laser's period makes fewer. Both
//! kinds of pairs see the same point of the scan, so that its brightness does not matter.

/// Pairs that are 1 to 31 laser pulses apart, and 33 to 63: bits of [`Pairs::history`] after it has moved.
const NEAR: u64 = 0xFFFF_FFFE;
const FAR: u64 = NEAR << 32;
/// Laser pulses after a photon in which afterpulses are looked for.
const REACH: u32 = NEAR.count_ones();
/// Fewest laser pulses of a point: where one ends, near pairs are bright or dark together more often than far ones. With
/// points that differ by a fifth, that is three in ten thousand photons at a tenth of a photon a laser pulse.
const FEWEST_PULSES: u64 = 10_000;
/// Fewest pairs: with fewer, nothing is told.
const FEWEST_PAIRS: u64 = 100;
/// So many standard errors are no chance.
const SURE: f64 = 3.0;

/// Counts that a photon brings with it in the laser pulses behind its own.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Afterpulsing {
    /// Counts for each photon beyond those of chance. Below 0 the detector is blind for some laser pulses after a photon.
    pub share: f64,
    /// The standard error of that.
    pub error: f64,
    /// So many laser pulses behind a photon's own are looked at.
    pub pulses: u32,
}

impl Afterpulsing {
    /// What it is, in a sentence. `period` is the laser's, seconds.
    pub fn text(&self, period: Option<f64>) -> String {
        let span = match period {
            Some(period) => {
                format!("{} laser pulses ({:.2} µs)", self.pulses, 1e6 * period * f64::from(self.pulses))
            }
            None => format!("{} laser pulses", self.pulses),
        };
        let [share, error] = [self.share, self.error].map(|v| 100.0 * v);
        if share > SURE * error {
            format!("{share:.2} ± {error:.2} % of photons bring an afterpulse within {span}")
        } else if share < -SURE * error {
            format!(
                "{:.2} ± {error:.2} counts for 100 photons are missing within {span}: the dead time is longer than a laser period",
                -share
            )
        } else {
            format!(
                "no afterpulses within {span}: fewer than {:.2} % of photons",
                share.max(0.0) + SURE * error
            )
        }
    }
}

/// Pairs of photons by their distance in laser pulses.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Pairs {
    /// Bit k: there was a photon k laser pulses before the last one.
    history: u64,
    last: i64,
    near: u64,
    far: u64,
    photons: u64,
}

impl Pairs {
    /// Takes a photon. One that is out of order is left out.
    #[inline]
    pub(super) fn add(&mut self, sync: i64) {
        let Some(distance) = sync.checked_sub(self.last).filter(|d| *d >= 0) else { return };
        self.history = u32::try_from(distance).ok().and_then(|d| self.history.checked_shl(d)).unwrap_or(0);
        self.near += u64::from((self.history & NEAR).count_ones());
        self.far += u64::from((self.history & FAR).count_ones());
        self.photons += 1;
        self.history |= 1;
        self.last = sync;
    }

    /// What the pairs say, if points have at least `pulses` laser pulses each; `None` if that is too little to tell.
    pub(super) fn afterpulsing(&self, pulses: u64) -> Option<Afterpulsing> {
        if pulses < FEWEST_PULSES || self.far < FEWEST_PAIRS {
            return None;
        }
        let [near, far, photons] = [self.near, self.far, self.photons].map(|n| n as f64);
        Some(Afterpulsing {
            share: (near - far) / photons,
            error: (near + far).sqrt() / photons,
            pulses: REACH,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Photons of a detector: a share of laser pulses has one, of which a share brings another some pulses later; blind for some
    /// laser pulses after each.
    fn told(light: f64, after: f64, blind: i64) -> Afterpulsing {
        let mut state = 0x9E37_79B9_7F4A_7C15u64;
        let mut random = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut pairs = Pairs::default();
        let mut due = std::collections::BTreeSet::new();
        let mut free = 0;
        for sync in 0..1_000_000 {
            let has = (random() < light) | due.remove(&sync);
            if has && sync >= free {
                pairs.add(sync);
                free = sync + 1 + blind;
                if random() < after {
                    due.insert(sync + 1 + (random() * 12.0) as i64);
                }
            }
        }
        assert_eq!(pairs.afterpulsing(FEWEST_PULSES - 1), None);
        pairs.afterpulsing(FEWEST_PULSES).unwrap()
    }

    #[test]
    fn afterpulses_are_counted() {
        let none = told(0.05, 0.0, 0);
        assert!(none.share.abs() < 3.0 * none.error && none.error < 0.01, "{none:?}");
        assert!(
            none.text(Some(1e-7)).contains("no afterpulses within 31 laser pulses (3.10 µs)"),
            "{}",
            none.text(None)
        );
        let some = told(0.05, 0.06, 0);
        // Some fall on pulses that had a photon, and an afterpulse brings another.
        let wanted = 0.06 / 0.94;
        assert!((some.share - wanted).abs() < 3.0 * some.error, "{some:?}");
        assert!(
            some.text(None).contains("bring an afterpulse within 31 laser pulses"),
            "{}",
            some.text(None)
        );
        let blind = told(0.05, 0.0, 4);
        assert!((blind.share + 4.0 * 0.05 / (1.0 + 4.0 * 0.05)).abs() < 5.0 * blind.error, "{blind:?}");
        assert!(blind.text(None).contains("dead time is longer"), "{}", blind.text(None));
    }

    #[test]
    fn photons_out_of_order_are_left_out() {
        let mut pairs = Pairs::default();
        [10, 12, 11, 12, i64::MAX, i64::MIN].into_iter().for_each(|sync| pairs.add(sync));
        assert_eq!((pairs.near, pairs.far, pairs.photons), (2, 0, 4));
    }
}
