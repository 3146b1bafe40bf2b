//! The kernel variants of a plan, with their specialization constants.

use super::Plan;
use crate::Result;
use crate::gpu::{Executor, KernelCode};
use crate::solve::{Accumulation, NoiseTerm};
use crate::transport::kernels::*;
use crate::transport::{Binning, Geometry, Gradient};

impl Plan {
    /// Names of the variants that run, for reports.
    pub fn variants(&self) -> Vec<String> {
        let name = |k: &KernelUse| {
            let constants: Vec<_> = k.constants.iter().map(|(n, v)| format!("{n}={v}")).collect();
            format!("{}: {} {}", k.name, k.code, constants.join(" ")).trim_end().to_string()
        };
        self.kernels().iter().map(name).collect()
    }

    fn kernels(&self) -> Vec<KernelUse> {
        let t = self.tuning;
        let continuous = u32::from(self.continuous);
        let split = u32::from(self.binning == Binning::Linear);
        let exact = u32::from(self.gradient == Gradient::Exact);
        let noise = match self.noise {
            NoiseTerm::Off => 0,
            NoiseTerm::Bin => 1,
            NoiseTerm::Histogram => 2,
        };
        let product = self.geometry == Geometry::Product;
        let [of_pairs, of_product] = match self.accumulation {
            Accumulation::Float => ["forward_float", "forward_product_float"],
            Accumulation::Fixed => ["forward_fixed64", "forward_product_fixed64"],
            Accumulation::Fixed32 => ["forward_fixed32", "forward_product_fixed32"],
            Accumulation::Cas => ["forward_cas", "forward_product_cas"],
            Accumulation::Owned | Accumulation::Auto => ["forward_owned", "forward_product_owned"],
        };
        let forward = if product { of_product } else { of_pairs };
        let owned = u32::from(self.accumulation == Accumulation::Owned);
        let sets = self.forward_sets(self.finest());
        // What the scene is, for every kernel that asks.
        let scene = [
            ("GEOMETRY", self.geometry as u32),
            ("REFLECTANCE", self.reflectance.number()),
            ("CURVED", u32::from(self.curved)),
            ("FINE", u32::from(self.fine)),
            ("TOUCHING", u32::from(self.touching)),
        ];
        let u = |name, variant, constants: &[(&'static str, u32)]| {
            let asks = |c: &&(&str, u32)| code(variant).constants.iter().any(|known| known.name == c.0);
            let all = constants.iter().chain(scene.iter().filter(asks)).copied();
            KernelUse { name, code: variant, constants: all.collect() }
        };
        let [residual, pulse] =
            if self.fixed_point() { ["residual_fixed", "pulse_fixed"] } else { ["residual", "pulse"] };
        let has_pulse = u32::from(self.pulse > 0);
        let vectors = u32::from(self.vectors);
        let mut tile_constants =
            vec![("LANES", t.lanes), ("CHUNK", t.chunk), ("SPLIT", split), ("WINDOW", t.window)];
        tile_constants.push(("RUNS", u32::from(self.runs)));
        if product {
            tile_constants.push(("OTHERS", t.others_forward));
            tile_constants.push(("SHARED", u32::from(t.share_arms)));
        }
        let others = ("OTHERS", t.others_backward);
        let gather_constants =
            [("VOXELS", t.voxels), ("SLICES", t.slices), ("SPLIT", split), ("EXACT", exact), others];
        let summed = if self.vectors { t.voxels } else { WORKGROUP };
        let mut all = vec![
            u("forward", forward, &tile_constants),
            u("residual", residual, &[("NOISE", noise), ("WEIGHTED", vectors), ("PULSE", has_pulse)]),
            u("finish", "finish", &[("ACCELERATED", vectors), ("VOXELS", summed)]),
            u("gaussian_y", "gaussian", &[("AXIS", 1), ("FIRST", 0), ("LAST", 0)]),
            u("gaussian_z", "gaussian", &[("AXIS", 2), ("FIRST", 0), ("LAST", 1)]),
            u("threshold", "threshold", &[]),
            u("compact_count", "compact_count", &[]),
            u("compact_scan_active", "compact_scan", &[("RIM", 0)]),
            u("compact_scatter_active", "compact_scatter", &[("RIM", 0)]),
            u("levels", "levels", &[]),
            u("room", "room", &[]),
            u(
                "arguments",
                "arguments",
                &[
                    ("OWNED", owned),
                    ("LANES", t.lanes),
                    ("CHUNK", t.chunk),
                    ("VOXELS", t.voxels),
                    ("FORWARD_SETS", sets),
                    ("OTHERS", if product { t.others_forward } else { 0 }),
                ],
            ),
            u("double_domain", "double_domain", &[]),
            u("extract", "extract", &[("VECTORS", vectors)]),
        ];
        if self.pulse > 0 {
            all.push(u("pulse", pulse, &[]));
            if self.vectors {
                all.push(u("pulse_noise", "pulse", &[("BACK", 1), ("SQUARED", 1)]));
            }
        }
        if self.pulse > 0 || self.blurred {
            all.push(u("pulse_back", "pulse", &[("BACK", 1)]));
        }
        if self.vectors {
            let bound = [&tile_constants[..], &[("BOUND", 1)]].concat();
            all.extend([
                u("gaussian_x_volume", "gaussian", &[("AXIS", 0), ("FIRST", 0), ("LAST", 0)]),
                u("gaussian_x", "gaussian", &[("AXIS", 0), ("FIRST", 2), ("LAST", 0)]),
                u("forward_bound", forward, &bound),
                u("residual_bound", residual, &[("WEIGHTED", 1), ("MEASURE", 0), ("PULSE", has_pulse)]),
                u("bound_step", "bound", &[("SPLIT", split), ("WHAT", 0), others]),
                u("bound_noise", "bound", &[("SPLIT", split), ("WHAT", 1), others]),
                u("variance", "variance", &[]),
                u("filter", "filter", &[]),
                u("backproject", "backproject", &[others]),
                u("settle", "settle", &[("DOUBLED", 0)]),
                u("settle_doubled", "settle", &[("DOUBLED", 1)]),
                u("points", "points", &[]),
                u("expect", "expect", &[("DOUBLED", 0)]),
                u("expect_doubled", "expect", &[("DOUBLED", 1)]),
                u("extrapolate", "extrapolate", &[]),
                u("step", "step", &gather_constants),
            ]);
            if self.surface_iterations > 0 {
                let points = [("VOXELS", t.voxels), ("SLICES", t.slices), others];
                let each = ("POINTS", self.points as u32);
                all.extend([
                    u("surface_bonds", "surface_bonds", &[]),
                    u("surface_points", "surface_points", &[each]),
                    u("surface_gather", "surface_gather", &points),
                    u("surface_combine", "surface_combine", &[each]),
                    u("surface_pull", "surface_pull", &[]),
                    u("surface_step", "surface_step", &[]),
                    u(
                        "surface_finish",
                        "finish",
                        &[("ACCELERATED", 0), ("VOXELS", self.points as u32 * WORKGROUP)],
                    ),
                    u("surface_extract", "surface_extract", &[]),
                ]);
            }
            return all;
        }
        all.extend([
            u("initialise", "initialise", &[]),
            u("initialise_raw", "initialise_raw", &[("ALBEDO_SPAN", self.initial_albedo.to_bits())]),
            u("sample", "sample", &[("CONTINUOUS", continuous)]),
            u("backward", "backward", &gather_constants),
            u("update", "update", &[("CONTINUOUS", continuous)]),
            u("carry", "carry", &[("CONTINUOUS", continuous), ("DOUBLED", 0)]),
            u("carry_doubled", "carry", &[("CONTINUOUS", continuous), ("DOUBLED", 1)]),
            u("gaussian_x", "gaussian", &[("AXIS", 0), ("FIRST", 1), ("LAST", 0)]),
        ]);
        if self.continuous {
            all.extend([
                u("rim", "rim", &[]),
                u("compact_scan_rim", "compact_scan", &[("RIM", 1)]),
                u("compact_scatter_rim", "compact_scatter", &[("RIM", 1)]),
            ]);
        }
        if self.noise != NoiseTerm::Off {
            all.push(u(
                "noise",
                "noise",
                &[("PER_HISTOGRAM", u32::from(self.noise == NoiseTerm::Histogram))],
            ));
        }
        all
    }

    /// Makes the plan's kernels.
    pub fn add_kernels(&self, executor: &mut Executor<'_>) -> Result<()> {
        for k in self.kernels() {
            executor.add_kernel(k.name, code(k.code), &k.constants)?;
        }
        Ok(())
    }
}

struct KernelUse {
    name: &'static str,
    code: &'static str,
    constants: Vec<(&'static str, u32)>,
}

fn code(name: &str) -> &'static KernelCode {
    KERNELS.iter().find(|k| k.name == name).unwrap_or_else(|| panic!("no kernel variant {name} in the table"))
}
