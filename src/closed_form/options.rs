//! Options that all closed-form methods have.

use serde::{Deserialize, Serialize};

use crate::options::{options, words};
use crate::transport::Reflectance;

/// What the points between measured ones hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Between {
    /// Nothing.
    Zero,
    /// Counts interpolated by a cubic along x and y (Keys 1981), bin by bin.
    Bicubic,
}

words!(Between);

options! {
    /// Options of every closed-form method.
    pub struct ImageOptions: ImageSettings(scene) {
        nested {}
        "Solver" {
            /// How surfaces reflect
            reflectance: Reflectance = scene.reflectance, Range::Internal;
        }
        "Domain" {
            /// Nothing nearer than this is reconstructed, metres
            min_depth: f64 = scene.near(), Range::Length;
        }
        "Upsampling" {
            /// Make the scan N times finer along x and y, with points between the measured ones; closed-form
            /// methods, regular scans of a flat wall
            upsample: usize = 1, Range::Count(1, 16);
            /// What points between the measured ones hold: nothing (zero), or counts interpolated by a cubic (bicubic)
            upsample_by: Between = Between::Bicubic, Range::Words(&["zero", "bicubic"]);
        }
        "Background" {
            /// Subtract the background, estimated from the bins after the signal
            background: bool = true, Range::Flag;
        }
    }
}
