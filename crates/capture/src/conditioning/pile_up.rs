//! Pile-up: a detector with a long dead time records only the first photon of every laser pulse, so late light is too
//! weak. If the number of laser pulses is known, all light follows from the counts.

use rayon::prelude::*;

use crate::data::Capture;
use crate::error::{Error, Result};

#[doc(hidden)]
impl Capture {
    /// Turns counts of first photons into those of all photons, if the number of laser pulses is known
    /// ([`Capture::cycles`]), and tells so in a sentence. The histograms must begin with the first bin that the detector
    /// recorded.
    ///
    /// Of N laser pulses, n = N - (all counts of earlier bins) are without a photon when a bin begins. With h counts in
    /// the bin, -ln(1 - h / n) photons of a laser pulse are expected there, and N times as many in all (Coates 1968).
    /// Their variance is N / n times their number, a few per cent more than that of counts.
    ///
    /// # Errors
    /// `Kind::Input` if a pair has as many counts as there were laser pulses, or more.
    pub fn take_pile_up_out(&mut self) -> Result<Option<String>> {
        let Some(pulses) = self.cycles.take() else { return Ok(None) };
        let totals = self.histograms.chunks_exact(self.bins);
        let most = totals.map(|h| h.iter().map(|v| f64::from(*v)).sum::<f64>()).fold(0.0, f64::max);
        if most >= pulses {
            return Err(Error::input(
                format!("a pair has {most} counts of {pulses} laser pulses, of which each gives one at most"),
                "check cycles, the number of laser pulses of a pair, or leave it out of the file",
            ));
        }
        self.histograms.par_chunks_mut(self.bins).for_each(|histogram| {
            let mut waiting = pulses;
            for value in histogram {
                let first = f64::from(*value);
                *value = (-pulses * (-first / waiting).ln_1p()) as f32;
                waiting -= first;
            }
        });
        Ok(Some(format!(
            "pile-up is taken out: up to {:.1} % of the {pulses:.0} laser pulses of a pair gave a count",
            100.0 * most / pulses
        )))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn all_light_follows_from_first_photons() {
        let light = [0.0, 30.0, 400.0, 5.0, 700.0, 0.0, 90.0];
        let mut waiting = 1000.0;
        let first = light.map(|l: f64| {
            let first = waiting * -(-l / 1000.0f64).exp_m1();
            waiting -= first;
            first as f32
        });
        let points = vec![DVec3::ZERO];
        let counted = Capture::new([1, 1], points.clone(), points, 7, 0.01, first.to_vec());
        let mut capture = Capture { cycles: Some(1000.0), ..counted.clone() };
        assert!(capture.take_pile_up_out().unwrap().is_some_and(|note| note.contains("70.6 %")));
        for (found, light) in capture.histograms.iter().zip(light) {
            assert!((f64::from(*found) - light).abs() < 1e-3 * light.max(1.0), "{found} {light}");
        }
        assert_eq!(capture.cycles, None, "it is taken out once");
        assert_eq!(capture.clone().take_pile_up_out().unwrap(), None);
        let mut few = Capture { cycles: Some(500.0), ..counted };
        assert!(few.take_pile_up_out().unwrap_err().what.contains("500 laser pulses"));
    }
}
