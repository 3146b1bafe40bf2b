//! What an instrument may do to all pairs at once, as laws with numbers. A row of [`LAWS`] is all that there is of a law: how it is
//! proposed, its steps, its words, its effect.
//!
//! Not observable: a common gain (the albedo), a turn of the points in the wall's plane, and one scale of points, paths and scene
//! together, so that a wall of another size and bins of another width are one law.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::decide::EvidenceGate;
use crate::capture::{Capture, METRES_PER_PICOSECOND, gain};
use crate::settings;

/// Product of the principal variances of points over the square of their sum, below which they are a line: a tenth as wide as long.
const FLAT: f64 = 0.01;

/// What laws need to know of a capture.
#[derive(Debug, Clone)]
pub struct LawScan {
    pub laser: Vec<DVec3>,
    sensor: Vec<DVec3>,
    pub scan: [usize; 2],
    /// Logarithms of the light of each pair over its mean.
    logarithms: Vec<f64>,
    /// The middle of the points, and half the longer side of the rectangle around them, metres.
    middle: DVec2,
    pub half: f64,
    is_confocal: bool,
}

impl LawScan {
    pub fn of(capture: &Capture) -> LawScan {
        let light = capture.of_rows(|row| row.iter().map(|v| f64::from(*v)).sum::<f64>());
        let mean = light.iter().sum::<f64>() / light.len().max(1) as f64;
        let logarithm = |v: &f64| (v / mean).max(1e-3).ln();
        let infinity = DVec3::splat(f64::INFINITY);
        let points = capture.laser.iter().chain(&capture.sensor);
        let (low, high) = points.fold((infinity, -infinity), |(l, h), p| (l.min(*p), h.max(*p)));
        let [middle, side] = [0.5 * (low + high), high - low];
        LawScan {
            laser: capture.laser.clone(),
            sensor: capture.sensor.clone(),
            scan: capture.scan,
            logarithms: light.iter().map(logarithm).collect(),
            middle: middle.truncate(),
            half: (0.5 * side.x.max(side.y)).max(f64::MIN_POSITIVE),
            is_confocal: capture.is_nearly_confocal(),
        }
    }

    /// Whether the middles of pairs fill an area: on a line, laws of places and devices are free.
    pub fn fills_area(&self) -> bool {
        let all: Vec<DVec2> = (0..self.laser.len()).map(|pair| self.centre_of(pair)).collect();
        let mean = all.iter().sum::<DVec2>() / all.len().max(1) as f64;
        let [xx, xy, yy] = all
            .iter()
            .map(|p| *p - mean)
            .fold([0.0; 3], |[xx, xy, yy], p| [xx + p.x * p.x, xy + p.x * p.y, yy + p.y * p.y]);
        // Both principal variances from their product and sum.
        xx * yy - xy * xy > FLAT * (xx + yy).powi(2)
    }

    /// The place between laser and sensor point of a pair.
    pub fn place_of(&self, pair: usize) -> DVec3 {
        self.laser[pair].midpoint(self.sensor[pair])
    }

    /// The same in halves of the wall from its middle.
    fn centre_of(&self, pair: usize) -> DVec2 {
        self.centred(0.5 * (self.laser[pair] + self.sensor[pair]))
    }

    fn centred(&self, point: DVec3) -> DVec2 {
        (point.truncate() - self.middle) / self.half
    }

    fn metres(&self, centred: DVec2) -> DVec2 {
        self.middle + self.half * centred
    }

    /// The position of a device by its numbers: x and y in halves of the wall, and the logarithm of z in those.
    fn device(&self, n: &[f64]) -> DVec3 {
        self.metres(DVec2::new(n[0], n[1])).extend(self.half * n[2].exp())
    }
}

/// The number of a pair's column (axis 0) or row (axis 1).
pub fn line_of(scan: [usize; 2], axis: usize, pair: usize) -> usize {
    if axis == 0 { pair / scan[1] } else { pair % scan[1] }
}

/// How numbers of a law are proposed from a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Proposed {
    /// By products of rendered and measured light of each pair: gains.
    ByProducts,
    /// By correlation of rendered and measured light of each line.
    ByCorrelation,
    /// By fits that continue the surface with a step each way; steps of one have this many times the effect of a step of the scale.
    BySteps(i32),
    /// By fits from its starts, where a step of the scale leaves less: nearly every wrong delay or place changes the scale, too.
    AsScale,
    /// By the sharpness of light-cone transforms.
    BySharpness,
    /// By fits from its starts, where other laws leave less and none is proven.
    Last,
    /// By fits of the first and the last lines along this axis.
    ByEnds(usize),
}

/// A number of a pair by a law's numbers.
type OfPair = fn(&LawScan, &[f64], usize) -> f64;
/// A place by a law's numbers, and whether it is one of the laser.
type OfPoint = fn(&[f64], DVec2, bool) -> DVec2;

/// A law.
pub struct Law {
    /// A short name, as in the report.
    pub name: &'static str,
    /// What is wrong, with its numbers in words.
    pub what: fn(&LawScan, &[f64]) -> String,
    /// The option or edit that corrects it.
    pub hint: &'static str,
    pub proposed: Proposed,
    /// Numbers to begin with.
    pub starts: fn(&LawScan) -> Vec<Vec<f64>>,
    /// First steps of the numbers, and how far each may be from 0; none of those of lines.
    pub steps: &'static [[f64; 2]],
    /// Its numbers are of columns (0) or rows (1).
    pub lines: Option<usize>,
    /// By what first steps are multiplied at these numbers.
    unit: fn(&[f64]) -> f64,
    /// Least size of a number that fits tell from 0, where points are moved.
    pub least: f64,
    /// Factor of the counts of a pair.
    gain: Option<OfPair>,
    /// Metres of path by which counts of a pair are late.
    delay: Option<OfPair>,
    /// Where a point of the wall lies truly, in halves of the wall from its middle, and whether it is one of the laser.
    pub of_point: Option<OfPoint>,
    /// Whether these numbers are those of another law.
    pub is_other: fn(&[f64]) -> bool,
    /// Whether other laws resemble it with these numbers, which are then tried, too.
    pub has_rivals: fn(&[f64]) -> bool,
    /// Whether numbers of the other sign are the opposite change.
    pub has_opposite: bool,
    /// Whether it is a property of the rig, and so of the next capture, too.
    is_of_rig: bool,
    /// What it must reach to be undone.
    pub gate: EvidenceGate,
    /// Whether the capture can show it.
    pub applies: fn(&LawScan) -> bool,
}

/// What laws of delays have in common.
const OF_DELAYS: Law = Law {
    name: "",
    what: |_, _| String::new(),
    hint: "",
    proposed: Proposed::AsScale,
    starts: |_| vec![],
    steps: &[],
    lines: None,
    unit: |_| 1.0,
    least: 0.0,
    gain: None,
    delay: None,
    of_point: None,
    is_other: |_| false,
    has_rivals: |_| false,
    has_opposite: true,
    is_of_rig: true,
    gate: EvidenceGate::SEARCHED,
    applies: |_| true,
};
const OF_PLACES: Law = Law {
    proposed: Proposed::BySteps(1),
    least: 0.02,
    hint: "give the points as measured on the wall",
    ..OF_DELAYS
};
const OF_GAINS: Law = Law { proposed: Proposed::ByProducts, has_opposite: false, ..OF_DELAYS };
const OF_DEVICES: Law = Law {
    hint: "give device_at if it is known",
    starts: positions,
    steps: &[[0.3, 8.0], [0.3, 8.0], [0.3, 2.5]],
    ..OF_GAINS
};

/// Where the scene is once it has moved, and where on the wall it has, in halves of the wall. Maps show it where it was before.
const fn of_motion<const AXIS: usize>() -> Law {
    Law {
        what: |s, n| {
            let at = s.metres(DVec2::splat(n[3]))[AXIS];
            let [x, y, z] = [n[0], n[1], n[2]].map(|n| 100.0 * s.half * n);
            format!(
                "the scene moved during the scan: points of the wall where {} is above {at:.2} m see it ({x:.1}, {y:.1}, {z:.1}) cm from \
                 where the others do",
                ["x", "y"][AXIS]
            )
        },
        hint: "keep the scene still, or reconstruct a part of the lines",
        proposed: Proposed::ByEnds(AXIS),
        steps: &[[0.05, 2.0], [0.05, 2.0], [0.05, 2.0], [0.15, 0.9]],
        of_point: Some(|n, p, _| p - has_moved(n, p[AXIS]) * DVec2::new(n[0], n[1])),
        delay: Some(|s, n, pair| 2.0 * s.half * n[2] * has_moved(n, s.centre_of(pair)[AXIS])),
        is_of_rig: false,
        // Elsewhere pairs that see the scene before and behind it share points.
        applies: |s| s.is_confocal,
        ..OF_DELAYS
    }
}

/// Logarithms of gains of every line.
const fn of_gains<const AXIS: usize>() -> Law {
    Law {
        what: |_, n| gains_in_words(LINES[AXIS], n),
        hint: ["divide the counts by the power of each column", "divide the counts by the power of each row"]
            [AXIS],
        lines: Some(AXIS),
        gain: Some(|s, n, pair| n[line_of(s.scan, AXIS, pair)].exp()),
        is_of_rig: false,
        gate: EvidenceGate::GAINS,
        applies: |s| s.scan[AXIS] >= 8 && s.scan[1 - AXIS] >= 4,
        ..OF_GAINS
    }
}

/// Delays of every line.
const fn of_delays<const AXIS: usize>() -> Law {
    Law {
        what: |_, n| delays_in_words(LINES[AXIS], ["x", "y"][AXIS], n),
        hint: "measure the delay of each line, or correct the times before they are binned",
        proposed: Proposed::ByCorrelation,
        lines: Some(AXIS),
        delay: Some(|s, n, pair| n[line_of(s.scan, AXIS, pair)]),
        has_opposite: false,
        applies: |s| s.scan[AXIS] >= 4 && s.scan[1 - AXIS] > 1,
        ..OF_DELAYS
    }
}

const LINES: [&str; 2] = ["columns", "rows"];

/// All laws.
pub const LAWS: &[Law] = &[
    Law {
        name: "time zero",
        what: |_, n| format!("{}, as of a wrong time zero", off_path_0(n)),
        hint: "correct the path of the first bin",
        starts: |_| vec![vec![-0.1], vec![0.1]],
        steps: &[[0.03, 0.6]],
        delay: Some(|_, n, _| n[0]),
        ..OF_DELAYS
    },
    Law {
        name: "record",
        what: |_, n| format!("{}, as of a record that is rolled or begins elsewhere", off_path_0(n)),
        hint: "give the path of the first bin, and roll the bins back",
        proposed: Proposed::BySharpness,
        steps: &[[0.06, 8.0]],
        delay: Some(|_, n, _| n[0]),
        ..OF_DELAYS
    },
    Law {
        name: "lean",
        what: |s, n| {
            let length = (n[0].powi(2) + n[1].powi(2)).sqrt();
            let (ends, [x, y], middle) = (200.0 * length, [n[0] / length, n[1] / length], later(n[2]));
            format!(
                "counts are later by {ends:.1} cm of path from one end of the wall to the other, most along ({x:.2}, {y:.2}), and {middle} in \
                 the middle, as of a wall that leans"
            )
            .replace("-0.00", "0.00")
                + if s.is_confocal { "" } else { ", or of legs that were not taken out" }
        },
        hint: "give the points with their z, or take the legs of the device out of every pair",
        starts: |_| {
            [-0.07, 0.07].into_iter().flat_map(|n| [vec![n, 0.0, 0.07], vec![0.0, n, 0.07]]).collect()
        },
        steps: &[[0.03, 0.3]; 3],
        delay: Some(|s, n, pair| DVec2::new(n[0], n[1]).dot(s.centre_of(pair)) + n[2]),
        ..OF_DELAYS
    },
    Law {
        name: "legs",
        what: |s, n| {
            format!(
                "counts are later the farther the point on the wall is from {}, as of a device there whose legs were taken out as one \
                 constant",
                place(s.device(n))
            )
        },
        hint: "take the legs of the device out of every pair",
        starts: |_| [1.0f64, 2.0, 4.0].map(|z| vec![0.0, 0.0, z.ln()]).to_vec(),
        // The legs of a far device are like another scale.
        steps: &[[0.4, 3.0], [0.4, 3.0], [0.4, 1.4]],
        delay: Some(|s, n, pair| {
            let device = s.device(n);
            let middle = device.distance(s.middle.extend(0.0));
            let leg = |point: DVec3| device.distance(point) - middle;
            leg(s.laser[pair]) + leg(s.sensor[pair])
        }),
        has_opposite: false,
        ..OF_DELAYS
    },
    Law {
        name: "walk",
        what: |_, n| {
            format!("pairs with e times as much light are {}, as of a detector's time walk", later(n[0]))
        },
        hint: "correct times by the strength of the pulses before they are binned",
        starts: |_| vec![vec![-0.02], vec![0.02]],
        steps: &[[0.01, 0.2]],
        delay: Some(|s, n, pair| n[0] * s.logarithms[pair]),
        ..OF_DELAYS
    },
    Law {
        name: "scale",
        what: |_, n| {
            let [wall, bins] = [1.0 + n[0], 1.0 / (1.0 + n[0])];
            format!(
                "the wall is {wall:.3} times as large as given, or bins are {bins:.3} times as wide: no capture tells which"
            )
        },
        hint: "give the wall's size, or the bin width",
        // Nothing else changes a capture by as much as feet or half a wall do.
        has_rivals: |n| n[0].abs() < 0.4,
        steps: &[[0.02, 1.2]],
        unit: |n| 1.0 + n[0],
        of_point: Some(|n, p, _| (1.0 + n[0]) * p),
        ..OF_PLACES
    },
    Law {
        name: "sides",
        what: |_, n| {
            let [x, y] = [1.0 + n[0], 1.0 + n[1]];
            format!("the wall is {x:.3} times as wide along x, and {y:.3} times along y, as given")
        },
        // Both sides by one factor are the scale.
        is_other: |n| (n[0] - n[1]).abs() < 0.05,
        steps: &[[0.04, 0.5]; 2],
        of_point: Some(|n, p, _| p * DVec2::new(1.0 + n[0], 1.0 + n[1])),
        ..OF_PLACES
    },
    Law {
        name: "shear",
        what: |_, n| {
            let x = n[0];
            format!(
                "the points are sheared: x lies off by {x:.3} of y, or the scene moved so during the scan"
            )
        },
        steps: &[[0.05, 0.6]],
        of_point: Some(|n, p, _| p + DVec2::new(n[0] * p.y, 0.0)),
        ..OF_PLACES
    },
    Law {
        name: "radial",
        what: |_, n| {
            let out = 1.0 + n[0];
            format!(
                "points half a wall from the middle lie {out:.3} times as far out as given, with the square of the distance, as of mirrors"
            )
        },
        proposed: Proposed::BySteps(2),
        steps: &[[0.04, 0.4]],
        of_point: Some(|n, p, _| (1.0 + n[0] * p.length_squared()) * p),
        ..OF_PLACES
    },
    Law {
        name: "angles",
        what: |_, n| {
            let [x, y] = [1.0 + n[0], 1.0 + n[1]];
            format!(
                "points at the wall's sides lie {x:.3} times as far out along x, and {y:.3} times along y, as given, with the square of that \
                 coordinate, as of two mirrors whose angles were taken for places"
            )
        },
        proposed: Proposed::Last,
        starts: |_| [[-0.08, 0.0], [0.0, -0.08], [0.08, 0.0], [0.0, 0.08]].map(|n| n.to_vec()).to_vec(),
        // Both sides by one factor are nearly the radial law.
        is_other: |n| (n[0] - n[1]).abs() < 0.05,
        steps: &[[0.05, 0.4]; 2],
        of_point: Some(|n, p, _| p * DVec2::new(1.0 + n[0] * p.x * p.x, 1.0 + n[1] * p.y * p.y)),
        ..OF_PLACES
    },
    Law {
        name: "keystone",
        what: |_, n| {
            let [x0, x1, y0, y1] = [1.0 - n[0], 1.0 + n[0], 1.0 - n[1], 1.0 + n[1]];
            format!(
                "the points form a keystone: from one end of the wall to the other, x is stretched from {x0:.2} to {x1:.2} along y, y from \
                 {y0:.2} to {y1:.2} along x"
            )
        },
        steps: &[[0.05, 0.5]; 2],
        of_point: Some(|n, p, _| p + p.x * p.y * DVec2::new(n[0], n[1])),
        ..OF_PLACES
    },
    Law { name: "moved along x", ..of_motion::<0>() },
    Law { name: "moved along y", ..of_motion::<1>() },
    Law {
        name: "one laser",
        what: |s, n| {
            let DVec2 { x, y } = s.metres(DVec2::new(n[0], n[1]));
            format!(
                "the laser stayed at about ({x:.2}, {y:.2}) m for all pairs, though the capture says that it lights the sensor's point"
            )
        },
        hint: "give the laser points as they were",
        proposed: Proposed::AsScale,
        starts: |_| {
            [[0.0; 2], [0.5, 0.5], [-0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]].map(|at| at.to_vec()).to_vec()
        },
        steps: &[[0.2, 2.0]; 2],
        has_opposite: false,
        of_point: Some(|n, p, is_laser| if is_laser { DVec2::new(n[0], n[1]) } else { p }),
        applies: |s| s.is_confocal,
        ..OF_DELAYS
    },
    Law {
        name: "laser",
        what: |s, n| format!("the laser's light on the wall weakens as from {}", device_at(s, n)),
        gain: Some(|s, n, pair| fall(s.device(n), s.laser[pair])),
        ..OF_DEVICES
    },
    Law {
        name: "detector",
        what: |s, n| format!("the detector's light from the wall weakens as to {}", device_at(s, n)),
        gain: Some(|s, n, pair| fall(s.device(n), s.sensor[pair])),
        applies: |s| !s.is_confocal,
        ..OF_DEVICES
    },
    Law {
        name: "both",
        what: |s, n| format!("the light of laser and detector weakens as from {}", device_at(s, n)),
        gain: Some(|s, n, pair| fall(s.device(n), s.laser[pair]) * fall(s.device(n), s.sensor[pair])),
        ..OF_DEVICES
    },
    Law { name: "gains of columns", ..of_gains::<0>() },
    Law { name: "gains of rows", ..of_gains::<1>() },
    Law { name: "delays of columns", ..of_delays::<0>() },
    Law { name: "delays of rows", ..of_delays::<1>() },
];

/// The law of this name.
pub fn named(name: &str) -> &'static Law {
    LAWS.iter().find(|law| law.name == name).expect("a law")
}

/// The law of a correction of a file, and the scan of a capture about the wall of the file; `None` if the law is of its own capture alone,
/// or of another kind of scan.
///
/// # Errors
/// No such law, or a number of lines that is not the capture's, as text.
pub fn stored(
    of: &settings::Correction,
    capture: &Capture,
) -> Result<Option<(&'static Law, LawScan)>, String> {
    let given = of.numbers.len();
    let law = LAWS.iter().find(|law| law.name == of.law);
    let law = law.filter(|law| law.lines.is_some() || law.steps.len() == given);
    let law = law.ok_or_else(|| format!("no law {:?} of {given} numbers is known", of.law))?;
    let count = law.count(capture.scan);
    if count != given {
        return Err(format!("it has {given} {}, the capture has {count}", law.name));
    }
    let scan = LawScan { middle: of.middle.into(), half: of.half, ..LawScan::of(capture) };
    Ok((law.is_of_rig && (law.applies)(&scan)).then_some((law, scan)))
}

/// Positions of a device to begin with.
fn positions(_: &LawScan) -> Vec<Vec<f64>> {
    const X: [f64; 9] = [0.0, 1.0, -1.0, 0.0, 0.0, 1.0, -1.0, 1.0, -1.0];
    const Y: [f64; 9] = [0.0, 0.0, 0.0, 1.0, -1.0, 1.0, 1.0, -1.0, -1.0];
    let of = |z: f64| (0..9).map(move |i| vec![X[i] * z.max(1.0), Y[i] * z.max(1.0), z.ln()]);
    [0.5f64, 1.0, 2.0, 4.0].into_iter().flat_map(of).collect()
}

/// cos / distance² over metres², of a device in front of a wall at z = 0.
fn fall(device: DVec3, point: DVec3) -> f64 {
    gain::falloff(device, point, DVec3::Z).max(1e-9)
}

/// 1 where a coordinate `at` is behind the place of the motion, else 0.
fn has_moved(n: &[f64], at: f64) -> f64 {
    f64::from(u8::from(at > n[3]))
}

fn later(metres: f64) -> String {
    let side = if metres > 0.0 { "later" } else { "earlier" };
    let [centimetres, picoseconds] = [100.0 * metres.abs(), (metres / METRES_PER_PICOSECOND).abs()];
    format!("{centimetres:.1} cm of path ({picoseconds:.0} ps) {side}")
}

fn off_path_0(n: &[f64]) -> String {
    format!("all counts are {} than path 0 says", later(n[0]))
}

fn place(p: DVec3) -> String {
    format!("({:.2}, {:.2}, {:.2}) m", p.x, p.y, p.z)
}

fn device_at(s: &LawScan, n: &[f64]) -> String {
    format!("a device at {}", place(s.device(n)))
}

/// How numbers of lines follow each other.
enum LineShape {
    /// Every second line differs from the others by this.
    Alternating(f64),
    /// From a line on, numbers are higher by this.
    Step(usize, f64),
    /// Numbers rise by this from line to line.
    Trend(f64),
    /// None of these: the root mean square.
    Own(f64),
}

/// The simplest shape that leaves less than 30 % of the squares.
fn line_shape(numbers: &[f64]) -> LineShape {
    const MOST: f64 = 0.3;
    let count = numbers.len();
    let mean_of = |of: &dyn Fn(usize) -> bool| {
        let chosen = || numbers.iter().enumerate().filter(|(line, _)| of(*line));
        chosen().map(|(_, number)| number).sum::<f64>() / chosen().count().max(1) as f64
    };
    let mean = mean_of(&|_| true);
    let left = |model: &dyn Fn(usize) -> f64| -> f64 {
        numbers.iter().enumerate().map(|(line, n)| (n - model(line)).powi(2)).sum()
    };
    let all = left(&|_| mean);
    let [even, odd] = [0, 1].map(|parity| mean_of(&|line| line % 2 == parity));
    if left(&|line| if line % 2 == 0 { even } else { odd }) < MOST * all {
        return LineShape::Alternating(odd - even);
    }
    let step = (2..count - 1)
        .map(|at| (at, [mean_of(&|line| line < at), mean_of(&|line| line >= at)]))
        .map(|(at, sides)| (at, sides[1] - sides[0], left(&|line| sides[usize::from(line >= at)])))
        .min_by(|a, b| a.2.total_cmp(&b.2));
    let middle = 0.5 * (count as f64 - 1.0);
    let centred = |line: usize| line as f64 - middle;
    let squares: f64 = (0..count).map(|line| centred(line).powi(2)).sum();
    let slope = numbers.iter().enumerate().map(|(line, n)| centred(line) * n).sum::<f64>() / squares;
    let trend = left(&|line| mean + slope * centred(line));
    match step {
        Some((at, height, rest)) if rest < MOST * all && rest < trend => LineShape::Step(at, height),
        _ if trend < MOST * all => LineShape::Trend(slope),
        _ => LineShape::Own((numbers.iter().map(|n| n * n).sum::<f64>() / count as f64).sqrt()),
    }
}

/// Delays of lines, metres of path, as a sentence.
fn delays_in_words(lines: &str, axis: &str, delays: &[f64]) -> String {
    let picoseconds = |metres: f64| metres / METRES_PER_PICOSECOND;
    match line_shape(delays) {
        LineShape::Alternating(by) => format!(
            "every second one of the {lines} is late by {:.0} ps, as of a scanner that lags behind on its way back",
            picoseconds(by).abs()
        ),
        LineShape::Step(at, by) => format!(
            "from line {at} of the {lines} on, counts are {:.0} ps {} than before, as of a time zero that jumped",
            picoseconds(by).abs(),
            if by > 0.0 { "later" } else { "earlier" }
        ),
        LineShape::Trend(by) => format!(
            "counts are later by {:.1} ps with each line along {axis}, as of a skew or drift of time zero",
            picoseconds(by)
        ),
        LineShape::Own(rms) => {
            format!("the {lines} have delays of their own, of {:.0} ps (root mean square)", picoseconds(rms))
        }
    }
}

/// Logarithms of gains of lines as a sentence.
fn gains_in_words(lines: &str, logs: &[f64]) -> String {
    match line_shape(logs) {
        LineShape::Alternating(by) => {
            format!("every second one of the {lines} has {:.2} times as many counts", by.abs().exp())
        }
        LineShape::Step(at, by) => format!(
            "from line {at} of the {lines} on, counts are {:.2} times as high, as of a laser whose power changed",
            by.exp()
        ),
        LineShape::Trend(by) => {
            format!(
                "counts change by a factor of {:.3} with each of the {lines}, as of a laser that warms up",
                by.exp()
            )
        }
        LineShape::Own(rms) => format!(
            "the {lines} have gains of their own, which differ by {:.0} % (root mean square), as of a laser or a detector that drifts",
            100.0 * rms.exp_m1()
        ),
    }
}

impl std::fmt::Debug for Law {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl Law {
    /// Numbers of the law for this scan: those of lines are as many as the lines.
    pub fn count(&self, scan: [usize; 2]) -> usize {
        self.lines.map_or(self.steps.len(), |axis| scan[axis])
    }

    /// Whether steps from one surface find its numbers.
    pub fn is_closed_form(&self) -> bool {
        matches!(self.proposed, Proposed::ByCorrelation | Proposed::ByProducts)
    }

    /// First steps at these numbers, times a factor, and how far each number may be from 0.
    pub fn steps_at(&self, numbers: &[f64], factor: f64) -> Vec<[f64; 2]> {
        let unit = factor * (self.unit)(numbers);
        self.steps.iter().map(|[step, far]| [unit * step, *far]).collect()
    }

    /// Whether the counts of a capture change, beyond its time zero.
    pub fn changes_counts(&self) -> bool {
        let has_effect = self.gain.is_some() || self.delay.is_some();
        has_effect && !["time zero", "record"].contains(&self.name)
    }

    /// Logarithms of the factors of the counts of these pairs; empty: 0. A common one is the albedo's.
    pub fn logs(&self, scan: &LawScan, numbers: &[f64], pairs: &[usize]) -> Vec<f64> {
        let Some(gain) = self.gain else { return vec![] };
        let logs: Vec<f64> = pairs.iter().map(|pair| gain(scan, numbers, *pair).ln()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len().max(1) as f64;
        logs.into_iter().map(|log| log - mean).collect()
    }

    /// Factors of the counts of all pairs, if it is a law of gains.
    pub fn gains(&self, scan: &LawScan, numbers: &[f64]) -> Option<Vec<f64>> {
        let pairs: Vec<usize> = (0..scan.laser.len()).collect();
        self.gain.map(|_| self.logs(scan, numbers, &pairs).into_iter().map(f64::exp).collect())
    }

    /// Metres of path by which counts of all pairs are late; empty: 0.
    pub fn delays(&self, scan: &LawScan, numbers: &[f64]) -> Vec<f64> {
        let all = |delay: fn(&LawScan, &[f64], usize) -> f64| {
            (0..scan.laser.len()).map(|pair| delay(scan, numbers, pair)).collect()
        };
        self.delay.map_or_else(Vec::new, all)
    }

    /// The capture without it. Counts are divided so that photon noise keeps its size, late ones moved by whole bins unless all are
    /// equally late.
    pub fn undone(&self, capture: &Capture, scan: &LawScan, numbers: &[f64]) -> Capture {
        let mut undone = capture.clone();
        if let Some(of_point) = self.of_point {
            undone.given.get_or_insert_with(|| Arc::new([capture.laser.clone(), capture.sensor.clone()]));
            for (points, is_laser) in [(&mut undone.laser, true), (&mut undone.sensor, false)] {
                for point in points {
                    let there = scan.metres(of_point(numbers, scan.centred(*point), is_laser));
                    *point = there.extend(point.z);
                }
            }
        }
        if let Some(gains) = self.gains(scan, numbers) {
            undone.divide(gains);
        }
        let delays = self.delays(scan, numbers);
        let first = delays.first().copied().unwrap_or(0.0);
        if delays.iter().all(|delay| *delay == first) {
            undone.t_start -= first;
            return undone;
        }
        let bins = capture.bins;
        for (row, delay) in undone.histograms.chunks_exact_mut(bins).zip(delays) {
            let late = (delay / capture.bin_width).round().clamp(-(bins as f64), bins as f64) as isize;
            let from = row.to_vec();
            let at = |bin: usize| bin.saturating_add_signed(late).min(bins - 1);
            row.iter_mut().enumerate().for_each(|(bin, v)| *v = from[at(bin)]);
        }
        undone
    }

    /// The correction as a file has it.
    pub fn as_stored(&self, scan: &LawScan, numbers: &[f64]) -> settings::Correction {
        let (law, numbers) = (self.name.into(), numbers.to_vec());
        settings::Correction { law, numbers, middle: scan.middle.to_array(), half: scan.half }
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    /// 16 x 16 confocal pairs of a wall of 2 m with a peak in bin 60 of 120, of 1 cm each.
    fn capture() -> Capture {
        let at = |i: usize| 2.0 * (i as f64 + 0.5) / 16.0 - 1.0;
        let points: Vec<DVec3> = (0..256).map(|pair| dvec3(at(pair / 16), at(pair % 16), 0.0)).collect();
        let mut counts = vec![0.0; 256 * 120];
        counts.iter_mut().skip(60).step_by(120).for_each(|v| *v = 100.0);
        Capture::new([16, 16], points.clone(), points, 120, 0.01, counts)
    }

    #[test]
    fn laws_have_names_of_their_own_and_starts_within_reach() {
        let setting = LawScan::of(&capture());
        for law in LAWS {
            assert_eq!(LAWS.iter().filter(|other| other.name == law.name).count(), 1, "{law:?}");
            for start in (law.starts)(&setting) {
                assert_eq!(start.len(), law.steps.len(), "{law:?}");
                assert!(
                    start.iter().zip(law.steps).all(|(n, [_, far])| n.abs() <= *far),
                    "{law:?}: {start:?}"
                );
                assert!(!(law.what)(&setting, &start).contains("NaN"), "{law:?}");
            }
        }
    }

    #[test]
    fn what_a_law_does_is_undone() {
        let proper = capture();
        let setting = LawScan::of(&proper);
        let pairs: Vec<usize> = (0..256).collect();
        // Delays of whole bins, and gains.
        let mut late = proper.clone();
        for (pair, row) in late.histograms.chunks_exact_mut(120).enumerate() {
            row.rotate_right((2.0 + 2.0 * (pair % 16) as f64 / 15.0).round() as usize);
        }
        let lean = named("lean");
        let undone = lean.undone(&late, &setting, &[0.0, 0.01, 0.03]);
        assert_eq!(undone.histograms, proper.histograms);
        assert!((named("time zero").undone(&proper, &setting, &[0.13]).t_start + 0.13).abs() < 1e-12);
        // Legs of a device in front of the middle: its own point is the one that is not late.
        let late = named("legs").delays(&setting, &[0.0, 0.0, 0.0]);
        let corner = 2.0 * 0.9375 * (3.0f64.sqrt() - 1.0);
        assert!(
            (late[0] - corner).abs() < 1e-9 && late.iter().all(|delay| *delay >= 0.0),
            "{} {corner}",
            late[0]
        );
        let of_rows: Vec<f64> = (0..16).map(|row| if row < 6 { 0.0 } else { -0.2 }).collect();
        let starts = |name: &str| (named(name).starts)(&setting).swap_remove(1);
        for (name, numbers) in
            [("laser", starts("laser")), ("both", starts("both")), ("gains of rows", of_rows.clone())]
        {
            let of = named(name);
            let logs = of.logs(&setting, &numbers, &pairs);
            let mut weighted = proper.clone();
            for (row, log) in weighted.histograms.chunks_exact_mut(120).zip(&logs) {
                row.iter_mut().for_each(|v| *v *= log.exp() as f32);
            }
            let undone = of.undone(&weighted, &setting, &numbers);
            let factor = undone.histograms[60] / 100.0;
            assert!(
                undone.histograms.iter().skip(60).step_by(120).all(|v| (v / factor - 100.0).abs() < 1e-3)
            );
            assert!(logs.iter().any(|log| log.abs() > 0.05), "{name}");
        }
    }

    /// A scene that moved sees moved points, and later counts by twice its way along z, from there on.
    #[test]
    fn a_motion_is_undone_behind_its_place() {
        let capture = capture();
        let setting = LawScan::of(&capture);
        let half = setting.half;
        for (name, is_behind) in [("moved along x", DVec3::X), ("moved along y", DVec3::Y)] {
            let undone = named(name).undone(&capture, &setting, &[0.2, -0.1, 0.02 / half, 0.0]);
            for pair in 0..256 {
                let moved = capture.laser[pair].dot(is_behind) > 0.0;
                let by = if moved { dvec3(-0.2 * half, 0.1 * half, 0.0) } else { DVec3::ZERO };
                assert!(undone.laser[pair].distance(capture.laser[pair] + by) < 1e-12, "{name} {pair}");
                let peak = 60 - if moved { 4 } else { 0 };
                assert_eq!(undone.histogram(pair)[peak], 100.0, "{name} {pair}");
            }
        }
    }

    #[test]
    fn points_on_a_line_fill_no_area() {
        let square = capture();
        assert!(LawScan::of(&square).fills_area());
        let mut line = square.clone();
        line.laser.iter_mut().for_each(|p| p.y = 0.5 * p.x + 0.02 * p.y);
        line.sensor = line.laser.clone();
        assert!(!LawScan::of(&line).fills_area());
    }

    #[test]
    fn points_are_moved_about_their_middle() {
        let mut capture = capture();
        capture.laser.iter_mut().chain(&mut capture.sensor).for_each(|p| p.x += 3.0);
        let setting = LawScan::of(&capture);
        let wider = named("scale").undone(&capture, &setting, &[0.1]);
        let sheared = named("shear").undone(&capture, &setting, &[0.2]);
        let (at, half) = (capture.laser[0] - dvec3(3.0, 0.0, 0.0), 15.0 / 16.0);
        assert!(wider.laser[0].distance(1.1 * at + dvec3(3.0, 0.0, 0.0)) < 1e-12);
        assert!(sheared.sensor[0].distance(at + dvec3(3.0 + 0.2 * at.y, 0.0, 0.0)) < 1e-12);
        assert_eq!(sheared.given.as_deref(), Some(&[capture.laser.clone(), capture.sensor.clone()]));
        let sides = named("sides").undone(&capture, &setting, &[0.1, -0.2]);
        assert!(sides.laser[0].distance(dvec3(1.1 * at.x + 3.0, 0.8 * at.y, 0.0)) < 1e-12);
        let by_angles = named("angles").undone(&capture, &setting, &[0.1, -0.2]);
        let [x, y] = [at.x / half, at.y / half];
        let there = dvec3(at.x * (1.0 + 0.1 * x * x) + 3.0, at.y * (1.0 - 0.2 * y * y), 0.0);
        assert!(by_angles.laser[0].distance(there) < 1e-12);
        let farther = named("radial").undone(&capture, &setting, &[0.1]);
        let edge = capture.laser[8] - dvec3(3.0, 0.0, 0.0);
        let out = 1.0 + 0.1 * (edge / half).truncate().length_squared();
        assert!(farther.laser[8].distance(out * edge + dvec3(3.0, 0.0, 0.0)) < 1e-12);
    }

    #[test]
    fn delays_of_lines_are_undone_and_patterns_have_names() {
        let picosecond = METRES_PER_PICOSECOND;
        let mut capture = Capture::new(
            [16, 2],
            vec![DVec3::ZERO; 32],
            vec![DVec3::ZERO; 32],
            50,
            32.0 * picosecond,
            vec![0.0; 32 * 50],
        );
        let proper =
            capture.clone().with(|c| c.histograms.iter_mut().skip(20).step_by(50).for_each(|v| *v = 9.0));
        let late = |line: usize| [0, 3, 1, 0, 2][line % 5];
        for pair in 0..32 {
            capture.histograms[pair * 50 + 20 + late(pair / 2)] = 9.0;
        }
        let (law, scan) = (named("delays of columns"), LawScan::of(&capture));
        let of = |delay: &dyn Fn(usize) -> f64| (0..16).map(|line| picosecond * delay(line)).collect();
        let numbers: Vec<f64> = of(&|line| 32.0 * late(line) as f64);
        assert_eq!(law.undone(&capture, &scan, &numbers), proper);
        let names = |delay: &dyn Fn(usize) -> f64, words: &str| {
            let numbers: Vec<f64> = of(delay);
            let what = (law.what)(&scan, &numbers);
            assert!(what.contains(words), "{what}");
        };
        names(&|line| 100.0 * (line % 2) as f64, "every second one of the columns is late by 100 ps");
        names(
            &|line| if line < 9 { 0.0 } else { 60.0 },
            "from line 9 of the columns on, counts are 60 ps later",
        );
        names(&|line| 7.0 * line as f64, "later by 7.0 ps with each line along x");
        names(&|line| 50.0 * late(line * 7) as f64, "delays of their own");
        let names = |log: &dyn Fn(usize) -> f64, words: &str| {
            let what = (named("gains of rows").what)(&scan, &(0..16).map(log).collect::<Vec<f64>>());
            assert!(what.contains(words), "{what}");
        };
        names(&|line| 0.2 * (line % 2) as f64, "every second one of the rows has 1.22 times as many counts");
        names(
            &|line| if line < 6 { 0.0 } else { -0.5 },
            "from line 6 of the rows on, counts are 0.61 times as high",
        );
        names(&|line| 0.01 * line as f64, "change by a factor of 1.010 with each of the rows");
        names(&|line| 0.1 * late(line * 7) as f64, "gains of their own, which differ by 18 %");
    }

    #[test]
    fn a_stored_correction_undoes_the_same() {
        let capture = capture();
        let scan = LawScan::of(&capture);
        for law in LAWS.iter().filter(|law| law.is_of_rig && (law.applies)(&scan)) {
            let numbers: Vec<f64> = match law.lines {
                Some(axis) => (0..capture.scan[axis]).map(|line| 0.01 * (line % 3) as f64).collect(),
                None => law.steps.iter().map(|[step, _]| 0.5 * step).collect(),
            };
            let (again, about) = stored(&law.as_stored(&scan, &numbers), &capture).unwrap().unwrap();
            let undone = again.undone(&capture, &about, &numbers);
            assert_eq!(undone, law.undone(&capture, &scan, &numbers), "{law:?}");
        }
    }
}
