//! The position of a calibrated object: mean and covariance of the likelihood over the box, as few counts have many maxima.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::calibration::{Calibration, check_scan};
use crate::capture::Capture;
use crate::constants::{CALIBRATED_LIGHT, PROFILE_ERROR};
use crate::error::{Error, Result};
use crate::locate::{Finding, Position, needed, unmeasured};
use crate::symmetric::square;

/// Least light, in that of the calibration.
const LEAST_LIGHT: f64 = 0.02;
/// Standard deviations of χ² that are chance.
const CHANCE: f64 = 2.0;
/// Logarithms of the likelihood this far below the largest one are none.
const NEGLIGIBLE: f64 = 30.0;

/// Steps along the longest side of a box.
const STEPS: f64 = 20.0;
/// Quadratures, each within the box that the one before leaves, while that is this much smaller along an axis; and how far it reaches, in
/// standard deviations.
const FINER: usize = 4;
const LESS: f64 = 0.6;
const FAR: f64 = 4.0;

/// What a quadrature finds.
struct BoxPosition {
    position: Position,
    /// Drop of χ² over the excess.
    drop: f64,
    excess: f64,
}

/// A place of the box.
struct Node {
    at: DVec3,
    /// Squares of the object's counts, and their products with the measured ones, in variances.
    squares: f64,
    product: f64,
    /// What errors of the profile change: −2 times the logarithm of the likelihood, and the squares in it.
    misfit: f64,
    excused: f64,
}

impl Node {
    /// The best light and the logarithm of the likelihood, with a prior of the light.
    fn light(&self) -> [f64; 2] {
        let sure = CALIBRATED_LIGHT.powi(-2);
        let light = ((self.product + sure) / (self.squares + sure)).max(LEAST_LIGHT);
        let off = light - 1.0;
        let squares = light * light * self.squares + sure * off * off + self.misfit;
        [light, light * self.product - 0.5 * squares]
    }
}

impl Calibration {
    /// The position of the object in a capture; none where it is not `certain` to be there and the counts do not prove it. `volume`: the
    /// box [default: that of the positions of the calibration].
    ///
    /// # Errors
    /// A capture of another scan; a box that no light of the object reaches.
    pub fn locate(&self, capture: &Capture, volume: Option<[DVec3; 2]>, certain: bool) -> Result<Finding> {
        check_scan(capture, self.pairs.len(), self.pairs[0].room.len(), self.bins)?;
        let [low, high] = volume.unwrap_or(self.volume);
        let size = high - low;
        if !(low.is_finite() && size.is_finite() && size.min_element() > 0.0) {
            return Err(Error::options(
                format!("the box of the positions is empty: from {low} to {high} m"),
                "give three ranges of metres, each from small to large",
            ));
        }
        let mut corners = [low, high];
        let mut found = self.within(capture, corners)?;
        for _ in 0..FINER {
            // As far as the position may be, and two steps more.
            let reach =
                FAR * found.position.deviations() + 2.0 * (corners[1] - corners[0]).max_element() / STEPS;
            let next = [(found.position.at - reach).max(low), (found.position.at + reach).min(high)];
            if (next[1] - next[0]).cmpgt(LESS * (corners[1] - corners[0])).all() {
                break;
            }
            corners = next;
            found = self.within(capture, corners)?;
        }
        let BoxPosition { position, drop, excess } = found;
        let (drops, needed) = (vec![drop], needed(self.pairs.len(), capture.bins));
        let off = (position.at - self.middle()).length();
        let position = Position { unmeasured: unmeasured(position.covariance, size, off), ..position };
        let positions = if certain || drop >= needed { vec![position] } else { vec![] };
        Ok(Finding { positions, background: 0.0, excess, drops, needed, volume: [low, high] })
    }

    /// The position within a box.
    fn within(&self, capture: &Capture, corners: [DVec3; 2]) -> Result<BoxPosition> {
        let (nodes, squares, used) = self.nodes(capture, corners);
        let best = nodes.iter().max_by(|a, b| a.light()[1].total_cmp(&b.light()[1]));
        let Some(best) = best.filter(|best| best.squares > 0.0) else {
            return Err(Error::options("no light of the box reaches the bins", "give another --volume"));
        };
        let [light, _] = best.light();
        let drop = light * (2.0 * best.product - light * best.squares);
        // Residuals by chance are no excess.
        let free = (used - 4.0).max(1.0);
        let excess = ((squares - best.excused - drop) / free / (1.0 + CHANCE * (2.0 / free).sqrt())).max(1.0);
        Ok(BoxPosition {
            position: self.position(&nodes, excess, corners[1] - corners[0]),
            drop: drop / excess,
            excess,
        })
    }

    /// All places of the box; squares of the counts beside the room, and how many there are.
    fn nodes(&self, capture: &Capture, [low, high]: [DVec3; 2]) -> (Vec<Node>, f64, f64) {
        let bins = capture.bins;
        let rest: Vec<Vec<f64>> = (self.pairs.iter().enumerate())
            .map(|(which, pair)| {
                let counts = &capture.histograms[which * bins..(which + 1) * bins];
                let mut rest: Vec<f64> =
                    counts.iter().zip(&pair.room).map(|(c, r)| f64::from(*c) - r).collect();
                pair.leveled(&mut rest);
                rest
            })
            .collect();
        let (mut squares, mut used) = (0.0, 0.0);
        for (pair, rest) in self.pairs.iter().zip(&rest) {
            for (weight, rest) in pair.weights.iter().zip(rest).filter(|(weight, _)| **weight > 0.0) {
                squares += weight * rest * rest;
                used += 1.0;
            }
            used -= 1.0;
        }
        let counts =
            ((high - low) / ((high - low).max_element() / STEPS)).ceil().max(DVec3::ONE).as_usizevec3();
        let pitch = (high - low) / counts.as_dvec3();
        let node = |index: usize| {
            let place = [index % counts.x, index / counts.x % counts.y, index / counts.x / counts.y];
            let at = low + pitch * (DVec3::from_array(place.map(|i| i as f64)) + 0.5);
            let mut node = Node { at, squares: 0.0, product: 0.0, misfit: 0.0, excused: 0.0 };
            let (mut lit, mut weights) = (vec![0.0; bins], vec![0.0; bins]);
            for (pair, rest) in self.pairs.iter().zip(&rest) {
                lit.fill(0.0);
                self.render(pair, at, &mut lit);
                let error = (PROFILE_ERROR * lit.iter().fold(0.0, |most: f64, v| most.max(*v))).powi(2);
                for (((weight, sure), lit), rest) in weights.iter_mut().zip(&pair.weights).zip(&lit).zip(rest)
                {
                    let grown = if *lit > 0.0 { 1.0 + error * sure } else { 1.0 };
                    *weight = sure / grown;
                    node.excused += (sure - *weight) * rest * rest;
                    node.misfit += grown.ln();
                }
                pair.leveled(&mut lit);
                for ((weight, rest), lit) in weights.iter().zip(rest).zip(&lit) {
                    node.squares += weight * lit * lit;
                    node.product += weight * lit * rest;
                }
            }
            node.misfit -= node.excused;
            node
        };
        ((0..counts.element_product()).into_par_iter().map(node).collect(), squares, used)
    }

    /// Mean and covariance over all places.
    fn position(&self, nodes: &[Node], excess: f64, size: DVec3) -> Position {
        let sure = CALIBRATED_LIGHT.powi(-2);
        let log = |node: &Node| node.light()[1] / excess - 0.5 * (node.squares / excess + sure).ln();
        let most = nodes.iter().map(log).fold(f64::NEG_INFINITY, f64::max);
        let middle = self.middle();
        let (mut sum, mut mean, mut moment) = (0.0, DVec3::ZERO, DMat3::ZERO);
        let (mut far, mut light) = ([0.0; 2], [0.0; 2]);
        for node in nodes {
            let weight = (log(node) - most).exp();
            if weight < (-NEGLIGIBLE).exp() {
                continue;
            }
            let (distance, of_node) = (node.at.distance(middle), node.light()[0]);
            sum += weight;
            mean += weight * node.at;
            moment += weight * square(node.at);
            far = [far[0] + weight * distance, far[1] + weight * distance * distance];
            light = [light[0] + weight * of_node, light[1] + weight * of_node * of_node];
        }
        let deviation = |[a, b]: [f64; 2]| (b / sum - (a / sum).powi(2)).max(0.0).sqrt();
        let at = mean / sum;
        // A position between two places.
        let pitch = size.max_element() / STEPS;
        let covariance = moment * (1.0 / sum) - square(at) + DMat3::IDENTITY * (pitch * pitch / 12.0);
        Position {
            at,
            covariance,
            counted: covariance,
            distance: [far[0] / sum, deviation(far).max(pitch / 12f64.sqrt())],
            light: [light[0] / sum, deviation(light) / (light[0] / sum)],
            extent: [0.0, 0.0],
            share: 1.0,
            unmeasured: None,
        }
    }

    /// The middle of all wall points.
    fn middle(&self) -> DVec3 {
        let all = self.pairs.iter().flat_map(|pair| pair.points);
        all.sum::<DVec3>() / (2 * self.pairs.len()).max(1) as f64
    }
}
