//! Laser pulses of each point as one sorted list, and the point of a photon.

/// The point of photons that belong to none.
pub(super) const NONE: u32 = u32::MAX;

/// Laser pulses of a point: `from` to below `to`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub from: i64,
    pub to: i64,
    pub point: u32,
}

/// From the laser pulse `.0` on, photons belong to the point `.1`.
#[derive(Debug)]
pub(super) struct Cuts(Vec<(i64, u32)>);

impl Cuts {
    /// The cuts of spans in order, and how many laser pulses each of `points` has. A span ends where the next begins.
    pub(super) fn of(spans: &[Span], points: usize) -> (Cuts, Vec<u64>) {
        let mut cuts = vec![(i64::MIN, NONE)];
        let mut pulses = vec![0; points]; // bounded: the points of the scan
        for (i, span) in spans.iter().enumerate() {
            let to = spans.get(i + 1).map_or(span.to, |next| span.to.min(next.from));
            if to <= span.from {
                continue;
            }
            pulses[span.point as usize] += (to - span.from) as u64;
            if cuts.last().is_some_and(|last| last.0 == span.from) {
                cuts.pop();
            }
            cuts.extend([(span.from, span.point), (to, NONE)]);
        }
        (Cuts(cuts), pulses)
    }

    /// The point of a laser pulse. `at` remembers the place: pulses come nearly in order.
    #[inline]
    pub(super) fn point(&self, sync: i64, at: &mut usize) -> u32 {
        while self.0.get(*at + 1).is_some_and(|next| next.0 <= sync) {
            *at += 1;
        }
        while self.0[*at].0 > sync {
            *at -= 1;
        }
        self.0[*at].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pulse_has_one_point_in_any_order() {
        let span = |from, to, point| Span { from, to, point };
        let spans = [span(5, 10, 0), span(10, 20, 1), span(15, 30, 2), span(30, 30, 1), span(40, 41, 0)];
        let (cuts, pulses) = Cuts::of(&spans, 3);
        assert_eq!(pulses, [6, 5, 15]);
        let point =
            |sync| spans.iter().rev().find(|s| (s.from..s.to).contains(&sync)).map_or(NONE, |s| s.point);
        let mut at = 0;
        for sync in (0..50).chain((0..50).rev()).chain([3, 47, 12, 29, 30, 5]) {
            assert_eq!(cuts.point(sync, &mut at), point(sync), "{sync}");
        }
    }
}
