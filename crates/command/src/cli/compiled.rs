//! The table of `thirdbounce profile --compile`.

use crate::profile::compile::{CompileProfile, CompiledExecutable, CompiledKernel};
use thirdbounce::job::plain;

/// What drivers call the figures of a column: any of these words in lower case, in order of preference.
type Column = (&'static str, &'static [&'static str]);

const COLUMNS: &[Column] = &[
    ("registers", &["vgprs", "register count", "max live registers"]),
    ("scalar", &["sgprs"]),
    ("spilled", &["spilled vgprs", "spill count"]),
    ("scratch", &["scratch size", "scratch memory size", "local memory size", "stack size"]),
    ("shared", &["lds size", "shared memory size"]),
    ("instrs", &["instructions", "instruction count"]),
    ("waves", &["subgroups per simd", "occupancy"]),
];

/// All kernels, one line for each program that the driver made.
pub fn table(p: &CompileProfile) -> String {
    let voxels: Vec<_> = p.voxels.iter().map(usize::to_string).collect();
    let mut out = format!(
        "device    {} ({})\nplan      {} solver, {} pairs, {} voxels, accumulation {}\n",
        p.device.name,
        p.device.driver,
        p.solver,
        p.pairs,
        voxels.join(" x "),
        plain(&p.accumulation)
    );
    if !p.tells {
        out += "note      this driver says nothing of its kernels (VK_KHR_pipeline_executable_properties): the table \
                holds only that they compile\n";
    }
    out += &format!("\n{:<24}{:<26}{:>8}", "kernel", "module", "ms");
    COLUMNS.iter().for_each(|(name, _)| out += &format!("{name:>10}"));
    out += &format!("{:>9}\n", "subgroup");
    for k in &p.kernels {
        match &k.executables[..] {
            [] => out += &line(k, &CompiledExecutable::default()),
            all => all.iter().for_each(|e| out += &line(k, e)),
        }
    }
    out + "\nwaves: subgroups that a SIMD unit holds at once.\n"
}

fn line(k: &CompiledKernel, e: &CompiledExecutable) -> String {
    let dash = || "-".to_string();
    let mut out = format!("{:<24}{:<26}{:>8.1}", k.kernel, k.code, 1e3 * k.seconds);
    for (_, names) in COLUMNS {
        let value = figure(e, names).map_or_else(dash, |v| v.to_string());
        out += &format!("{value:>10}");
    }
    let subgroup = if e.subgroup == 0 { dash() } else { e.subgroup.to_string() };
    out + &format!("{subgroup:>9}\n")
}

/// The statistic that has one of these names.
fn figure(e: &CompiledExecutable, names: &[&str]) -> Option<f64> {
    names.iter().find_map(|name| {
        let found = e.statistics.iter().find(|(n, _)| n.to_lowercase() == *name);
        found.map(|(_, v)| *v)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_takes_the_drivers_own_name() {
        let of = |named: &[(&str, f64)]| CompiledExecutable {
            statistics: named.iter().map(|(n, v)| (n.to_string(), *v)).collect(),
            ..CompiledExecutable::default()
        };
        let radv = of(&[("VGPRs", 24.0), ("SGPRs", 32.0), ("Spilled VGPRs", 1.0)]);
        assert_eq!([COLUMNS[0].1, COLUMNS[2].1].map(|n| figure(&radv, n)), [Some(24.0), Some(1.0)]);
        let nvidia = of(&[("Register Count", 40.0)]);
        assert_eq!([COLUMNS[0].1, COLUMNS[1].1].map(|n| figure(&nvidia, n)), [Some(40.0), None]);
    }
}
