//! Compiles the kernels of a solve and tells what the driver says of each: registers, shared memory, spills,
//! instructions, occupancy. Nothing runs and no buffer is made, so a driver without a device is enough.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use thirdbounce::Result;
use thirdbounce::capture::Capture;
use thirdbounce::engine::Accumulation;
use thirdbounce::export::report;
use thirdbounce::files::atomic;
use thirdbounce::gpu::{Gpu, GpuOptions, Kernel};
use thirdbounce::job::{Request, places, plain, planned};
use thirdbounce::learned::schedule::LEARNED_KERNELS;
use thirdbounce::methods::SolverOptions;
use thirdbounce_simulate::{RenderOptions, Scene, simulate};

/// The compiled kernels of a solve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompileProfile {
    /// Version of this program.
    pub version: String,
    /// The device.
    pub device: report::Device,
    /// Whether the driver tells of its kernels (VK_KHR_pipeline_executable_properties).
    pub tells: bool,
    /// Solver of the plan.
    pub solver: String,
    /// Pairs of the plan.
    pub pairs: usize,
    /// Voxels of its finest grid along each axis.
    pub voxels: [usize; 3],
    /// How rendered values are added up.
    pub accumulation: Accumulation,
    /// All kernels, in the order of the plan, then those of the learned start.
    pub kernels: Vec<CompiledKernel>,
    /// Messages of the validation layer, if it was on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub validation: Vec<String>,
}

/// A kernel as the driver compiled it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CompiledKernel {
    /// Its name in schedules, labels and traces.
    pub kernel: String,
    /// Its module.
    pub code: String,
    /// Specialization constants.
    pub constants: BTreeMap<String, u32>,
    /// Seconds that the driver took. It may compile at the first dispatch, or have the kernel in a cache.
    pub seconds: f64,
    /// The programs that the driver made.
    pub executables: Vec<CompiledExecutable>,
}

/// A program that the driver made of a kernel.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CompiledExecutable {
    /// Its name in the driver's words.
    pub name: String,
    /// Invocations of a subgroup; 0 if the driver does not say.
    pub subgroup: u32,
    /// Registers, shared memory and so on, with the driver's names.
    pub statistics: BTreeMap<String, f64>,
}

/// The device in the form of reports.
pub fn device_of(gpu: &Gpu) -> report::Device {
    let (name, driver) = (gpu.info.name.clone(), gpu.info.driver.clone());
    report::Device { name, driver, kind: plain(&gpu.info.kind) }
}

/// A capture of the paper's size, for a plan without a capture of one's own: 32 x 32 points of a 1 m wall, bins of 6 mm.
///
/// # Errors
/// Those of [`simulate`].
pub fn usual_capture() -> Result<Capture> {
    let scene = Scene { scan: 32, bin_width: 0.006, ..Scene::named("figure")? };
    // A plan needs no counts.
    Ok(simulate(&scene, &RenderOptions { noise: 0.5, ..RenderOptions::default() })?.capture)
}

/// Compiles the kernels of the solve that `request` asks for. `listings`: a folder for the driver's listings of each.
///
/// # Errors
/// Options out of range, no device, a capture that the solver cannot take, a kernel that the driver refuses, or a folder
/// that cannot be written.
pub fn compile(request: &Request, capture: &Capture, listings: Option<&Path>) -> Result<CompileProfile> {
    request.settings.check()?;
    if let Some(folder) = listings {
        places::check_folder(folder)?;
        atomic::create_dir(folder)?;
    }
    let gpu =
        Gpu::open(&GpuOptions { statistics: true, listings: listings.is_some(), ..request.gpu_options() })?;
    let job = planned::to_plan(&request.job(capture))?;
    let solver = &job.solver;
    let plan = solver.plan(&job.problem()?, &gpu.abilities())?;
    let mut kernels = vec![];
    let passes = plan.passes.iter().map(|pass| (pass.kernel, (pass.code)(&plan), pass.values(&plan)));
    let is_surface = matches!(solver, SolverOptions::Surface(_));
    let learned =
        LEARNED_KERNELS.iter().filter(|_| is_surface).map(|(k, code, values)| (*k, *code, values.to_vec()));
    for (kernel, code, values) in passes.chain(learned) {
        let compiled = gpu.compile(kernel, code, &values)?;
        if let Some(folder) = listings {
            write_listings(folder, kernel, &compiled.executables)?;
        }
        let constants: Vec<_> = values.iter().map(|(name, value)| (name.to_string(), *value)).collect();
        kernels.push(CompiledKernel {
            kernel: kernel.to_string(),
            code: code.name.into(),
            constants: constants.into_iter().collect(),
            seconds: compiled.seconds,
            executables: compiled.executables.into_iter().map(reported).collect(),
        });
    }
    Ok(CompileProfile {
        version: env!("CARGO_PKG_VERSION").into(),
        device: device_of(&gpu),
        tells: gpu.reports_kernels(),
        solver: solver.name().into(),
        pairs: plan.scene.pairs,
        voxels: plan.finest().grid.n,
        accumulation: plan.division.accumulation,
        kernels,
        validation: gpu.close(),
    })
}

fn reported(e: thirdbounce::gpu::Executable) -> CompiledExecutable {
    CompiledExecutable { name: e.name, subgroup: e.subgroup, statistics: e.statistics.into_iter().collect() }
}

/// Writes the listings of a kernel, each to a file of its own.
fn write_listings(folder: &Path, kernel: Kernel, executables: &[thirdbounce::gpu::Executable]) -> Result<()> {
    let plain = |text: &str| text.to_lowercase().replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    for (i, executable) in executables.iter().enumerate() {
        for (name, text) in &executable.listings {
            let file = folder.join(format!("{kernel}.{i}.{}.txt", plain(name)));
            atomic::write(&file, text.as_bytes())?;
        }
    }
    Ok(())
}
