// src/lib.rs

#[cfg(feature = "formats")]
pub mod job {
    mod advice {
        pub fn suggestions(
            request: &Request,
            loaded: &Loaded,
            gpu: &Gpu,
        ) -> Vec<(Setting, String)> {}
    }
    pub mod batch {
        mod figures {
            #[derive(Debug, Clone, PartialEq, Serialize)]
            pub struct Figures {
                pub solver: String,
                pub model: String,
                pub iterations: usize,
                pub residual: Option<f64>,
                pub surface: f64,
                pub depth: Option<f32>,
                pub confidence: Option<f32>,
                pub solve_s: f64,
                pub iou: Option<f64>,
                pub depth_mae: Option<f64>,
                pub normal_error_deg: Option<f64>,
            }
        }
        mod names {
            #[derive(Debug, Clone, PartialEq, Eq)]
            pub struct Listed {
                pub path: PathBuf,
                pub name: String,
            }
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub struct Shard {
                pub part: u64,
                pub of: u64,
            }
            impl Default for Shard {}
            impl std::str::FromStr for Shard {
                type Err = Error;
            }
            impl Shard {
                pub fn holds(self, name: &str) -> bool {}
            }
            pub fn named(paths: &[PathBuf]) -> Vec<Listed> {}
        }
        pub use figures::Figures;
        pub use names::{Listed, Shard, named};
        #[derive(Debug, Clone)]
        pub struct Batch {
            pub captures: Vec<Listed>,
            pub shard: Shard,
            pub out: PathBuf,
            pub options: Vec<String>,
            pub devices: Vec<GpuOptions>,
            pub jobs: usize,
        }
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
        pub enum Status {
            Done,
            Skipped,
            Failed,
        }
        #[derive(Debug, Clone)]
        pub struct Told {
            pub capture: Listed,
            pub status: Status,
            pub seconds: f64,
            pub error: Option<Error>,
            pub folder: Option<PathBuf>,
            pub figures: Option<Figures>,
            pub notes: Vec<String>,
        }
        #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
        pub struct Tally {
            pub captures: usize,
            pub done: usize,
            pub skipped: usize,
            pub failed: usize,
            pub stopped: bool,
            pub seconds: f64,
        }
        pub trait Caller: Sync {
            fn load(&self, capture: &Listed) -> Result<(Loaded, Request)>;
            fn go_on(&self, progress: Option<(&Listed, &Progress)>) -> ControlFlow<()>;
        }
        pub fn batch(
            what: &Batch,
            caller: &dyn Caller,
            tell: &mut dyn FnMut(&Told),
        ) -> Result<Tally> {}
    }
    pub mod benchmark {
        mod captures {
            pub enum Ready {
                Files { capture: PathBuf, truth: PathBuf },
                None(String),
            }
            pub fn found_in(folder: &Path) -> Result<Found> {}
        }
        pub use captures::found_in;
        #[derive(Debug, Clone, PartialEq)]
        pub struct Benchmark {
            pub scenes: Vec<Scene>,
            pub photons: Vec<f64>,
            pub seed: u64,
            pub out: PathBuf,
            pub options: Vec<String>,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Scene {
            pub name: String,
            pub source: Source,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub enum Source {
            Capture { file: PathBuf, truth: PathBuf },
            Simulation { file: PathBuf, what: Box<Simulation> },
        }
        pub trait Caller {
            fn comparison(
                &mut self,
                capture: &Path,
                truth: &Path,
            ) -> Result<(Loaded, Comparison)>;
            fn hear(
                &mut self,
                case: &str,
                progress: Option<(&Turn<'_>, &Progress)>,
            ) -> ControlFlow<()>;
            fn tell(&mut self, case: &Case);
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Benched {
            pub page: Page,
            pub stopped: bool,
            pub files: Vec<PathBuf>,
        }
        pub fn benchmark(what: &Benchmark, caller: &mut dyn Caller) -> Result<Benched> {}
    }
    pub mod compare {
        #[derive(Debug, Clone, PartialEq)]
        pub struct Method {
            pub name: String,
            pub spec: String,
            pub request: Request,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Foreign {
            pub name: String,
            pub result: ForeignResult,
            pub seconds: f64,
            pub hardware: String,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub enum ForeignResult {
            Maps(PathBuf),
            Figures(PaperMeasure),
        }
        #[derive(Debug, Clone, Default, PartialEq)]
        pub struct Comparison {
            pub methods: Vec<Method>,
            pub foreign: Vec<Foreign>,
            pub left_out: Vec<LeftOut>,
            pub oracle: bool,
            pub repeats: usize,
            pub out: PathBuf,
        }
        #[derive(Debug, Clone, Copy)]
        pub struct Turn<'n> {
            pub number: usize,
            pub turns: usize,
            pub name: &'n str,
        }
        #[derive(Debug, Clone)]
        pub struct Compared {
            pub report: comparison::Comparison,
            pub validation: Vec<String>,
            pub files: Vec<PathBuf>,
        }
        pub fn compare(
            what: &Comparison,
            loaded: &Loaded,
            hear: &mut dyn FnMut(&Turn<'_>, &Progress) -> ControlFlow<()>,
        ) -> Result<Compared> {}
        impl Comparison {
            pub fn check_repeats(repeats: usize) -> Result<()> {}
        }
    }
    pub mod demo {
        #[derive(Debug, Clone)]
        pub struct Demo {
            pub outcome: Outcome,
            pub simulate_seconds: f64,
            pub seconds: f64,
            pub overview: PathBuf,
        }
        pub fn demo(
            out: &Path,
            device: Option<String>,
            say: &mut dyn FnMut(&str),
            hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
        ) -> Result<Demo> {}
    }
    mod evaluate {
        #[derive(Debug, Clone, PartialEq)]
        pub struct Evaluation {
            pub metrics: Metrics,
            pub solve_s: Option<f64>,
            pub picture: Option<PathBuf>,
        }
        pub fn evaluate(
            folder: &Path,
            truth: &Path,
            mask_fraction: Option<f64>,
            pictures: bool,
        ) -> Result<Evaluation> {}
    }
    mod histogram {
        #[derive(Debug, Clone, PartialEq)]
        pub struct Histogramming {
            pub tags: PathBuf,
            pub scan: Scan,
            pub asked: Asked,
            pub out: PathBuf,
            pub picture: Option<PathBuf>,
        }
        pub fn histogram(
            what: &Histogramming,
            before_writing: &mut dyn FnMut(),
        ) -> Result<(Histograms, f64)> {}
    }
    pub mod inspect {
        #[derive(Debug, Clone, Serialize)]
        pub struct Inspection {
            pub capture: Summary,
            pub notes: Vec<String>,
            pub doubts: Vec<String>,
            pub preset: Option<Preset>,
            pub options: SolverOptions,
            pub grid: [usize; 3],
            pub voxel: [f64; 3],
            pub volume: Vec<f64>,
            pub device: Option<DeviceInfo>,
            pub plan: Option<Planned>,
            pub problems: Vec<Advice>,
        }
        #[derive(Debug, Clone, Serialize)]
        pub struct Planned {
            pub levels: Vec<usize>,
            pub level_pairs: Vec<usize>,
            pub parts: [Vec<usize>; 2],
            pub stored_bytes: u64,
            pub surface: Option<usize>,
            pub accumulation: Accumulation,
            pub left_out: Vec<String>,
            pub variants: Vec<String>,
            pub buffers: BTreeMap<String, u64>,
            pub total_bytes: u64,
        }
        pub fn inspect(request: &Request, loaded: &Loaded) -> Result<Inspection> {}
        pub fn schedule(request: &Request, loaded: &Loaded) -> Result<Vec<Part>> {}
    }
    mod overview {
        pub fn write(path: &Path, maps: &Maps, truth: &Truth) -> Result<()> {}
    }
    mod places {
        pub const PREVIEW: &str = "preview.png";
        pub fn check_inputs<'p>(
            inputs: impl IntoIterator<Item = &'p Path>,
            folder: &Path,
        ) -> Result<()> {}
        pub fn check_not_input<'p>(
            file: &Path,
            inputs: impl IntoIterator<Item = &'p Path>,
        ) -> Result<()> {}
        pub fn check_file(file: &Path) -> Result<()> {}
    }
    pub mod profile {
        pub mod check {
            mod buffers {
                pub fn read<T: bytemuck::Pod>(
                    job: &mut OnDevice,
                    from: Buffer,
                    count: usize,
                ) -> Result<Vec<T>> {}
            }
            #[private_fields]
            pub struct Check {
                pub solver: &'static str,
                pub holds: &'static [&'static Pass],
                pub with_instrument: bool,
            }
            pub static CHECKS: &[Check] = &[
                Check {
                    solver: "paper",
                    holds: &[
                        &paper_solver::passes::SAMPLE,
                        &passes::FORWARD,
                        &passes::RESIDUAL,
                        &paper_solver::passes::BACKWARD,
                        &paper_solver::passes::UPDATE,
                    ],
                    with_instrument: false,
                    run: paper::check,
                },
                Check {
                    solver: "vector",
                    holds: &[
                        &vector_solver::passes::EXTRAPOLATE,
                        &passes::FORWARD,
                        &passes::SPOT,
                        &passes::PULSE,
                        &passes::RESIDUAL,
                        &passes::PULSE_BACK,
                        &passes::SPOT_BACK,
                        &vector_solver::passes::STEP,
                    ],
                    with_instrument: true,
                    run: vector::check,
                },
                Check {
                    solver: "surface",
                    holds: &[
                        &surface_stage::passes::SURFACE_BONDS,
                        &surface_stage::passes::SURFACE_POINTS,
                        &passes::FORWARD,
                        &passes::SPOT,
                        &passes::PULSE,
                        &passes::RESIDUAL,
                        &passes::PULSE_BACK,
                        &passes::SPOT_BACK,
                        &surface_stage::passes::SURFACE_GATHER,
                    ],
                    with_instrument: true,
                    run: surface::check,
                },
            ];
            #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
            pub struct Checked {
                pub solver: String,
                pub accumulation: String,
                pub pass: String,
                pub error: f64,
                pub allowed: f64,
            }
            impl Checked {
                pub fn passed(&self) -> bool {}
            }
            pub fn check(gpu: &Gpu) -> Result<Vec<Checked>> {}
            pub fn worst(all: &[Checked]) -> BTreeMap<(String, String), f64> {}
        }
        pub mod compile {
            #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
            pub struct CompileProfile {
                pub version: String,
                pub device: report::Device,
                pub tells: bool,
                pub solver: String,
                pub pairs: usize,
                pub voxels: [usize; 3],
                pub accumulation: Accumulation,
                pub kernels: Vec<CompiledKernel>,
                pub validation: Vec<String>,
            }
            #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
            pub struct CompiledKernel {
                pub kernel: String,
                pub code: String,
                pub constants: BTreeMap<String, u32>,
                pub seconds: f64,
                pub slots: Option<f64>,
                pub counts: Option<Counts>,
                pub shared: Option<(Counts, u32)>,
                pub executables: Vec<Executable>,
            }
            #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
            pub struct Executable {
                pub name: String,
                pub subgroup: u32,
                pub statistics: BTreeMap<String, f64>,
            }
            pub fn usual_capture() -> Result<Capture> {}
            pub fn compile(
                request: &Request,
                capture: &Capture,
                listings: Option<&Path>,
            ) -> Result<CompileProfile> {}
        }
        mod kernels {
            #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
            pub struct KernelProfile {
                pub name: String,
                pub kernel: String,
                pub code: String,
                pub calls: u64,
                pub seconds: f64,
                pub share: f64,
                pub pairs: f64,
                pub pairs_per_s: Option<f64>,
                pub share_of_limit: Option<f64>,
                pub floor: Option<Floor>,
                pub counts: Option<Counts>,
                pub shared: Option<(Counts, u32)>,
                pub statistics: BTreeMap<String, f64>,
            }
            #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
            pub struct Floor {
                pub issue: f64,
                pub special: f64,
                pub load: f64,
                pub atomic: f64,
            }
            impl Floor {
                pub fn new(c: &Counts, l: &DeviceLimits, float_atomics: bool) -> Floor {}
                pub fn seconds(&self) -> f64 {}
                pub fn bound(&self) -> &'static str {}
            }
            #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
            pub struct Gaps {
                pub within_s: f64,
                pub largest_within_s: f64,
                pub between_s: f64,
                pub largest_between_s: f64,
            }
            #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
            pub struct IterationProfile {
                pub count: usize,
                pub seconds: f64,
                pub pass_s: f64,
                pub overhead_s: f64,
            }
        }
        pub mod limits {
            #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
            pub struct DeviceLimits {
                pub fma_per_s: f64,
                pub special_per_s: f64,
                pub load_per_s: f64,
                pub shared_atomic_per_s: f64,
                pub global_atomic_per_s: f64,
                pub global_atomic_float_per_s: Option<f64>,
                pub scattered_atomic_per_s: f64,
                pub copy_bytes_per_s: f64,
                pub dispatch_s: f64,
            }
            pub fn measure(gpu: &Gpu) -> Result<DeviceLimits> {}
        }
        pub mod tune {
            #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
            pub struct Tried {
                pub sizes: Sizes,
                pub forward_s: f64,
                pub backward_s: f64,
            }
            #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
            pub struct Tuned {
                pub class: String,
                pub tried: Vec<Tried>,
                pub best: Sizes,
                pub ratio: f64,
                pub file: Option<PathBuf>,
            }
            pub fn tune(
                request: &Request,
                loaded: &Loaded,
                say: &mut dyn FnMut(&str),
            ) -> Result<Tuned> {}
        }
        pub use kernels::{Floor, Gaps, IterationProfile, KernelProfile};
        pub use limits::DeviceLimits;
        #[derive(Debug, Clone, PartialEq)]
        pub struct ProfileRequest {
            pub request: Request,
            pub json: Option<PathBuf>,
            pub trace: Option<PathBuf>,
            pub out: Option<PathBuf>,
        }
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        pub struct Profile {
            pub version: String,
            pub device: report::Device,
            pub settings: serde_json::Value,
            pub limits: DeviceLimits,
            pub kernels: Vec<KernelProfile>,
            pub iterations: IterationProfile,
            pub gaps: Gaps,
            pub host: BTreeMap<String, HostTime>,
            pub totals: Totals,
            pub validation: Vec<String>,
        }
        #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
        pub struct HostTime {
            pub calls: u64,
            pub seconds: f64,
        }
        #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
        pub struct Totals {
            pub load_s: f64,
            pub prepare_s: f64,
            pub solve_s: f64,
            pub device_s: f64,
            pub export_s: f64,
            pub pairs: f64,
            pub pairs_per_s: f64,
            pub peak_device_bytes: u64,
        }
        pub fn profile(
            what: &ProfileRequest,
            loaded: &Loaded,
            say: &mut dyn FnMut(&str),
            hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
        ) -> Result<Profile> {}
        pub fn device_of(gpu: &Gpu) -> report::Device {}
    }
    mod reconstruct {
        pub fn solve(
            request: &Request,
            loaded: &Loaded,
            gpus: &[Gpu],
            truth: Option<&Truth>,
            preview: Option<&Preview>,
            hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
        ) -> Result<Finished> {}
    }
    mod request {
        #[derive(Debug, Clone, PartialEq)]
        pub struct Request {
            pub preset: Option<Preset>,
            pub solver: SolverOptions,
            pub bins: Bins,
            pub depth_pitch: Option<f64>,
            pub volume: Option<Volume>,
            pub memory: Option<u64>,
            pub device: Option<String>,
            pub pipeline_cache: Option<PathBuf>,
            pub validation: bool,
            pub timings: bool,
            pub tuned: bool,
            pub models: Vec<SolverOptions>,
            pub find_pulse: FindPulse,
            pub preview: bool,
            pub faults: Faults,
            pub truth: Option<PathBuf>,
            pub mask_fraction: Option<f64>,
            pub trace_every: Option<usize>,
            pub snapshots: Vec<usize>,
            pub checkpoint: Option<PathBuf>,
            pub checkpoint_every: usize,
            pub resume: Option<PathBuf>,
            pub out: PathBuf,
            pub volume_file: Option<PathBuf>,
        }
        impl Request {
            pub const CHECKPOINT_EVERY: usize = 50;
            pub fn new(
                solver: impl Into<SolverOptions>,
                out: impl Into<PathBuf>,
            ) -> Request {}
            pub fn discretisation(&self) -> Discretisation {}
            pub fn grid(&self, capture: &Capture) -> Result<Grid> {}
            pub fn check_mask_fraction(fraction: Option<f64>) -> Result<()> {}
        }
        impl Resolved {
            pub fn request(self) -> Request {}
        }
        pub fn memory_bytes(text: &str) -> Result<u64> {}
    }
    mod run {
        #[derive(Debug, Clone)]
        pub struct Outcome {
            pub report: Report,
            pub maps: Maps,
            pub truth: Option<Truth>,
            pub kernels: Vec<(&'static str, KernelTime)>,
            pub validation: Vec<String>,
            pub notes: Vec<String>,
            pub files: Vec<PathBuf>,
        }
        #[private_fields]
        pub struct Solved {
            pub outcome: Outcome,
        }
        pub fn run(
            request: &Request,
            loaded: &Loaded,
            hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
        ) -> Result<Outcome> {}
        pub fn solve(
            request: &Request,
            loaded: &Loaded,
            gpu: &Gpu,
            hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
        ) -> Result<Solved> {}
        impl Solved {
            pub fn write(self, request: &Request) -> Result<Outcome> {}
        }
    }
    mod simulated {
        #[derive(Debug, Clone, PartialEq)]
        pub struct Simulation {
            pub scene: Scene,
            pub hide_pulse: bool,
            pub render: RenderOptions,
            pub out: PathBuf,
            pub truth: Option<(PathBuf, usize)>,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Simulated {
            pub summary: Summary,
            pub noise: f64,
            pub converged: bool,
            pub samples: usize,
            pub seconds: f64,
            pub files: Vec<PathBuf>,
            pub notes: Vec<String>,
        }
        pub fn simulate(
            what: &Simulation,
            before_writing: &mut dyn FnMut(),
        ) -> Result<Simulated> {}
    }
    mod sizes {
        pub fn usual_pipeline_cache() -> Option<PathBuf> {}
    }
    pub mod state_file {
        #[derive(Debug, Clone, PartialEq)]
        pub struct Kept {
            pub state: Checkpoint,
            pub along: BTreeMap<usize, Metrics>,
            pub snapshots: Vec<(usize, Maps)>,
            pub found: Found,
        }
        pub fn write(path: &Path, kept: &Kept) -> Result<()> {}
        pub fn read(path: &Path) -> Result<Kept> {}
    }
    mod words {
        pub fn plain(value: &impl serde::Serialize) -> String {}
        pub fn write_json(
            file: &Path,
            value: &impl Serialize,
            indented: bool,
        ) -> Result<()> {}
    }
    pub use crate::solve::{Bins, SolverOptions, check_solver, reflectance};
    pub use crate::trials::{Choice, FindPulse, MODELS, Resolved, preset_for};
    pub use advice::suggestions;
    pub use batch::{Batch, batch};
    pub use benchmark::{Benchmark, benchmark};
    pub use compare::{
        Compared, Comparison, Foreign, ForeignResult, Method, Turn, compare,
    };
    pub use demo::{Demo, demo};
    pub use evaluate::{Evaluation, evaluate};
    pub use histogram::{Histogramming, histogram};
    pub use inspect::{Inspection, inspect, schedule};
    pub use places::{PREVIEW, check_file, check_inputs, check_not_input};
    pub use request::{Request, memory_bytes};
    pub use run::{Outcome, Solved, run, solve};
    pub use simulated::{Simulated, Simulation, simulate};
    pub use sizes::usual_pipeline_cache;
    pub use words::{plain, write_json};
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct Input {
        pub path: PathBuf,
        pub wall: Option<f64>,
        pub bin_width: Option<f64>,
        pub depth_unit: Option<f64>,
        pub bounce: Option<capture::Bounce>,
        pub time_of_flight: Option<PathBuf>,
        pub turn: capture::Turn,
        pub stride: Option<usize>,
        pub subset: Option<usize>,
        pub subset_seed: u64,
        pub gate: Option<Gate>,
        pub no_auto_gate: bool,
        pub pulse: Option<GivenPulse>,
        pub spots: Option<[f64; 2]>,
        pub preset: Option<Preset>,
    }
    impl Input {
        pub fn keep(&self) -> capture::Keep {}
        pub fn given(&self) -> capture::Given {}
    }
    #[derive(Debug, Clone, PartialEq)]
    pub enum GivenPulse {
        Sharp,
        Shape(capture::Pulse),
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct Loaded {
        pub input: Input,
        pub capture: Capture,
        pub gate: Option<Gate>,
        pub dropped: usize,
        pub normals_estimated: bool,
        pub notes: Vec<String>,
        pub seconds: f64,
    }
    impl Loaded {
        pub fn summary(&self) -> Summary {}
    }
    pub fn load(input: &Input) -> Result<Loaded> {}
    pub fn take(capture: Capture, input: &Input) -> Result<Loaded> {}
    pub fn load_tags(
        input: &Input,
        scan: &tags::Scan,
        asked: &tags::Asked,
    ) -> Result<Loaded> {}
}
#[cfg(feature = "formats")]
pub mod live {
    mod listen {
        pub fn token_bytes(token: &str) -> Vec<u8> {}
    }
    mod page {
        #[private_fields]
        pub struct Page {}
        impl Page {
            pub fn serve(port: u16) -> Result<Page> {}
            pub fn address(&self) -> SocketAddr {}
        }
    }
    mod stream {
        pub const MAGIC: [u8; 4] = *b"TBFR";
        pub const VERSION: u16 = 1;
        pub const HEADER: usize = 28;
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Format {
            Float,
            Short,
            Word,
        }
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct Header {
            pub format: Format,
            pub frame: u64,
            pub pairs: u32,
            pub bins: u32,
            pub is_partial: bool,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Counts {
            pub frame: u64,
            pub values: Vec<f32>,
            pub measured: Option<Vec<bool>>,
        }
        pub fn read(
            from: &mut impl Read,
            [pairs,
            bins,
            ]: [usize; 2],
        ) -> Result<Option<Counts>> {}
        pub fn write(
            to: &mut impl Write,
            frame: u64,
            bins: usize,
            values: &[f32],
        ) -> std::io::Result<()> {}
        impl Header {
            pub fn bytes(&self) -> [u8; HEADER] {}
        }
    }
    mod tags {
        #[derive(Debug, Clone, PartialEq)]
        pub struct Tags {
            pub path: PathBuf,
            pub scan: Scan,
            pub asked: Asked,
            pub gate: Option<Gate>,
        }
        impl Tags {
            pub fn first(
                &self,
                wait: &dyn Fn() -> ControlFlow<()>,
            ) -> Result<Option<Capture>> {}
        }
    }
    pub use listen::token_bytes;
    pub use page::Page;
    pub use stream::{Counts, Format, HEADER, Header, MAGIC, VERSION, read, write};
    pub use tags::Tags;
    #[derive(Debug, Clone, PartialEq)]
    pub enum Source {
        Folder(PathBuf),
        Stream(PathBuf),
        Stdin,
        Listen { address: std::net::SocketAddr, token: Option<String> },
        Tags(Box<Tags>),
    }
    pub enum News<'n> {
        Solved(&'n Frame, Latency),
        Wrong(&'n Error),
        Idle,
    }
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Summary {
        pub latency: Latency,
        pub arrived: u64,
        pub wrong: u64,
    }
    pub fn run(
        gpu: &Gpu,
        scan: &Capture,
        solver: &SolverOptions,
        options: SessionOptions,
        source: &Source,
        page: Option<&Page>,
        hear: &mut dyn FnMut(News<'_>) -> ControlFlow<()>,
    ) -> Result<Summary> {}
}
pub mod session {
    mod feed {
        #[derive(Debug, Clone, Copy, Default, PartialEq)]
        pub enum Feed {
            One,
            Newest,
            Every { most: usize },
            Sum { decay: f64 },
        }
        impl std::str::FromStr for Feed {
            type Err = Error;
        }
        impl Kept {
            pub fn new([pairs, bins]: [usize; 2], feed: Feed) -> Kept {}
            pub fn take(&mut self, counts: &[f32], measured: Option<&[bool]>) {}
            pub fn give(&self, frame: &mut Vec<f32>) {}
        }
    }
    mod latency {
        #[derive(Debug, Clone, Copy, Default, PartialEq)]
        pub struct Latency {
            pub frames: u64,
            pub dropped: u64,
            pub last: Duration,
            pub median: Duration,
            pub p90: Duration,
            pub p99: Duration,
            pub frames_per_second: f64,
        }
    }
    mod lent {
        #[derive(Clone)]
        pub struct LentFrame {
            pub counts: LentCounts,
            pub maps: Option<Lent>,
            pub done: Option<Moment>,
        }
        impl Session {
            pub fn lent_maps_bytes(&self) -> u64 {}
        }
    }
    mod submit {
        #[derive(Clone)]
        #[private_fields]
        pub struct Submitter {}
        impl Submitter {
            pub fn latency(&self) -> Latency {}
            pub fn submit(&self, histograms: &[f32]) -> Result<FrameId> {}
            pub fn submit_part(
                &self,
                histograms: &[f32],
                measured: &[bool],
            ) -> Result<FrameId> {}
        }
    }
    pub use feed::Feed;
    pub use latency::Latency;
    pub use lent::LentFrame;
    pub use submit::Submitter;
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub struct FrameId(pub u64);
    #[derive(Debug, Clone)]
    pub struct Frame {
        pub id: FrameId,
        pub result: Reconstruction,
    }
    pub type Hear = Box<dyn FnMut(FrameId, &Progress) -> ControlFlow<()> + Send>;
    #[derive(Default)]
    pub struct SessionOptions {
        pub sum: Option<usize>,
        pub memory: Option<u64>,
        pub mask_fraction: Option<f64>,
        pub with_volume: bool,
        pub time_limit: Option<Duration>,
        pub hear: Option<Hear>,
        pub maps_every: Option<usize>,
        pub feed: Feed,
        pub follow: Option<Follow>,
        pub lent: bool,
    }
    #[private_fields]
    pub struct Session {}
    #[derive(Clone)]
    pub struct Canceller(Arc<Shared>);
    impl Canceller {
        pub fn cancel(&self) {}
    }
    impl Session {
        pub fn new(
            gpu: &Gpu,
            scan: &Capture,
            grid: Option<Grid>,
            solver: &SolverOptions,
            options: SessionOptions,
        ) -> Result<Session> {}
        pub fn gpu(&self) -> &Gpu {}
        pub fn plan(&self) -> &Plan {}
        pub fn submit(&mut self, histograms: &[f32]) -> Result<FrameId> {}
        pub fn submit_part(
            &mut self,
            histograms: &[f32],
            measured: &[bool],
        ) -> Result<FrameId> {}
        pub fn submit_lent(&mut self, frame: LentFrame) -> Result<FrameId> {}
        pub fn is_idle(&self) -> bool {}
        pub fn latency(&self) -> Latency {}
        pub fn poll(&mut self) -> Result<Option<&Frame>> {}
        pub fn wait(&mut self) -> Result<&Frame> {}
        pub fn wait_for(&mut self, limit: Duration) -> Result<Option<&Frame>> {}
        pub fn last(&self) -> Option<&Frame> {}
        pub fn cancel(&self) {}
        pub fn submitter(&self) -> Submitter {}
        pub fn canceller(&self) -> Canceller {}
    }
    impl Drop for Session {}
    pub fn default_grid(scan: &Capture, solver: &SolverOptions) -> Result<Grid> {}
}
pub mod solve {
    mod bins {
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        pub enum Bins {
            Auto,
            Native,
            Sum(usize),
        }
        impl fmt::Display for Bins {}
        impl FromStr for Bins {
            type Err = Error;
        }
        impl Serialize for Bins {}
    }
    mod checkpoint {
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        pub struct Identity {
            pub version: String,
            pub capture: u64,
            pub settings: BTreeMap<String, serde_json::Value>,
            pub plan: Vec<String>,
            pub buffers: BTreeMap<String, u64>,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Checkpoint {
            pub identity: Identity,
            pub iteration: usize,
            pub level: usize,
            pub first: usize,
            pub active: usize,
            pub pending: Vec<[usize; 3]>,
            pub trace: Vec<TracePoint>,
            pub pairs: u64,
            pub seconds: f64,
            pub gpu_seconds: f64,
            pub buffers: BTreeMap<String, Vec<u8>>,
        }
        pub struct Keep<'k> {
            pub every: usize,
            pub save: &'k mut dyn FnMut(Checkpoint) -> Result<()>,
            pub from: Option<Checkpoint>,
        }
    }
    pub mod closed_form {
        mod backproject {
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
            pub enum Filter {
                Laplacian,
                Log,
                Path,
            }
        }
        mod convolution {
            mod descent {
                #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
                pub enum Prior {
                    None,
                    Positive,
                    Sparse,
                    Variation,
                }
            }
        }
        pub mod fourier {
            pub type Complex = rustfft::num_complex::Complex32;
            pub fn turn(angle: f64) -> Complex {}
            pub fn fast_length(n: usize) -> usize {}
            pub struct Line(Arc<dyn Fft<f32>>);
            impl Line {
                pub fn forward(length: usize) -> Line {}
                pub fn backward(length: usize) -> Line {}
                pub fn run(&self, values: &mut [Complex], spare: &mut Vec<Complex>) {}
            }
            #[private_fields]
            pub struct Planes {}
            #[derive(Default)]
            #[private_fields]
            pub struct Spare {}
            impl Planes {
                pub fn forward(n: [usize; 2]) -> Planes {}
                pub fn backward(n: [usize; 2]) -> Planes {}
                pub fn spectrum(
                    &self,
                    plane: &mut [Complex],
                    rows: usize,
                    spare: &mut Spare,
                ) {}
                pub fn plane(
                    &self,
                    spectrum: &mut [Complex],
                    rows: usize,
                    spare: &mut Spare,
                ) {}
            }
            pub fn transpose<T: Copy>(from: &[T], to: &mut [T], [na, nb]: [usize; 2]) {}
            pub fn wave_number(i: usize, n: usize, step: f64) -> f64 {}
        }
        pub mod image {
            #[derive(Debug, Clone, PartialEq)]
            pub struct Volume {
                pub albedo: Vec<f32>,
                pub normal: Option<Vec<[f32; 3]>>,
            }
            pub fn on_grid(scan: &RegularScan, values: &[f32], grid: &Grid) -> Vec<f32> {}
            pub fn on_grid_signed(
                scan: &RegularScan,
                values: &[f32],
                grid: &Grid,
            ) -> Vec<f32> {}
            pub fn share_of_white(threshold: f64, albedo: &[f32]) -> Option<f64> {}
            pub fn level_over_haze(albedo: &[f32], share: f64) -> Option<f64> {}
            pub fn brightest(volume: &[f32], depths: usize) -> Vec<f32> {}
            pub fn fraction_by_roots(albedo: &[f32]) -> Option<f64> {}
            pub fn maps(
                grid: &Grid,
                volume: &Volume,
                step: f64,
                fraction: impl FnOnce(&[f32]) -> Option<f64>,
            ) -> Maps {}
        }
        mod on_host {
            pub fn prepare<M: HostMethod>(
                options: &M,
                gpu: &Gpu,
                capture: &Capture,
                grid: Grid,
                memory: Option<u64>,
                with_volume: bool,
            ) -> Result<Box<dyn Prepared>> {}
        }
        mod scan {
            #[derive(Debug, Clone, PartialEq)]
            #[private_fields]
            pub struct RegularScan {
                pub n: [usize; 2],
                pub first: [f64; 2],
                pub step: [f64; 2],
                pub measured: [f64; 2],
                pub z: f64,
                pub pair_of: Vec<usize>,
                pub spot: Option<DVec3>,
            }
            impl RegularScan {
                pub fn confocal(capture: &Capture, method: &str) -> Result<RegularScan> {}
                pub fn with_one_spot(
                    capture: &Capture,
                    method: &str,
                ) -> Result<RegularScan> {}
                pub fn of_columns(grid: &Grid) -> RegularScan {}
                pub fn points(&self) -> usize {}
                pub fn padded(&self) -> [usize; 2] {}
                pub fn size(&self) -> [f64; 2] {}
            }
        }
        mod sharpness {
            pub fn noise(
                light: &[f32],
                tossed: &[f32],
                depths: usize,
                share: f64,
            ) -> ImageNoise {}
        }
        mod upsample {
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
            pub enum Between {
                Zero,
                Bicubic,
            }
            impl RegularScan {
                pub fn finer(&self, factor: usize) -> RegularScan {}
            }
        }
        pub use backproject::{BpOptions, FbpOptions, Filter, PhasorBpOptions};
        pub use convolution::{ConvolutionOptions, Prior};
        pub use dlct::DlctOptions;
        pub use fk::FkOptions;
        pub use image::Volume;
        pub use lct::LctOptions;
        pub use options::ImageOptions;
        pub use phasor::PhasorOptions;
        pub use scan::RegularScan;
        pub use upsample::Between;
        pub trait HostMethod: Options + Clone + Send + Sync + 'static {
            fn image(&self) -> &ImageOptions;
            /// Its share of [`image::level_over_haze`], fitted on simulated scenes (benches/studies/masks.md).
            const MASK_SHARE: f64;
            fn scan(&self, capture: &Capture) -> Result<RegularScan>;
            fn arrays(
                &self,
                capture: &Capture,
                scan: &RegularScan,
                grid: &Grid,
            ) -> Vec<(Buffer, u64)>;
            fn ladder(&self) -> Option<Ladder> {}
            fn volume(
                &self,
                capture: &Capture,
                scan: &RegularScan,
                grid: &Grid,
            ) -> Volume;
        }
    }
    mod conditions {
        pub fn conclude(
            capture: &Capture,
            mask_fraction: Option<f64>,
            result: &mut Reconstruction,
            snapshots: &mut [(usize, Maps)],
        ) {}
    }
    mod discretisation {
        #[derive(Debug, Clone, Copy, Default, PartialEq)]
        pub struct Discretisation {
            pub bins: Bins,
            pub depth_pitch: Option<f64>,
            pub volume: Option<Volume>,
        }
        pub struct Ready<'c> {
            pub capture: Cow<'c, Capture>,
            pub grid: Grid,
            pub sum: usize,
        }
        impl Discretisation {
            pub fn ready<'c>(
                &self,
                solver: &SolverOptions,
                capture: Cow<'c, Capture>,
            ) -> Result<Ready<'c>> {}
            pub fn summed<'c>(
                &self,
                solver: &SolverOptions,
                capture: Cow<'c, Capture>,
            ) -> Result<(Cow<'c, Capture>, usize)> {}
            pub fn sum(&self, solver: &SolverOptions, capture: &Capture) -> usize {}
            pub fn grid(
                &self,
                solver: &SolverOptions,
                capture: &Capture,
            ) -> Result<Grid> {}
        }
    }
    mod domain {
        pub fn compact(s: &mut Schedule, plan: &Plan, level: &Level) {}
        pub fn extract(s: &mut Schedule, level: &Level) {}
    }
    mod drive {
        mod watch {
            #[derive(Debug, Clone)]
            pub struct Progress {
                pub doing: Doing,
                pub point: TracePoint,
                pub iterations: usize,
                pub remaining: Option<f64>,
                pub maps: Option<Maps>,
            }
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub enum Doing {
                Preview,
                Trial,
                Solve,
            }
            pub struct Watch<'w> {
                pub hear: &'w mut dyn FnMut(&Progress) -> ControlFlow<()>,
                pub maps_every: Option<usize>,
                pub maps_at: &'w [usize],
            }
            pub struct Beside<'b, 'w> {
                pub watch: &'b mut Watch<'w>,
                pub keep: Option<Keep<'b>>,
                pub lent: Option<&'b mut LentCounts>,
            }
            impl<'b, 'w> From<&'b mut Watch<'w>> for Beside<'b, 'w> {}
        }
    }
    mod estimate {
        pub fn expected_noise(model: &Model) -> f64 {}
        pub fn background(capture: &Capture) -> f64 {}
        pub fn variances(capture: &Capture, background: f64) -> [f64; 2] {}
        pub fn variance_per_count(capture: &Capture) -> f64 {}
    }
    mod extent {
        pub fn default_volume(capture: &Capture, min_depth: f64) -> Result<Volume> {}
    }
    mod intake {
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
        pub enum Format {
            F32,
            U32,
            U16,
        }
        impl Format {
            pub fn bytes_of(self, counts: usize) -> u64 {}
        }
        #[derive(Clone)]
        pub struct LentCounts {
            pub counts: Lent,
            pub format: Format,
            pub after: Option<Moment>,
            pub taken: Option<Moment>,
        }
        impl LentRows {
            pub fn of_bins(bins: usize) -> LentRows {}
        }
        pub fn tally_of(
            s: &mut Schedule,
            from: Buffer,
            rows: LentRows,
            format: Format,
            ends: &[usize],
        ) {}
        pub fn intake(
            s: &mut Schedule,
            plan: &Plan,
            rows: &Rows,
            lent: LentRows,
            format: Format,
            [factor,
            below,
            ]: [f64; 2],
        ) {}
    }
    mod on_device {
        #[private_fields]
        pub struct OnDevice {
            pub plan: Arc<Plan>,
            pub model: Model,
            pub summed: Vec<Model>,
            pub executor: Executor,
        }
        impl OnDevice {
            pub fn new(
                gpu: &Gpu,
                model: Model,
                plan: impl Into<Arc<Plan>>,
                memory: Option<u64>,
            ) -> Result<OnDevice> {}
            pub fn put(&mut self, model: Model, plan: Arc<Plan>) -> Result<()> {}
            pub fn upload(&mut self) -> Result<()> {}
            pub fn model_of(&self, level: &Level) -> &Model {}
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct VolumeMap {
            pub grid: Grid,
            pub albedo: Vec<f32>,
        }
        pub fn upload(
            executor: &mut Executor,
            buffer: Buffer,
            bytes: &[u8],
        ) -> Result<()> {}
    }
    pub mod option {
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub enum Preset {
            Synthetic,
            Captured,
        }
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Suit {
            pub preset: Preset,
            pub confocal: bool,
            pub reflectance: Reflectance,
            pub unit: f64,
            pub pairs: usize,
        }
        impl Suit {
            pub const USUAL: Suit = Suit {
                preset: Preset::Synthetic,
                confocal: true,
                reflectance: Reflectance::Cosine,
                unit: 1.0,
                pairs: LEAST_PAIRS,
            };
            pub fn of(capture: &Capture) -> Suit {}
            pub fn captured(&self) -> bool {}
            pub fn retroreflective(&self) -> bool {}
            pub fn lambertian(&self) -> bool {}
        }
        #[derive(Debug, Clone, Copy)]
        pub struct Row {
            pub key: &'static str,
            pub group: &'static str,
            pub lines: &'static [&'static str],
            pub range: Range,
        }
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Range {
            Count(usize, usize),
            OneOf(&'static [usize]),
            Seed,
            Positive,
            NotNegative,
            Length,
            Share,
            Fraction,
            Words(&'static [&'static str]),
            Flag,
            Sizes,
            Internal,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub enum Value {
            Count(usize),
            Number(f64),
            Flag(bool),
            Word(String),
            Unset,
        }
        pub trait Options {
            fn rows(&self) -> Vec<&'static Row>;
            fn get(&self, key: &str) -> Option<Value>;
            fn set(&mut self, key: &str, value: &Value) -> bool;
            fn check_ranges(&self) -> Result<()> {}
        }
        impl Row {
            pub fn name(&self) -> String {}
            pub fn worded(&self, value: Value) -> Value {}
            pub fn text(&self) -> String {}
        }
        impl fmt::Display for Value {}
        pub trait Field {
            fn value(&self) -> Value;
            fn put(&mut self, value: &Value);
        }
        impl Field for Sizes {}
        pub fn default_text(suited: impl Fn(&Suit) -> Option<Value>) -> Option<String> {}
    }
    mod outline {
        #[derive(Debug, Clone, PartialEq)]
        pub struct Part {
            pub of: &'static str,
            pub when: When,
            pub lateral: usize,
            pub pairs: usize,
            pub in_parts: usize,
            pub barriers: usize,
            pub steps: Vec<Step>,
        }
        #[derive(Debug, Clone, PartialEq, Eq)]
        pub enum When {
            Start,
            Iterations(usize, usize),
            After(Vec<usize>),
            End,
        }
        #[derive(Debug, Clone, PartialEq, Eq)]
        pub struct Step {
            pub name: String,
            pub sizes: Vec<String>,
            pub reads: Vec<Buffer>,
            pub writes: Vec<Buffer>,
        }
        impl fmt::Display for When {}
        impl fmt::Display for Part {}
    }
    mod over_pairs {
        pub fn sum_bins(s: &mut Schedule, plan: &Plan) {}
    }
    pub mod paper {
        mod options {
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
            pub enum NoiseTerm {
                Off,
                Bin,
                Histogram,
            }
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
            pub enum Decay {
                None,
                Cosine,
            }
        }
        mod schedule {
            pub fn iteration(
                s: &mut Schedule,
                plan: &Plan,
                level: &Level,
                iteration: u32,
                step: u32,
            ) {}
            pub fn initialise(s: &mut Schedule, plan: &Plan, level: &Level) {}
            pub fn reduce(
                s: &mut Schedule,
                plan: &Plan,
                level: &Level,
                keep_above: f64,
            ) {}
            pub fn restart(s: &mut Schedule, plan: &Plan) {}
            pub fn double(s: &mut Schedule, plan: &Plan, coarse: &Level, fine: &Level) {}
            pub fn due(
                s: &mut Schedule,
                plan: &Plan,
                options: &PaperOptions,
                level: &mut usize,
                done: usize,
            ) {}
        }
        pub use options::{Decay, Domain, Noise, NoiseTerm, PaperOptions};
        pub use schedule::{double, due, initialise, iteration, reduce, restart};
        pub fn model(capture: &Capture, grid: &Grid, options: &PaperOptions) -> Model {}
        pub fn reconstruct<'b, 'w: 'b>(
            gpu: &Gpu,
            capture: &Capture,
            grid: Grid,
            options: &PaperOptions,
            memory: Option<u64>,
            with_volume: bool,
            beside: impl Into<Beside<'b, 'w>>,
        ) -> Result<Reconstruction> {}
        pub fn prepare(
            gpu: &Gpu,
            capture: &Capture,
            grid: Grid,
            options: &PaperOptions,
            memory: Option<u64>,
            with_volume: bool,
        ) -> Result<impl Prepared + use<>> {}
        pub fn outline(plan: &Plan, options: &PaperOptions) -> Vec<Part> {}
    }
    mod plan {
        mod buffers {
            pub const UPLOAD: Buffer = Buffer::named("upload");
            pub const COLUMNS_HOST: Buffer = Buffer::named("columns_host");
            pub const RAW_HOST: Buffer = Buffer::named("raw_host");
            pub const MASK_HOST: Buffer = Buffer::named("mask_host");
            pub const RESIDUAL_HOST: Buffer = Buffer::named("residual_host");
            pub const SMOOTH: Buffer = Buffer::named("smooth");
            pub const SMOOTH_SPARE: Buffer = Buffer::named("smooth_spare");
            impl Plan {
                pub fn partials(&self) -> u64 {}
            }
        }
        mod constants {
            impl Plan {
                pub fn constant(&self, constant: Constant) -> Option<u32> {}
                pub fn tune(&mut self, change: impl FnOnce(&mut Tuning)) {}
            }
        }
        mod divide {
            impl Plan {
                pub fn forward_sets(&self, level: &Level) -> u32 {}
                pub fn voxels_at(&self, level: &Level) -> usize {}
                pub fn gathered_pairs(&self, voxels: usize) -> u32 {}
            }
        }
        mod left_out {
            #[derive(Debug, Default)]
            #[private_fields]
            pub struct LeftOut {}
            impl LeftOut {
                pub fn add(
                    &mut self,
                    what: impl Into<String>,
                    saves: impl Into<String>,
                ) {}
            }
            impl Plan {
                pub fn left_out_of_room(
                    &self,
                    out: &mut LeftOut,
                    [active,
                    touched,
                    ]: [u64; 2],
                ) {}
            }
            pub fn mebibytes(bytes: u64) -> String {}
        }
        mod levels {
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct Pairs {
                pub count: usize,
                pub scanned: usize,
                pub others: usize,
                pub wall: Buffer,
                pub scene: Buffer,
            }
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct Level {
                pub grid: Grid,
                pub parts: [usize; 2],
                pub first: usize,
                pub pairs: usize,
                pub sum: usize,
                pub bins: usize,
                pub bin_width: f64,
                pub measured: Buffer,
                pub taps: Buffer,
                pub wall: Buffer,
                pub scene: Buffer,
                pub rendered: Pairs,
                pub reachable: Buffer,
            }
            pub fn pairs_for(lateral: usize, pairs: usize) -> usize {}
            pub const AMPLE: usize = 32;
            pub fn first_of(pairs: usize) -> usize {}
            pub fn sum_of(model: &Model, grid: &Grid) -> usize {}
        }
        mod needs {
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct Demand {
                pub accumulation: Accumulation,
                pub sizes: Sizes,
                pub general: bool,
                pub coarse_to_fine: bool,
                pub iterations: [usize; 2],
                pub pairs: usize,
                pub pixels_per_voxel: usize,
                pub binning: Binning,
                pub gradient: Gradient,
                pub has_rim: bool,
                pub smooth: [f64; 2],
                pub refined: Option<usize>,
                pub more_taps: [usize; 2],
                pub cosine_volume: bool,
                pub lent: Option<LentRows>,
            }
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub struct LentRows {
                pub counts: usize,
                pub sum: usize,
            }
            pub trait Needs {
                fn demand(&self) -> Demand;
                fn capacities(&self, levels: &[Level]) -> [usize; 2];
                fn constants(&self, plan: &Plan) -> Vec<(Constant, u32)>;
                fn passes(&self) -> Vec<&'static Pass>;
                fn buffers(&self, plan: &Plan) -> Vec<(Buffer, u64)>;
                fn betas(&self) -> [f64; 2] {}
                fn volumes(&self, _plan: &Plan) -> [Buffer; 2] {}
                fn left_out(&self, plan: &Plan, out: &mut LeftOut);
            }
        }
        pub(in crate::solve) mod parts {
            #[derive(Debug, Clone, PartialEq)]
            pub struct PairPart {
                pub number: usize,
                pub of: usize,
                pub first: usize,
                pub own: Pairs,
                pub rendered: Pairs,
                pub measured: Buffer,
                pub noise: Buffer,
                pub stored: Vec<Stored>,
            }
            impl PairPart {
                pub fn is_cut(&self) -> bool {}
                pub fn is_first(&self) -> bool {}
                pub fn is_last(&self) -> bool {}
            }
            impl Plan {
                pub fn parts(
                    &self,
                    level: &Level,
                ) -> impl Iterator<Item = PairPart> + use<> {}
                pub fn is_cut(&self, level: &Level) -> bool {}
                pub fn cut_levels(&self) -> impl Iterator<Item = &Level> {}
                pub fn part_counts(&self) -> [Vec<usize>; 2] {}
                pub fn stored_bytes(&self) -> u64 {}
                pub fn within(
                    mut self,
                    needs: &dyn Needs,
                    memory: &Memory,
                    budget: Option<u64>,
                ) -> Result<Plan> {}
            }
        }
        pub(in crate::solve) mod pass {
            pub struct Pass {
                pub kernel: Kernel,
                pub report: &'static str,
                pub code: fn(&Plan) -> &'static KernelCode,
                pub when: fn(&Plan) -> bool,
                pub constants: &'static [(Constant, Value)],
                pub pairs: Option<Voxels>,
                pub faults: &'static [Fault],
                pub twin: Twin,
            }
            #[derive(Debug, Clone, Copy)]
            pub enum Value {
                Is(u32),
                Of(fn(&Plan) -> u32),
            }
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub enum Voxels {
                Active,
                Grid,
            }
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub struct Fault {
                pub bit: u32,
                pub what: &'static str,
                pub mend: &'static [Part],
            }
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub enum Twin {
                Function(&'static str),
                None(&'static str),
            }
            impl Pass {
                pub const fn of(
                    name: &'static str,
                    code: fn(&Plan) -> &'static KernelCode,
                ) -> Pass {}
                pub fn values(&self, plan: &Plan) -> Vec<(Constant, u32)> {}
                pub fn wanted(&self, plan: &Plan) -> Wanted<'static> {}
                pub fn reads(&self, plan: &Plan) -> impl Iterator<Item = Buffer> {}
                pub fn writes(&self, plan: &Plan) -> impl Iterator<Item = Buffer> {}
            }
            impl PartialEq for Pass {}
            impl fmt::Debug for Pass {}
        }
        pub mod passes {
            pub fn forward(plan: &Plan) -> &'static KernelCode {}
            pub fn residual(plan: &Plan) -> &'static KernelCode {}
            pub fn objective(plan: &Plan) -> &'static Pass {}
        }
        mod share {
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub struct Share {
                pub number: usize,
                pub of: usize,
            }
            impl Plan {
                pub fn shared(
                    mut self,
                    share: Share,
                    needs: &dyn Needs,
                ) -> Result<Plan> {}
            }
        }
        mod spots {
            pub const SEEN: Buffer = Buffer::named("seen");
            pub const BETWEEN: Buffer = Buffer::named("between");
            #[derive(Debug, Clone, PartialEq)]
            pub struct Spots {
                pub pairs: usize,
                pub rendered: Rendered,
                pub back: Vec<SpotTaps>,
                pub taps: Buffer,
            }
            impl Spots {
                pub fn word_of(&self, stage: &SpotTaps) -> usize {}
                pub fn words(&self) -> Vec<u32> {}
            }
            impl Plan {
                pub fn has_spots(&self) -> bool {}
                pub fn spots_of(&self, level: &Level) -> Option<&Spots> {}
            }
        }
        mod tuning {
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
            pub enum Accumulation {
                Auto,
                Repeatable,
                Float,
                Fixed,
                Fixed32,
                Cas,
                Owned,
            }
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub struct Tuning {
                pub lanes: u32,
                pub chunk: u32,
                pub forward_fill: u32,
                pub group_losses: bool,
                pub voxels: u32,
                pub slices: u32,
                pub fill: u32,
                pub others_forward: u32,
                pub others_backward: u32,
                pub window: u32,
                pub window_span: u32,
                pub share_arms: bool,
                pub texels: bool,
            }
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
            pub struct Sizes {
                pub lanes: Option<u32>,
                pub chunk: Option<u32>,
                pub window: Option<u32>,
                pub voxels: Option<u32>,
                pub slices: Option<u32>,
            }
            impl Sizes {
                pub fn is_default(&self) -> bool {}
            }
            impl fmt::Display for Sizes {}
            impl FromStr for Sizes {
                type Err = Error;
            }
            impl Tuning {
                pub fn new(
                    model: &Model,
                    capacity: usize,
                    accumulation: Accumulation,
                    device: &Abilities,
                    sizes: &Sizes,
                ) -> Result<Tuning> {}
                pub fn samples_of_group(&self, samples: usize) -> u32 {}
            }
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Plan {
            pub levels: Vec<Level>,
            pub pixel_level: Option<Level>,
            pub batches: Vec<Level>,
            pub spots: Vec<Spots>,
            pub maps: Grid,
            pub pairs: usize,
            pub unused: usize,
            pub bins: usize,
            pub bin_width: f64,
            pub iterations: [usize; 2],
            pub accumulation: Accumulation,
            pub has_rim: bool,
            pub gradient: Gradient,
            pub geometry: Geometry,
            pub reflectance: Reflectance,
            pub volume_reflectance: Reflectance,
            pub fine: bool,
            pub polished: bool,
            pub runs: bool,
            pub touching: bool,
            pub pulse: usize,
            pub pulse_deviation: f64,
            pub high_pass: bool,
            pub tap_sets: usize,
            pub tap_room: usize,
            pub lent: Option<LentRows>,
            pub curved: bool,
            pub scanned: usize,
            pub others: usize,
            pub tuning: Tuning,
            pub work: u64,
            pub cut: Option<usize>,
            pub share: Option<Share>,
            pub with_volume: bool,
            pub texels: u64,
            pub tiles: u32,
            pub capacity: usize,
            pub touched_capacity: usize,
            pub taps: Vec<f64>,
            pub betas: [f64; 2],
            pub volumes: [Buffer; 2],
            pub constants: BTreeMap<Constant, u32>,
            pub passes: Vec<&'static Pass>,
            pub buffers: Vec<BufferPlan>,
            pub reachable: Vec<Vec<bool>>,
            pub all_bins: usize,
            pub left_out: Vec<String>,
        }
        impl Plan {
            pub fn new(
                model: &Model,
                grid: Grid,
                scan: [usize; 2],
                needs: &dyn Needs,
                device: &Abilities,
                with_volume: bool,
            ) -> Result<Plan> {}
            pub fn of_other_pairs(&self, model: &Model, needs: &dyn Needs) -> Plan {}
            pub fn make_room(&mut self, other: &Plan) {}
            pub fn variants(&self) -> Vec<String> {}
            pub fn cells_at(&self, level: &Level) -> usize {}
            pub fn measured(&self, level: &Level) -> Pairs {}
            pub fn finest(&self) -> &Level {}
            pub fn residual(&self) -> Buffer {}
            pub fn fixed_point(&self) -> bool {}
            pub fn seen(
                &self,
                blocks: &'static KernelCode,
                texels: &'static KernelCode,
            ) -> &'static KernelCode {}
            pub fn summed(&self) -> impl Iterator<Item = &Level> {}
            pub fn forward_direct(&self, level: &Level) -> bool {}
            pub fn factor(&self) -> usize {}
            pub fn bytes_of(&self, buffer: Buffer) -> u64 {}
            pub fn bytes(&self) -> BTreeMap<String, u64> {}
        }
    }
    mod prepared {
        pub trait Prepared: Send {
            fn plan(&self) -> &Arc<Plan>;
            fn allocate(&mut self) -> Result<()>;
            fn solve(
                &mut self,
                capture: &Capture,
                beside: Beside<'_, '_>,
            ) -> Result<Reconstruction>;
            fn give(
                &mut self,
                _content: &[u8],
                _to: &Lent,
                _done: Option<Moment>,
            ) -> Result<()> {}
        }
        impl Planned {
            pub fn new(
                gpu: &Gpu,
                outline: Model,
                plan: Plan,
                memory: Option<u64>,
            ) -> Planned {}
            pub fn gpu(&self) -> &Gpu {}
            pub fn plan(&self) -> &Arc<Plan> {}
            pub fn give(
                &mut self,
                content: &[u8],
                to: &Lent,
                done: Option<Moment>,
            ) -> Result<()> {}
            pub fn made(
                &mut self,
                first: impl FnOnce(&mut OnDevice) -> Result<()>,
            ) -> Result<&mut OnDevice> {}
        }
    }
    mod result {
        #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
        pub struct Sharpness {
            pub setting: &'static str,
            pub value: f64,
            pub sharpest: f64,
            pub noise: Option<ImageNoise>,
        }
        #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
        pub struct ImageNoise {
            pub share: f64,
            pub floor: f64,
        }
        #[derive(Debug, Clone)]
        pub struct Reconstruction {
            pub maps: Maps,
            pub volume: Option<VolumeMap>,
            pub trace: Vec<TracePoint>,
            pub empty_loss: f64,
            pub plan: Arc<Plan>,
            pub pairs: u64,
            pub solve_seconds: f64,
            pub device_bytes: u64,
            pub full: bool,
            pub lateral: usize,
            pub volume_iterations: usize,
            pub surface_left: bool,
            pub has_mask: bool,
            pub is_warm: bool,
            pub filled: usize,
            pub sharpness: Option<Sharpness>,
            pub noise: Option<f64>,
            pub exchanged: Exchanged,
            pub kernels: Vec<(&'static str, KernelTime)>,
        }
    }
    mod solver {
        pub trait Solver: Options {
            fn common(&self) -> Common;
            fn check(&self) -> Result<()>;
            fn takes(&self, _capture: &Capture) -> Result<()> {}
            fn detail(&self) -> Option<f64> {}
            fn plan(
                &self,
                capture: &Capture,
                grid: Grid,
                abilities: &Abilities,
                with_volume: bool,
            ) -> Result<Plan>;
            fn needs(&self) -> Option<&dyn Needs> {}
            fn outline(&self, plan: &Plan) -> Vec<Part>;
            fn prepare(
                &self,
                gpu: &Gpu,
                capture: &Capture,
                grid: Grid,
                memory: Option<u64>,
                with_volume: bool,
            ) -> Result<Box<dyn Prepared>>;
        }
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Common {
            pub lateral: usize,
            pub iterations: [usize; 2],
            pub reflectance: Reflectance,
            pub accumulation: Accumulation,
            pub sizes: Sizes,
            pub min_depth: f64,
            pub pixels_per_voxel: usize,
            pub runs_on: RunsOn,
        }
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum RunsOn {
            Device,
            Host,
        }
    }
    mod solvers {
        pub fn pixel_of(
            capture: &Capture,
            volume: Option<Volume>,
            lateral: usize,
        ) -> f64 {}
        pub fn check_solver(name: &str) -> Result<()> {}
        pub fn reflectance(name: &str) -> Result<Reflectance> {}
    }
    pub mod surface {
        pub mod blur {
            pub const BLURS: usize = 4;
            pub const ADDED: usize = 2
                * (REACH * MOST * std::f64::consts::SQRT_2) as usize + 2;
            pub fn first(wanted: f64, noise: f64) -> Option<f64> {}
            pub fn number(at: usize, iterations: usize) -> Option<usize> {}
            pub fn words(
                pulse: Option<&PulseTaps>,
                first: f64,
                room: usize,
            ) -> Vec<f32> {}
        }
        pub mod layers {
            pub const LEAST_CELLS: f64 = 4.0;
            pub fn split(first: &Maps, second: &Maps, least: f64) -> Option<[Maps; 2]> {}
            pub fn merge(layers: &[Maps; 2], least: f64) -> Maps {}
        }
        mod needs {
            pub const SMALL_PIXEL: f64 = 2.2;
            pub fn more_taps(options: &SurfaceOptions) -> [usize; 2] {}
            pub fn points_per_pixel(options: &SurfaceOptions, plan: &Plan) -> usize {}
            pub fn points_of(plan: &Plan) -> usize {}
            pub fn is_blurred(plan: &Plan) -> bool {}
            pub fn pixels(plan: &Plan) -> usize {}
            pub fn buffers(plan: &Plan) -> Vec<(Buffer, u64)> {}
            pub fn left_out(plan: &Plan, out: &mut LeftOut) {}
        }
        mod pixels {
            pub const SUPPORT: f32 = 0.1;
            #[derive(Debug, Clone, Default, PartialEq)]
            pub struct Pixels {
                pub columns: Vec<u32>,
                pub albedo: Vec<f32>,
                pub depth: Vec<f32>,
            }
            impl Pixels {
                pub fn of(layers: &[Maps], support: f32, most: usize) -> Pixels {}
                pub fn of_layers(&self, maps: usize) -> [usize; 2] {}
                pub fn len(&self) -> usize {}
                pub fn is_empty(&self) -> bool {}
                pub fn words(&self) -> Vec<[u32; 4]> {}
                pub fn places(&self, maps: usize) -> Vec<u32> {}
            }
        }
        mod schedule {
            pub fn start(s: &mut Schedule, level: &Level, count: usize, points: usize) {}
            pub fn bonds(s: &mut Schedule, level: &Level, count: usize, done: usize) {}
            pub fn points(s: &mut Schedule, level: &Level, count: usize) {}
            pub fn render(
                s: &mut Schedule,
                plan: &Plan,
                level: &Level,
                count: usize,
                residual: &Pass,
                through: Option<u32>,
            ) {}
            pub fn iteration(
                s: &mut Schedule,
                plan: &Plan,
                level: &Level,
                count: usize,
                [i,
                at,
                skipped,
                all,
                ]: [usize; 4],
                through: Option<u32>,
            ) {}
            pub fn divide(s: &mut Schedule, plan: &Plan) {}
            pub fn extract(
                s: &mut Schedule,
                level: &Level,
                of_layers: [usize; 2],
                layer: usize,
            ) {}
            pub fn extract_behind(s: &mut Schedule, level: &Level) {}
        }
        mod weights {
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct Placed {
                pub pixels: usize,
                pub most: f64,
                pub explained: f64,
                pub left: f64,
            }
            pub fn weights(
                model: &Model,
                first: &Grid,
                level: &Level,
                placed: Placed,
                options: &SurfaceOptions,
            ) -> [f32; SURFACE_WEIGHTS as usize] {}
        }
        pub use needs::{
            SMALL_PIXEL, buffers, is_blurred, left_out, more_taps, pixels, points_of,
            points_per_pixel,
        };
        pub use options::SurfaceOptions;
        pub use pixels::{Pixels, SUPPORT};
        pub use schedule::{
            bonds, divide, extract, extract_behind, iteration, points, render, start,
        };
        pub use weights::{Placed, weights};
        pub fn outline(plan: &Plan, options: &SurfaceOptions) -> Vec<Part> {}
    }
    mod surface_alone {
        mod begin {
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
            pub enum Begin {
                Auto,
                Lct,
                Fbp,
                Plane,
            }
        }
    }
    mod trace {
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct TracePoint {
            pub iteration: usize,
            pub seconds: f64,
            pub gpu_seconds: f64,
            pub lateral: usize,
            pub pairs: usize,
            pub active: usize,
            pub active_ratio: f64,
            pub loss: f64,
            pub data_loss: f64,
        }
    }
    pub mod vector {
        mod devices {
            pub fn reconstruct_on<'b, 'w: 'b>(
                gpus: &[Gpu],
                capture: &Capture,
                grid: Grid,
                options: &VectorOptions,
                memory: Option<u64>,
                with_volume: bool,
                beside: impl Into<Beside<'b, 'w>>,
            ) -> Result<Reconstruction> {}
        }
        pub mod follow {
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct Follow {
                pub iterations: Option<[usize; 2]>,
                pub grow_above: f64,
                pub cut_above: f64,
                pub budget: Option<Duration>,
            }
            impl Default for Follow {}
            pub fn look(
                s: &mut Schedule,
                plan: &Plan,
                level: &Level,
                options: &VectorOptions,
            ) {}
            pub fn grow(
                s: &mut Schedule,
                plan: &Plan,
                level: &Level,
                options: &VectorOptions,
                scene: &SceneData,
                above: f64,
            ) {}
        }
        mod frames {
            #[derive(Debug, Clone, Copy, Default, PartialEq)]
            pub struct Frames {
                pub follow: Option<Follow>,
                pub lent: Option<LentRows>,
            }
            pub struct ForFrames<'o>(pub &'o VectorOptions, pub Frames);
            impl Needs for ForFrames<'_> {}
        }
        mod hat {
            pub fn hat(sigma: f64, bins: usize) -> Vec<f32> {}
        }
        mod left {
            #[derive(Debug, Clone, PartialEq)]
            pub struct Left {
                pub pairs: Vec<[f64; 2]>,
                pub wide: Vec<[f64; 2]>,
                pub noise: f64,
            }
            impl Left {
                pub fn in_wide_bins(&self) -> Left {}
                pub fn share(&self) -> f64 {}
                pub fn noise_share(&self) -> f64 {}
                pub fn is_less(&self, other: &Left) -> bool {}
            }
        }
        mod options {
            pub const LEAST_FLOOR: f64 = 0.1;
        }
        mod prepared {
            pub fn prepare(
                gpu: &Gpu,
                capture: &Capture,
                grid: Grid,
                options: &VectorOptions,
                memory: Option<u64>,
                with_volume: bool,
            ) -> Result<impl Prepared + use<>> {}
            pub fn prepare_for_frames(
                gpu: &Gpu,
                capture: &Capture,
                grid: Grid,
                options: &VectorOptions,
                memory: Option<u64>,
                with_volume: bool,
                frames: Frames,
            ) -> Result<impl Prepared + use<>> {}
        }
        mod schedule {
            pub fn start(
                s: &mut Schedule,
                plan: &Plan,
                level: &Level,
                options: &VectorOptions,
            ) {}
            pub fn iteration(
                s: &mut Schedule,
                plan: &Plan,
                level: &Level,
                iteration: u32,
            ) {}
            pub fn due(
                s: &mut Schedule,
                plan: &Plan,
                options: &VectorOptions,
                level: &mut usize,
                done: usize,
            ) {}
        }
        mod spread {
            impl Rows<'_> {
                pub fn best(
                    &self,
                    pulses: &[PulseTaps],
                ) -> Option<(usize, Vec<[f64; 2]>)> {}
            }
        }
        mod trial {
            pub const PAIRS: usize = 256;
            #[private_fields]
            pub struct Trial {}
            #[derive(Debug, Clone)]
            pub struct Own {
                pub maps: Maps,
                pub behind: Maps,
                pub left: Left,
            }
            #[derive(Debug, Clone)]
            pub enum Start {
                Own,
                Of(Box<Own>),
            }
            impl Trial {
                pub fn new(
                    gpu: &Gpu,
                    capture: &Capture,
                    grid: Grid,
                    options: VectorOptions,
                    memory: Option<u64>,
                ) -> Trial {}
                pub fn set_high_pass(&mut self, [length, floor]: [f64; 2]) {}
                pub fn bands(
                    &mut self,
                    length: f64,
                    pulse: Option<&Pulse>,
                    watch: &mut Watch<'_>,
                ) -> Result<[f64; 2]> {}
                pub fn own(&self) -> Option<&Own> {}
                pub fn fit(
                    &mut self,
                    start: Start,
                    pulse: Option<&Pulse>,
                    watch: &mut Watch<'_>,
                ) -> Result<Option<Left>> {}
                pub fn spread(&self, pulses: &[Pulse]) -> Result<Option<(usize, Left)>> {}
                pub fn fit_volume(
                    &mut self,
                    pulse: Option<&Pulse>,
                    iterations: &[usize],
                    watch: &mut Watch<'_>,
                    go_on: &mut dyn FnMut(Option<Left>) -> bool,
                ) -> Result<()> {}
            }
        }
        pub use devices::reconstruct_on;
        pub use follow::Follow;
        pub use frames::{ForFrames, Frames};
        pub use hat::hat;
        pub use left::Left;
        pub use options::{Domain, LEAST_FLOOR, VectorOptions};
        pub use prepared::{prepare, prepare_for_frames};
        pub use schedule::{due, iteration, start};
        pub use trial::{Own, PAIRS, Start, Trial};
        pub fn usual_high_pass(capture: &Capture) -> f64 {}
        pub const HAT_SIGMA: f64 = 1.5;
        pub fn reconstruct<'b, 'w: 'b>(
            gpu: &Gpu,
            capture: &Capture,
            grid: Grid,
            options: &VectorOptions,
            memory: Option<u64>,
            with_volume: bool,
            beside: impl Into<Beside<'b, 'w>>,
        ) -> Result<Reconstruction> {}
        pub fn outline(plan: &Plan, options: &VectorOptions) -> Vec<Part> {}
        pub fn model(capture: &Capture, grid: &Grid, options: &VectorOptions) -> Model {}
    }
    pub use bins::Bins;
    pub use checkpoint::{Checkpoint, Identity, Keep};
    pub use conditions::conclude;
    pub use discretisation::{Discretisation, Ready};
    pub use domain::{compact, extract};
    pub use drive::{Beside, Doing, Progress, Watch};
    pub use estimate::{background, expected_noise, variance_per_count, variances};
    pub use extent::default_volume;
    pub use intake::{Format, LentCounts, intake, tally_of};
    pub use on_device::{OnDevice, VolumeMap, upload};
    pub use option::{Preset, Suit};
    pub use outline::{Part, Step, When};
    pub use over_pairs::sum_bins;
    pub use paper::{Decay, NoiseTerm, PaperOptions};
    pub use plan::{
        Accumulation, COLUMNS_HOST, Demand, Fault, LeftOut, LentRows, Level, Needs,
        PairPart, Pass, Plan, SMOOTH, Share, Sizes, Tuning, Twin, UPLOAD, Value, Voxels,
        passes,
    };
    pub use prepared::Prepared;
    pub use result::{ImageNoise, Reconstruction, Sharpness};
    pub use solver::{Common, RunsOn, Solver};
    pub use solvers::{SolverOptions, check_solver, pixel_of, reflectance};
    pub use surface::SurfaceOptions;
    pub use surface_alone::{Begin, SurfaceAloneOptions};
    pub use trace::TracePoint;
    pub use vector::VectorOptions;
    pub static PASSES: &[&[&Pass]] = &[
        passes::ALL,
        paper::passes::ALL,
        vector::passes::ALL,
        vector::follow::passes::ALL,
        surface::passes::ALL,
    ];
    pub fn pass_of(kernel: &str) -> Option<&'static Pass> {}
}
pub mod transport {
    mod fine {
        impl Model {
            pub fn is_fine(&self, grid: &Grid) -> bool {}
            pub fn is_polished(&self, grid: &Grid) -> bool {}
        }
    }
    mod grid {
        pub const BRICK_VOXELS: usize = 512;
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Volume {
            pub min: DVec3,
            pub max: DVec3,
        }
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Grid {
            pub n: [usize; 3],
            pub origin: DVec3,
            pub pitch: DVec3,
        }
        impl Grid {
            pub fn new(
                volume: Volume,
                lateral: usize,
                depth_pitch: f64,
            ) -> Result<Grid> {}
            pub fn coarser(&self, factor: usize) -> Grid {}
            pub fn larger(&self, wide: usize, deep: usize) -> Grid {}
            pub fn bricks(&self) -> [usize; 3] {}
            pub fn voxels(&self) -> usize {}
            pub fn storage(&self) -> usize {}
            pub fn contains(&self, c: [usize; 3]) -> bool {}
            pub fn index(&self, c: [usize; 3]) -> usize {}
            pub fn voxel(&self, index: usize) -> [usize; 3] {}
            pub fn position(&self, g: DVec3) -> DVec3 {}
            pub fn extent(&self) -> [f64; 4] {}
            pub fn depth_range(&self) -> [f64; 2] {}
        }
    }
    mod high_pass {
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct HighPass {
            pub length: f64,
            pub floor: f64,
        }
        impl HighPass {
            pub fn decay(&self, bin_width: f64) -> f64 {}
            pub fn apply(&self, row: &mut [f64], bin_width: f64) {}
            pub fn bands(&self, rows: &[f64], bins: usize, bin_width: f64) -> [f64; 2] {}
            pub fn of_noise(&self, bins: usize, bin_width: f64) -> f64 {}
        }
    }
    mod model {
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub enum Sampling {
            Continuous,
            Fixed,
        }
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub enum Binning {
            Nearest,
            Linear,
        }
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub enum Gradient {
            Published,
            Exact,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Model {
            pub wall: Wall,
            pub rendered: Option<Rendered>,
            pub is_spread: bool,
            pub unused: usize,
            pub reflectance: Reflectance,
            pub bins: usize,
            pub bin_width: f64,
            pub t_start: f64,
            pub measured: Vec<f32>,
            pub moments: Option<Moments>,
            pub elements: usize,
            pub pulse: Option<PulseTaps>,
            pub pulse_shape: Option<Pulse>,
            pub high_pass: Option<HighPass>,
            pub peak: f64,
            pub counts_per_unit: f64,
            pub reference: f64,
            pub min_depth: f64,
            pub sampling: Sampling,
            pub binning: Binning,
            pub gradient: Gradient,
            pub l1: f64,
            pub noise: [f64; 2],
            pub learning_rate: f64,
            pub decay_over: f64,
            pub betas: [f64; 2],
            pub epsilon: f64,
            pub keep_above: f64,
            pub seed: u32,
            pub cone: f64,
            pub variance: [f64; 2],
            pub noise_factor: f64,
            pub roughness: f64,
        }
        pub fn cells(pairs: usize, bins: usize) -> usize {}
        impl Model {
            pub fn new(
                capture: &Capture,
                reflectance: Reflectance,
                peak: f64,
                general: bool,
            ) -> Model {}
            pub fn outline(
                capture: &Capture,
                reflectance: Reflectance,
                peak: f64,
                general: bool,
            ) -> (Model, Rows) {}
            pub fn take(
                &mut self,
                rows: &Rows,
                capture: &Capture,
                background: &Background,
            ) {}
            pub fn take_times(
                &mut self,
                rows: &Rows,
                capture: &Capture,
                background: &Background,
                scale: f64,
            ) {}
            pub fn summed(&self, sum: usize) -> Model {}
            pub fn take_sums(&mut self, narrow: &Model, sum: usize) {}
            pub fn rendered_wall(&self) -> &Wall {}
            pub fn pairs(&self) -> usize {}
            pub fn stride(&self) -> usize {}
            pub fn elements_of(&self, pairs: usize) -> usize {}
            pub fn cells(&self) -> usize {}
            pub fn bins_of<T: Copy>(&self, cells: &[T]) -> Vec<T> {}
            pub fn falloff_power(&self) -> i32 {}
            pub fn bin_weight(&self, bin: usize) -> f64 {}
            pub fn near_z(&self, grid: &Grid) -> usize {}
            pub fn nearest(&self, grid: &Grid) -> f64 {}
            pub fn scene(&self, grid: &Grid) -> SceneData {}
            pub fn scene_of_rendered(
                &self,
                grid: &Grid,
                pairs: usize,
                rendered: &Rendered,
            ) -> SceneData {}
            pub fn scene_of(&self, grid: &Grid, pairs: usize) -> SceneData {}
        }
    }
    mod moments {
        #[derive(Debug, Clone, PartialEq)]
        #[private_fields]
        pub struct Moments {}
        impl Moments {
            pub fn of(ends: &[usize], between: Vec<Vec<[f64; 2]>>) -> Moments {}
            pub fn first(&self, pairs: usize) -> &[[f64; 2]] {}
            pub fn all(&self) -> &[[f64; 2]] {}
        }
    }
    mod reach {
        impl Model {
            pub fn reachable_bricks(&self, grid: &Grid) -> Vec<bool> {}
            pub fn touches(&self, grid: &Grid) -> bool {}
            pub fn trim(&mut self, grid: &Grid) -> Range<usize> {}
        }
    }
    mod rows {
        #[derive(Debug, Clone, PartialEq)]
        #[private_fields]
        pub struct Rows {}
        impl Rows {
            pub fn pairs(&self) -> &[usize] {}
            pub fn bins(&self) -> Range<usize> {}
            pub fn reorder(&mut self, order: &[usize]) {}
            pub fn keep_first(&mut self, count: usize) {}
            pub fn crop(&mut self, bins: Range<usize>) {}
        }
    }
    mod spot {
        mod taps {
            #[derive(Debug, Clone, PartialEq)]
            pub struct SpotTaps {
                pub outer: usize,
                pub inner: usize,
                pub columns: usize,
                pub rows: Vec<Vec<(u32, f32)>>,
            }
            impl SpotTaps {
                pub fn of(columns: usize, rows: Vec<Vec<(u32, f32)>>) -> SpotTaps {}
                pub fn sums(&self) -> usize {}
                pub fn terms(&self) -> usize {}
                pub fn longest(&self) -> usize {}
                pub fn back(&self) -> SpotTaps {}
                pub fn through(
                    &self,
                    values: &[f64],
                    bins: usize,
                    way: Way,
                ) -> Vec<f64> {}
                pub fn len_of_words(&self) -> usize {}
                pub fn words(&self) -> Vec<u32> {}
            }
        }
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Spot {
            pub sigma: [f64; 2],
            pub coarsest: f64,
            pub path: f64,
        }
        impl Spot {
            pub fn of(
                capture: &Capture,
                geometry: Geometry,
                laser_scans: bool,
            ) -> Option<Spot> {}
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Rendered {
            pub spot: Spot,
            pub wall: Wall,
            pub stages: Vec<SpotTaps>,
        }
        impl Rendered {
            pub fn of(wall: &Wall, spot: Spot) -> Rendered {}
            pub fn back(&self) -> Vec<SpotTaps> {}
            pub fn all(&self) -> Vec<SpotTaps> {}
        }
    }
    mod spread {
        pub fn spread_order(points: &[&[DVec3]]) -> Vec<usize> {}
        impl Wall {
            pub fn first(&self, pairs: usize) -> Wall {}
            pub fn stretch(&self, first: usize, count: usize) -> Wall {}
            pub fn half(&self, side: usize) -> Wall {}
            pub fn every(&self, [number, of]: [usize; 2]) -> Wall {}
        }
        impl Model {
            pub fn half(&self, side: usize) -> Model {}
            pub fn spread(&mut self) -> Vec<usize> {}
            pub fn enough(&self, wanted: usize) -> usize {}
            pub fn use_first(&mut self, count: usize) {}
        }
    }
    pub mod twin {
        mod domain {
            pub fn initialise(twin: &Twin) -> Vec<bool> {}
            pub fn initialise_raw(twin: &Twin, span: f64) -> Vec<Raw> {}
            pub fn taps(sigma: f64, truncate: f64) -> Vec<f64> {}
            pub fn gaussian(
                twin: &Twin,
                raw: &[Raw],
                active: &[bool],
                taps: &[f64],
            ) -> Vec<f64> {}
            pub fn smooth(grid: &Grid, mut volume: Vec<f64>, taps: &[f64]) -> Vec<f64> {}
            pub fn threshold(twin: &Twin, smooth: &[f64]) -> Vec<bool> {}
            pub fn threshold_raw(
                twin: &Twin,
                smooth: &[f64],
                before: &[bool],
                room: usize,
            ) -> Vec<bool> {}
            pub fn levels(twin: &Twin, smooth: &[f64]) -> Vec<u32> {}
            pub fn room(levels: &[u32], peak: f64, above: f64, room: usize) -> f64 {}
            pub fn rim(grid: &Grid, active: &[bool]) -> Vec<bool> {}
            pub fn touched(grid: &Grid, active: &[bool]) -> Vec<u32> {}
            pub fn compact(mask: &[bool]) -> Vec<u32> {}
            pub fn carry(touched: &[u32], state: &[Raw]) -> Vec<Raw> {}
            pub fn carry_doubled(coarse: &Grid, fine: &Grid, raw: &[Raw]) -> Vec<Raw> {}
            pub fn double_domain(
                coarse: &Grid,
                fine: &Grid,
                active: &[bool],
            ) -> Vec<bool> {}
            pub fn join(active: &[bool], before: &[bool]) -> Vec<bool> {}
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct Column {
                pub albedo: f64,
                pub depth: f64,
                pub normal: DVec3,
            }
            pub fn extract(
                twin: &Twin,
                raw: &[Raw],
                active: &[bool],
            ) -> Vec<Option<Column>> {}
        }
        mod intake {
            pub fn tally(counts: &[f64], bins: usize, of_slice: usize) -> Vec<[f64; 4]> {}
            pub fn intake(
                counts: &[f64],
                bins: usize,
                rows: &Rows,
                [factor,
                below,
                ]: [f64; 2],
            ) -> Vec<f64> {}
        }
        mod optimise {
            pub fn update(
                twin: &Twin,
                iteration: u32,
                step: u32,
                active: &[u32],
                touched: &[u32],
                gradient: &[Raw],
                raw: &mut [Raw],
                first: &mut [Raw],
                second: &mut [Raw],
            ) {}
            pub fn noise(
                twin: &Twin,
                step: u32,
                residual: &[f64],
                state: &mut [[f64; 3]],
            ) {}
            pub fn learning_rate(twin: &Twin, iteration: u32) -> f64 {}
        }
        mod pulse {
            pub fn pulse(twin: &Twin, values: &[f64], way: Way) -> Vec<f64> {}
            pub fn spot(twin: &Twin, values: &[f64], way: Way) -> Vec<f64> {}
            pub fn instrument(twin: &Twin, values: &[f64], way: Way) -> Vec<f64> {}
            pub fn sum_bins(values: &[f32], bins: usize, sum: usize) -> Vec<f64> {}
        }
        mod random {
            pub fn random3(
                index: u32,
                iteration: u32,
                stream: u32,
                seed: u32,
            ) -> [f64; 3] {}
        }
        mod render {
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct Sample {
                pub point: DVec3,
                pub albedo: f64,
                pub normal: DVec3,
                pub length: f64,
            }
            pub fn sample_point(twin: &Twin, index: u32, iteration: u32) -> DVec3 {}
            pub fn sample(
                twin: &Twin,
                iteration: u32,
                active: &[u32],
                raw: &[Raw],
            ) -> Vec<Sample> {}
            pub fn places(twin: &Twin, paths: &[f64]) -> Vec<u32> {}
            pub fn forward(twin: &Twin, samples: &[Sample]) -> Vec<f64> {}
            pub fn forward_pair(
                twin: &Twin,
                pair: usize,
                samples: &[Sample],
            ) -> Vec<f64> {}
            pub fn residual(
                twin: &Twin,
                accumulated: &[f64],
                weights: &[f64],
            ) -> (Vec<f64>, f64) {}
            pub fn backward(
                twin: &Twin,
                samples: &[Sample],
                residual: &[f64],
            ) -> Vec<Raw> {}
            pub fn finish(samples: &[Sample]) -> f64 {}
            pub fn objective(
                twin: &Twin,
                iteration: u32,
                active: &[u32],
                raw: &[Raw],
                weights: &[f64],
            ) -> f64 {}
            pub fn weighted_objective(
                twin: &Twin,
                iteration: u32,
                active: &[u32],
                raw: &[Raw],
            ) -> f64 {}
        }
        mod surface {
            #[derive(Debug, Clone, Copy, PartialEq, Default)]
            pub struct Height {
                pub depth: f64,
                pub albedo: f64,
            }
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct Bond {
                pub other: usize,
                pub way: [i32; 2],
                pub weight: f64,
                pub stencil: DVec2,
            }
            #[derive(Debug, Clone, Copy, PartialEq, Default)]
            pub struct SurfaceWeights {
                pub bend: f64,
                pub jump: f64,
                pub rates: Height,
                pub iterations: f64,
                pub largest: Height,
                pub smooth: f64,
                pub spread: f64,
                pub sparse: f64,
                pub faint: f64,
                pub bend_share: f64,
                pub jump_share: f64,
            }
            impl SurfaceWeights {
                pub fn see(&mut self, combined: &[Combined]) {}
                pub fn renew(&mut self, left: f64) {}
            }
            impl From<[f32; SURFACE_WEIGHTS as usize]> for SurfaceWeights {}
            pub fn surface_bonds(
                twin: &Twin,
                columns: &[u32],
                heights: &[Height],
            ) -> Vec<Vec<Bond>> {}
            pub fn surface_points(
                twin: &Twin,
                columns: &[u32],
                bonds: &[Vec<Bond>],
                heights: &[Height],
                points: usize,
            ) -> (Vec<DVec2>, Vec<Sample>) {}
            #[derive(Debug, Clone, Copy, PartialEq, Default)]
            pub struct Pull {
                pub vector: DVec3,
                pub albedo: f64,
                pub depth: f64,
            }
            pub fn surface_gather(
                twin: &Twin,
                samples: &[Sample],
                residual: &[f64],
            ) -> Vec<Pull> {}
            #[derive(Debug, Clone, Copy, PartialEq, Default)]
            pub struct Combined {
                pub slope: DVec2,
                pub height: Height,
                pub energy: f64,
            }
            pub fn surface_combine(
                twin: &Twin,
                bonds: &[Vec<Bond>],
                heights: &[Height],
                slopes: &[DVec2],
                pulls: &[Pull],
                weights: &SurfaceWeights,
            ) -> Vec<Combined> {}
            pub fn surface_gradient(
                bonds: &[Vec<Bond>],
                combined: &[Combined],
            ) -> Vec<Height> {}
            pub fn surface_pull(
                twin: &Twin,
                columns: &[u32],
                depths: &[f64],
                gradient: &[Height],
                weights: &SurfaceWeights,
                number: u32,
            ) -> Vec<Height> {}
            pub fn surface_step(
                twin: &Twin,
                gradient: &[Height],
                weights: &SurfaceWeights,
                number: u32,
                heights: &mut [Height],
                moments: &mut [[Height; 2]],
            ) {}
            pub fn surface_extract(
                twin: &Twin,
                columns: &[u32],
                heights: &[Height],
                slopes: &[DVec2],
                albedo: &[f64],
                sigma: f64,
            ) -> Vec<Column> {}
            pub fn surface_objective(
                twin: &Twin,
                columns: &[u32],
                bonds: &[Vec<Bond>],
                heights: &[Height],
                points: usize,
                weights: &SurfaceWeights,
            ) -> f64 {}
        }
        mod vector {
            pub fn points(twin: &Twin, active: &[u32]) -> Vec<Sample> {}
            pub fn extrapolate(
                twin: &Twin,
                active: &[u32],
                v: &[DVec3],
                before: &[DVec3],
                beta: f64,
            ) -> Vec<Sample> {}
            #[derive(Debug, Clone, Copy, PartialEq, Default)]
            pub struct Rough {
                pub energy: f64,
                pub gradient: DVec3,
            }
            pub fn roughness(
                twin: &Twin,
                active: &[u32],
                samples: &[Sample],
                bounds: &[[f64; 2]],
                share: f64,
                peak: f64,
            ) -> Vec<Rough> {}
            pub fn forward_bound(twin: &Twin, samples: &[Sample]) -> Vec<f64> {}
            pub fn residual_weighted(
                twin: &Twin,
                accumulated: &[f64],
                measure: bool,
            ) -> (Vec<f64>, [f64; 2]) {}
            pub fn gradient_vectors(
                twin: &Twin,
                samples: &[Sample],
                residual: &[f64],
            ) -> Vec<DVec3> {}
            pub fn into_cone(cone: f64, v: DVec3) -> DVec3 {}
            pub fn shrink(v: DVec3, by: f64) -> DVec3 {}
            #[derive(Debug, Clone, Copy, PartialEq, Default)]
            pub struct Told {
                pub group: f64,
                pub against: f64,
            }
            pub fn step(
                twin: &Twin,
                active: &[u32],
                samples: &[Sample],
                gradient: &[DVec3],
                bounds: &[[f64; 2]],
                share: f64,
                v: &mut [DVec3],
                before: &mut [DVec3],
            ) -> Vec<Told> {}
            pub fn expect(shares: &[f64], power: f64) -> Vec<f64> {}
            #[derive(Debug, Clone, Copy, PartialEq, Eq)]
            pub enum Bound {
                Step,
                Noise,
            }
            pub fn bound(
                twin: &Twin,
                samples: &[Sample],
                residual: &[f64],
                what: Bound,
            ) -> Vec<f64> {}
            pub fn variance(twin: &Twin) -> Vec<f64> {}
            pub fn filter(twin: &Twin, hat: &[f64], odd: bool) -> Vec<f64> {}
            pub fn filter_left(
                twin: &Twin,
                hat: &[f64],
                left: &[f64],
                bins: usize,
                [from,
                to,
                ]: [usize; 2],
            ) -> Vec<f64> {}
            pub fn backproject(twin: &Twin, filtered: &[f64]) -> Vec<f64> {}
            pub fn settle(
                active: &[bool],
                v: &mut [DVec3],
                before: &mut [DVec3],
                momentum: &mut Momentum,
            ) {}
            #[derive(Debug, Clone, Copy, PartialEq)]
            pub struct Momentum {
                pub t: f64,
                pub beta: f64,
                pub objective: f64,
                pub restarts: f64,
                pub share: f64,
            }
            pub fn finish_accelerated(
                before: Momentum,
                objective: f64,
                against: f64,
            ) -> Momentum {}
            pub fn objective_vectors(
                twin: &Twin,
                samples: &[Sample],
                lambda: &[f64],
            ) -> f64 {}
            pub fn lengths(v: &[DVec3], active: &[bool]) -> Vec<f64> {}
            pub fn extract_vectors(
                twin: &Twin,
                v: &[DVec3],
                active: &[bool],
            ) -> Vec<Option<Column>> {}
            pub fn extract_behind(
                twin: &Twin,
                v: &[DVec3],
                active: &[bool],
            ) -> Vec<Option<Column>> {}
        }
        pub use domain::{
            Column, carry, carry_doubled, compact, double_domain, extract, gaussian,
            initialise, initialise_raw, join, levels, rim, room, smooth, taps, threshold,
            threshold_raw, touched,
        };
        pub use intake::{intake, tally};
        pub use optimise::{learning_rate, noise, update};
        pub use pulse::{Way, instrument, pulse, spot, sum_bins};
        pub use random::random3;
        pub use render::{
            Sample, backward, finish, forward, forward_pair, objective, places, residual,
            sample, sample_point, weighted_objective,
        };
        pub use surface::{
            Bond, Combined, Height, Pull, SurfaceWeights, surface_bonds, surface_combine,
            surface_extract, surface_gather, surface_gradient, surface_objective,
            surface_points, surface_pull, surface_step,
        };
        pub use vector::{
            Bound, Momentum, Rough, Told, backproject, bound, expect, extract_behind,
            extract_vectors, extrapolate, filter, filter_left, finish_accelerated,
            forward_bound, gradient_vectors, into_cone, lengths, objective_vectors,
            points, residual_weighted, roughness, settle, shrink, step, variance,
        };
        #[derive(Debug, Clone, Copy)]
        pub struct Twin<'a> {
            pub model: &'a Model,
            pub grid: &'a Grid,
        }
        pub type Raw = [f64; 4];
    }
    mod wall {
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub enum Geometry {
            Confocal,
            TwoPoints,
            Product,
        }
        impl Geometry {
            pub fn counts(
                self,
                pairs: usize,
                scanned: usize,
                others: usize,
            ) -> [usize; 2] {}
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Wall {
            pub geometry: Geometry,
            pub scanned: Vec<DVec3>,
            pub others: Vec<DVec3>,
            pub normals: Option<Vec<DVec3>>,
        }
        impl Wall {
            pub fn confocal(points: Vec<DVec3>) -> Wall {}
            pub fn of(
                capture: &Capture,
                reflectance: Reflectance,
                general: bool,
            ) -> (Wall, Vec<usize>) {}
            pub fn pairs(&self) -> usize {}
            pub fn points_of(&self, pair: usize) -> [usize; 2] {}
            pub fn point(&self, number: usize) -> [DVec3; 2] {}
            pub fn path(&self, pair: usize, x: DVec3) -> f64 {}
            pub fn all_points(&self) -> impl Iterator<Item = &DVec3> {}
            pub fn words(&self) -> Vec<[f32; 4]> {}
        }
    }
    pub use crate::capture::Reflectance;
    pub use grid::{BRICK_VOXELS, Grid, Volume};
    pub use high_pass::HighPass;
    pub use model::{Binning, Gradient, Model, Sampling, cells};
    pub use moments::Moments;
    pub use rows::Rows;
    pub use spot::{Rendered, Spot, SpotTaps};
    pub use spread::spread_order;
    pub use wall::{Geometry, Wall};
}
pub mod trials {
    mod choice {
        #[derive(Debug, Clone, Default, PartialEq)]
        pub struct Choice {
            pub solver: Option<String>,
            pub model: Option<String>,
            pub preset: Option<Preset>,
            pub options: Vec<(&'static str, Value)>,
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Resolved {
            pub preset: Preset,
            pub why: Option<&'static str>,
            pub solver: SolverOptions,
            pub models: Vec<SolverOptions>,
        }
        impl Choice {
            pub fn over(self, base: &Choice) -> Choice {}
            pub fn with_usual(mut self, key: &'static str, value: &Value) -> Choice {}
            pub fn check(&self) -> Result<()> {}
            pub fn seed(&self) -> u64 {}
            pub fn solver_name(&self) -> &str {}
            pub fn foreign(&self) -> Option<&'static str> {}
            pub fn resolve(&self, capture: &Capture) -> Resolved {}
        }
        impl Resolved {
            pub fn find_pulse(&self) -> FindPulse {}
            pub fn tune(
                &self,
                gpu: &Gpu,
                frame: &Capture,
                memory: Option<u64>,
                hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
            ) -> Result<Tuned> {}
        }
        #[derive(Debug, Clone)]
        pub struct Tuned {
            pub solver: SolverOptions,
            pub scan: Capture,
            pub found: Found,
        }
        pub fn preset_for(capture: &Capture) -> Preset {}
    }
    mod high_pass {
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        pub struct FoundHighPass {
            pub length: f64,
            pub floor: f64,
            pub left: [f64; 2],
        }
        impl FoundHighPass {
            pub fn note(&self) -> String {}
        }
    }
    mod model {
        pub const MODELS: [Reflectance; 3] = [
            Reflectance::Cosine,
            Reflectance::Lambertian,
            Reflectance::Retroreflective,
        ];
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        pub struct Refuted {
            pub reflectance: Reflectance,
            pub surface: f64,
            pub volume: f64,
        }
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        pub struct FoundModel {
            pub reflectance: Reflectance,
            pub trials: Vec<(Reflectance, f64, Option<f64>)>,
            pub refuted: Option<Refuted>,
            pub failed: Option<String>,
        }
        impl FoundModel {
            pub fn note(&self) -> String {}
        }
    }
    mod pulse {
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        pub struct FoundPulse {
            pub fwhm: f64,
            pub tail: f64,
            pub trials: Vec<[f64; 3]>,
            pub seconds: f64,
            pub failed: Option<String>,
        }
        impl FoundPulse {
            pub fn pulse(&self) -> Result<Option<Pulse>> {}
            pub fn note(&self) -> String {}
        }
    }
    pub use choice::{Choice, Resolved, Tuned, preset_for};
    pub use high_pass::FoundHighPass;
    pub use model::{FoundModel, MODELS, Refuted};
    pub use pulse::FoundPulse;
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum FindPulse {
        Never,
        IfItShows,
        Always,
    }
    #[derive(Debug, Clone, Copy)]
    pub struct Ask<'a> {
        pub solver: &'a SolverOptions,
        pub models: &'a [SolverOptions],
        pub find_pulse: FindPulse,
        pub discretisation: Discretisation,
        pub memory: Option<u64>,
    }
    impl Ask<'_> {
        pub fn finds_high_pass(&self) -> bool {}
        pub fn find_pulse(&self, capture: &Capture) -> FindPulse {}
    }
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    pub struct Found {
        pub model: Option<FoundModel>,
        pub high_pass: Option<FoundHighPass>,
        pub pulse: Option<FoundPulse>,
        pub seconds: f64,
    }
    impl Found {
        pub fn notes(&self) -> Vec<String> {}
        pub fn settle<'c>(
            &self,
            solver: &SolverOptions,
            models: &[SolverOptions],
            capture: &'c Capture,
        ) -> Result<(SolverOptions, Cow<'c, Capture>)> {}
    }
    pub fn find(
        ask: &Ask<'_>,
        capture: &Capture,
        gpu: &Gpu,
        hear: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Found> {}
}
pub use thirdbounce_base::{Error, Kind, Result, advice, error, panic_message};
#[cfg(feature = "formats")]
pub use thirdbounce_base::{files, host};
pub use thirdbounce_capture as capture;
#[cfg(feature = "formats")]
pub use thirdbounce_export as export;
pub use thirdbounce_gpu as gpu;
pub use thirdbounce_maps::{maps, measure};
pub use thirdbounce_simulate as simulate;
#[cfg(feature = "formats")]
pub use thirdbounce_tags as tags;
// crates/base/src/lib.rs

pub mod advice {
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Remedy {
        Set(Setting),
        SmallerJob { asked: Option<u64>, available: Option<u64> },
    }
    impl Remedy {
        pub const SMALLER_JOB: Remedy = Remedy::SmallerJob {
            asked: None,
            available: None,
        };
    }
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Look {
        Devices,
        Capture,
    }
    #[derive(Debug, Clone, PartialEq, Eq)]
    pub enum Part {
        Text(Cow<'static, str>),
        Change(Remedy),
        Look(Look),
    }
    #[derive(Debug, Clone, Default, PartialEq, Eq)]
    pub struct Advice(Vec<Part>);
    impl Advice {
        pub fn parts(&self) -> &[Part] {}
        pub fn remedies(&self) -> impl Iterator<Item = Remedy> {}
        pub fn names(&self, setting: Setting) -> bool {}
        pub fn say(
            &self,
            changed: impl Fn(Remedy) -> String,
            found: impl Fn(Look) -> String,
        ) -> String {}
        pub fn and(mut self, more: impl Into<Advice>) -> Advice {}
    }
    impl fmt::Display for Advice {}
    impl Serialize for Advice {}
    impl From<&'static str> for Advice {}
    impl From<String> for Advice {}
    impl<const N: usize> From<[Part; N]> for Advice {}
    impl From<&[Part]> for Advice {}
    pub use __advice as advice;
}
pub mod error {
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Kind {
        Input,
        Options,
        Device,
        Memory,
        Output,
        Cancelled,
    }
    #[derive(Debug, Clone, thiserror::Error)]
    pub struct Error {
        pub kind: Kind,
        pub what: String,
        pub mend: Advice,
    }
    impl Error {
        pub fn new(
            kind: Kind,
            what: impl Into<String>,
            mend: impl Into<Advice>,
        ) -> Self {}
        pub fn input(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
        pub fn options(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
        pub fn device(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
        pub fn memory(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
        pub fn output(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
        pub fn advised(self, mend: impl Into<Advice>) -> Self {}
        pub fn at(mut self, place: impl std::fmt::Display) -> Self {}
    }
    pub fn panic_message(panic: &(dyn Any + Send)) -> Option<&str> {}
    pub type Result<T> = std::result::Result<T, Error>;
}
#[cfg(feature = "formats")]
pub mod files {
    pub mod archive {
        #[private_fields]
        pub struct Npz {}
        impl Npz {
            pub fn open(path: &Path) -> Result<Npz> {}
            pub fn names(&self) -> Vec<String> {}
            pub fn get(&mut self, name: &str) -> Result<Option<Array>> {}
            pub fn sizes(&mut self, name: &str) -> Option<[u64; 2]> {}
            pub fn whole(&mut self, name: &str) -> Result<Option<Array>> {}
            pub fn stream(&mut self, name: &str) -> Result<Option<(Head, Elements)>> {}
            pub fn require(&mut self, name: &str, wanted: &str) -> Result<Array> {}
            pub fn missing(&self, name: &str, wanted: &str) -> Error {}
            pub fn scalar(&mut self, name: &str) -> Result<Option<f64>> {}
        }
        #[private_fields]
        pub struct Elements {}
        impl Read for Elements {}
        pub fn npz_bytes(arrays: &[(&str, Array)]) -> Result<Vec<u8>> {}
    }
    pub mod array {
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Element {
            Bool,
            U8,
            U16,
            U32,
            U64,
            I8,
            I16,
            I32,
            I64,
            F32,
            F64,
        }
        impl Element {
            pub fn size(self) -> usize {}
        }
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Number {
            Unsigned(u64),
            Signed(i64),
            Real(f64),
        }
        impl fmt::Display for Number {}
        #[derive(Debug, Clone, PartialEq)]
        pub struct Array {
            pub shape: Vec<usize>,
            pub element: Element,
            pub big_endian: bool,
            pub fortran: bool,
            pub bytes: Vec<u8>,
        }
        impl Array {
            from_slice!(from_f32, f32, F32);
            from_slice!(from_f64, f64, F64);
            from_slice!(from_u16, u16, U16);
            from_slice!(from_u32, u32, U32);
            from_slice!(from_i64, i64, I64);
            pub fn from_bool(shape: &[usize], values: &[bool]) -> Array {}
            pub fn count(&self) -> usize {}
            pub fn to_f64(&self) -> Vec<f64> {}
            pub fn to_f32(&self) -> Vec<f32> {}
            pub fn to_bool(&self) -> Vec<bool> {}
            pub fn to_i64(&self) -> std::result::Result<Vec<i64>, Number> {}
            pub fn parse(npy: &[u8]) -> Result<Array> {}
            pub fn to_npy(&self) -> Vec<u8> {}
        }
        #[derive(Debug, Clone, PartialEq)]
        pub struct Head {
            pub shape: Vec<usize>,
            pub element: Element,
            pub big_endian: bool,
            pub fortran: bool,
        }
        impl Head {
            pub fn whole(self, elements: &mut impl Read, left: u64) -> Result<Array> {}
            pub fn part(&self, elements: &mut impl Read, count: usize) -> Result<Array> {}
            pub fn read(npy: &mut impl Read) -> Result<Head> {}
        }
        pub fn transpose(
            values: &[f32],
            rows: usize,
            columns: usize,
        ) -> Result<Vec<f32>> {}
    }
    pub mod atomic {
        pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {}
        pub fn replace(
            path: &Path,
            fill: impl FnOnce(&Path) -> Result<()>,
        ) -> Result<()> {}
        pub fn is_stream(path: &Path) -> bool {}
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum DiskFault {
            Denied,
            Full,
            Unmoved,
        }
        pub fn inject(fault: Option<(DiskFault, u64)>) -> u64 {}
        pub fn is_full(error: &Error) -> bool {}
        pub fn create_dir(folder: &Path) -> Result<()> {}
        pub fn cannot(path: &Path, e: &std::io::Error) -> Error {}
    }
    pub mod claim {
        pub const EVERY: Duration = Duration::from_secs(30);
        #[private_fields]
        pub struct Claim {}
        impl Claim {
            pub fn take(
                folder: &Path,
                name: &str,
            ) -> Result<std::result::Result<Claim, String>> {}
        }
        impl Drop for Claim {}
        pub fn keep(folder: &Path) {}
        pub fn sweep(folder: &Path) {}
    }
    pub mod opened {
        #[derive(
            Debug,
            Clone,
            Copy,
            PartialEq,
            Eq,
            PartialOrd,
            Ord,
            Serialize,
            Deserialize
        )]
        #[private_fields]
        pub struct Stamp {}
        impl Stamp {
            pub fn of(path: &Path) -> Option<Stamp> {}
        }
        pub type Looked = (PathBuf, Option<Stamp>);
        pub fn note(path: &Path) {}
        pub fn during<T>(work: impl FnOnce() -> T) -> (T, Vec<Looked>) {}
    }
    pub mod staging {
        #[private_fields]
        pub struct Staging {}
        impl Staging {
            pub fn new(target: &Path) -> Result<Staging> {}
            pub fn target(&self) -> &Path {}
            pub fn path(&self) -> &Path {}
            pub fn commit(self, files: &[PathBuf]) -> Result<Vec<PathBuf>> {}
            pub fn commit_folder(self, name: &str) -> Result<PathBuf> {}
        }
        pub fn probe(folder: &Path) -> std::io::Result<()> {}
        pub fn remove(file: &Path) -> Result<()> {}
    }
}
#[cfg(feature = "formats")]
pub mod host {
    pub fn set_limit(bytes: Option<u64>) {}
    pub fn free() -> u64 {}
    pub fn bytes(count: usize, size: usize) -> u64 {}
    pub fn ask(what: &str, bytes: u64) -> Result<()> {}
    pub fn room<T>(what: &str, count: usize) -> Result<Vec<T>> {}
    pub fn filled<T: Clone>(what: &str, count: usize, value: T) -> Result<Vec<T>> {}
    pub fn collected<T>(
        what: &str,
        count: usize,
        values: impl IntoIterator<Item = T>,
    ) -> Result<Vec<T>> {}
    pub fn swells(bytes: u64, packed: u64, times: u64) -> bool {}
}
pub use error::{Error, Kind, Result, panic_message};
// crates/capture/src/lib.rs

mod background {
    #[derive(Debug, Clone, PartialEq)]
    #[private_fields]
    pub struct Background {
        pub level: f64,
    }
    impl Background {
        pub const NONE: Background = Background {
            level: 0.0,
            pairs: None,
        };
        pub fn of(capture: &Capture, taken_off: bool) -> Background {}
        pub fn even(level: f64) -> Background {}
        pub fn of_pair(&self, pair: usize) -> f64 {}
        pub fn range(&self) -> Option<[f64; 2]> {}
    }
    impl Capture {
        pub fn background(&self) -> Background {}
    }
}
pub mod calibrate {
    #[derive(Debug, Clone, PartialEq)]
    pub struct Calibration {
        pub shift: f64,
        pub error: f64,
        pub residual: f64,
        pub target: DVec3,
        pub curve: Vec<[f64; 2]>,
        pub used: usize,
    }
    pub fn time_zero(capture: &Capture, reach: usize) -> Result<Calibration> {}
}
pub mod check {
    pub fn is_small(counts: &[f32]) -> bool {}
    impl Capture {
        pub fn check(&self) -> Result<()> {}
        pub fn check_counts(&self, histograms: &[f32]) -> Result<()> {}
        pub fn copy_checked(&self, histograms: &[f32], to: &mut Vec<f32>) -> Result<()> {}
        pub fn check_finite(&self, histograms: &[f32]) -> Result<()> {}
        pub fn check_scan(&self) -> Result<()> {}
        pub fn check_aperture(&self) -> Result<()> {}
        pub fn t_end(&self) -> f64 {}
        pub fn mean_histogram(&self) -> Vec<f64> {}
        pub fn pair_count(&self) -> usize {}
    }
}
mod choose {
    impl Capture {
        pub fn stride(&self, n: usize) -> Result<Capture> {}
        pub fn subset(&self, count: usize, seed: u64) -> Result<Capture> {}
        pub fn without_missing(self) -> Result<(Capture, usize, Vec<String>)> {}
        pub fn histogram(&self, pair: usize) -> &[f32] {}
        pub fn keep(&self, kept: &[usize], scan: [usize; 2]) -> Capture {}
    }
}
#[cfg(feature = "formats")]
mod clipped {
    impl Capture {
        pub fn clipped_note(&self) -> Option<String> {}
    }
}
mod doubts {
    impl Capture {
        pub fn doubts(&self) -> Vec<String> {}
    }
}
#[cfg(feature = "formats")]
pub mod formats {
    pub mod ccsocr {
        pub fn read(
            set: &mut Set,
            given: &Given,
            notes: &mut Vec<String>,
        ) -> Result<Capture> {}
    }
    pub mod general {
        pub fn read(
            set: &mut Set,
            given: &Given,
            notes: &mut Vec<String>,
        ) -> Result<Capture> {}
    }
    mod given {
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Bounce {
            Nth(usize),
            All,
        }
        impl Bounce {
            pub fn parse(text: &str) -> Result<Bounce> {}
        }
        #[derive(Debug, Clone, Default, PartialEq)]
        #[non_exhaustive]
        pub struct Given {
            pub wall: Option<f64>,
            pub bin_width: Option<f64>,
            pub depth_unit: Option<f64>,
            pub bounce: Option<Bounce>,
            pub time_of_flight: Option<PathBuf>,
            pub turn: Turn,
        }
        impl Given {
            pub fn with_wall(self, size: impl Into<Option<f64>>) -> Given {}
            pub fn with_bin_width(self, width: impl Into<Option<f64>>) -> Given {}
            pub fn with_depth_unit(self, unit: impl Into<Option<f64>>) -> Given {}
            pub fn with_bounce(self, bounce: impl Into<Option<Bounce>>) -> Given {}
            pub fn with_time_of_flight(self, file: impl Into<Option<PathBuf>>) -> Given {}
            pub fn with_turn(self, turn: Turn) -> Given {}
        }
    }
    pub mod hdf5 {
        #[private_fields]
        pub struct Hdf5 {}
        pub fn is_guarded() -> bool {}
        impl Hdf5 {
            pub fn open(path: &Path) -> Result<Hdf5> {}
            pub fn names(&self) -> Vec<String> {}
            pub fn shape(&self, name: &str) -> Result<Option<Vec<usize>>> {}
            pub fn counts(&self, name: &str) -> Result<Option<Counts>> {}
            pub fn chunk(&self, name: &str) -> Result<usize> {}
            pub fn whole(
                &self,
                name: &str,
                start: usize,
                count: usize,
            ) -> Result<Vec<i64>> {}
            pub fn numbers(&self, name: &str) -> Result<Option<(Vec<usize>, Vec<f64>)>> {}
        }
    }
    pub mod legs {
        pub fn check_measured(capture: &Capture) -> Result<()> {}
        pub fn remove(capture: &Capture, legs: &[f64]) -> Result<Capture> {}
    }
    pub mod matlab5 {
        #[private_fields]
        pub struct Matlab5 {}
        impl Matlab5 {
            pub fn open(path: &Path) -> Result<Matlab5> {}
            pub fn parse(bytes: Vec<u8>) -> Result<Matlab5> {}
            pub fn names(&self) -> Vec<String> {}
            pub fn shape(&self, name: &str) -> Result<Option<Vec<usize>>> {}
            pub fn counts(&self, name: &str) -> Result<Option<Counts>> {}
            pub fn numbers(&self, name: &str) -> Result<Option<(Vec<usize>, Vec<f64>)>> {}
        }
    }
    pub mod netf {
        pub fn read(file: &Variables, notes: &mut Vec<String>) -> Result<Capture> {}
    }
    pub mod npz {
        pub fn read(
            path: &Path,
            given: &Given,
            notes: &mut Vec<String>,
        ) -> Result<Capture> {}
        pub fn write(capture: &Capture, path: &Path) -> Result<()> {}
    }
    pub mod phasor {
        pub fn read_2019(file: &Variables, notes: &mut Vec<String>) -> Result<Capture> {}
    }
    mod pulse {
        impl Pulse {
            pub fn read(path: &Path) -> Result<Pulse> {}
        }
    }
    pub mod set {
        #[private_fields]
        pub struct Set {}
        impl Set {
            pub fn open(path: &Path) -> Result<Set> {}
            pub fn holding(&self, name: &str) -> Result<Option<&Variables>> {}
            pub fn add_beside(&mut self, names: &[String]) -> Result<()> {}
            pub fn beside(&self, name: &str) -> PathBuf {}
            pub fn add(&mut self, path: &Path) -> Result<()> {}
            pub fn name(&self) -> String {}
            pub fn first(&self) -> Option<&Variables> {}
            pub fn any(&self, name: &str) -> bool {}
        }
    }
    pub mod stanford {
        pub fn write(capture: &Capture, path: &Path) -> Result<Vec<String>> {}
    }
    pub mod variables {
        #[derive(Debug, Clone, PartialEq)]
        pub struct Counts {
            pub shape: Vec<usize>,
            pub values: Vec<f32>,
        }
        impl Counts {
            pub fn whole(&self) -> bool {}
        }
        pub enum Variables {
            Hdf5(Hdf5),
            Matlab5(Matlab5),
        }
        impl Variables {
            pub fn open(path: &Path) -> Result<Variables> {}
            pub fn names(&self) -> Vec<String> {}
            pub fn have(&self, names: &[&str]) -> bool {}
            pub fn shape(&self, name: &str) -> Result<Option<Vec<usize>>> {}
            pub fn counts(&self, name: &str) -> Result<Counts> {}
            pub fn numbers(&self, name: &str) -> Result<Option<(Vec<usize>, Vec<f64>)>> {}
            pub fn number(&self, name: &str) -> Result<Option<f64>> {}
            pub fn point(&self, name: &str) -> Result<Option<DVec3>> {}
            pub fn missing(&self, name: &str) -> Error {}
        }
    }
    pub mod ytal {
        pub fn read(source: &Variables) -> Result<Capture> {}
        pub fn write(capture: &Capture, path: &Path) -> Result<()> {}
    }
    pub mod znlos {
        pub fn read(
            file: &Variables,
            given: &Given,
            notes: &mut Vec<String>,
        ) -> Result<Capture> {}
    }
    pub use given::{Bounce, Given};
    pub const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";
    #[derive(Debug, Clone, PartialEq)]
    #[non_exhaustive]
    pub struct Opened {
        pub capture: Capture,
        pub dropped: usize,
        pub notes: Vec<String>,
    }
    pub fn read(path: &Path) -> Result<Capture> {}
    pub fn read_with_notes(path: &Path) -> Result<Opened> {}
    pub fn read_given(path: &Path, given: &Given) -> Result<Opened> {}
    pub fn read_kept(path: &Path, given: &Given, keep: &Keep) -> Result<Opened> {}
    pub type Prepare<'p> = dyn FnMut(&mut Capture, &mut Vec<String>) -> Result<()> + 'p;
    pub fn read_prepared(
        path: &Path,
        given: &Given,
        keep: &Keep,
        prepare: &mut Prepare,
    ) -> Result<Opened> {}
    pub fn measured(
        capture: Capture,
        notes: &mut Vec<String>,
    ) -> Result<(Capture, usize)> {}
    pub fn keep_prepared(
        (capture, dropped): (Capture, usize),
        turn: Turn,
        keep: &Keep,
        prepare: &mut Prepare,
        mut notes: Vec<String>,
    ) -> Result<Opened> {}
    pub fn write(capture: &Capture, path: &Path) -> Result<Vec<String>> {}
    pub fn check_ending(path: &Path) -> Result<()> {}
}
pub mod gate {
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Gate {
        pub from: f64,
        pub to: f64,
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct AutoGate {
        pub gate: Gate,
        pub reason: String,
    }
    impl Gate {
        pub fn parse(text: &str) -> Result<Gate> {}
        pub fn holds(self, other: Gate) -> bool {}
        pub fn within(self, other: Gate) -> Gate {}
    }
    impl std::fmt::Display for Gate {}
    impl Capture {
        pub fn gated(&self, gate: Gate) -> Result<Capture> {}
        pub fn set_gate(&mut self, gate: Gate) -> Result<()> {}
        pub fn edge(&self, bin: usize) -> f64 {}
    }
    pub fn auto_gate(capture: &Capture) -> Option<AutoGate> {}
    pub fn published_gate(capture: &Capture, after: Option<f64>) -> AutoGate {}
}
#[cfg(feature = "formats")]
mod keep {
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    #[non_exhaustive]
    pub struct Keep {
        pub stride: Option<usize>,
        pub subset: Option<usize>,
        pub subset_seed: u64,
        pub gate: Option<Gate>,
    }
    impl Keep {
        pub fn with_stride(self, n: impl Into<Option<usize>>) -> Keep {}
        pub fn with_subset(self, count: impl Into<Option<usize>>, seed: u64) -> Keep {}
        pub fn with_gate(self, gate: impl Into<Option<Gate>>) -> Keep {}
    }
}
pub mod lattice {
    #[private_fields]
    pub struct Lattice {
        pub range: [[f64; 2]; 2],
        pub counts: [usize; 2],
        pub spacing: [Option<f64>; 2],
    }
    impl Lattice {
        pub fn of(points: &[DVec3]) -> Lattice {}
        pub fn full(&self) -> Option<&[[usize; 2]]> {}
        pub fn holed(&self) -> Option<&[[usize; 2]]> {}
        pub fn cells(&self) -> Option<[f64; 4]> {}
    }
}
pub mod median {
    pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {}
}
pub mod nearest {
    #[private_fields]
    pub struct Tree<'a> {}
    impl<'a> Tree<'a> {
        pub fn new(points: &'a [DVec3]) -> Tree<'a> {}
        pub fn nearest(&self, at: DVec3, count: usize) -> Vec<(f64, usize)> {}
    }
}
pub mod negative {
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Negatives {
        pub count: usize,
        pub variance: f64,
    }
    pub fn quiet_bins(mean: &[f64]) -> Option<(Range<usize>, f64)> {}
    impl Capture {
        pub fn negatives(&self) -> Option<Negatives> {}
    }
}
mod normals {
    impl Capture {
        pub fn with_normals(&self) -> Result<(Capture, Option<String>)> {}
        pub fn facing(&self) -> Option<DVec3> {}
        pub fn set_normals(&mut self) -> Result<Option<String>> {}
    }
}
pub mod pairs {
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum PairKind {
        Confocal,
        OneLaser,
        OneSensor,
        Exhaustive { lasers: usize, sensors: usize },
        Irregular,
    }
    impl std::fmt::Display for PairKind {}
    #[derive(Debug, Clone, PartialEq)]
    pub struct Product {
        pub scanned: Vec<DVec3>,
        pub other: Vec<DVec3>,
        pub scanned_normal: Option<Vec<DVec3>>,
        pub other_normal: Option<Vec<DVec3>>,
        pub pair_of: Vec<usize>,
        pub laser_scanned: bool,
    }
    impl Capture {
        pub fn pair_kind(&self) -> PairKind {}
        pub fn product(&self) -> Option<Product> {}
    }
}
mod pile_up {
    impl Capture {
        pub fn take_pile_up_out(&mut self) -> Result<Option<String>> {}
    }
}
pub mod pulse {
    #[derive(Debug, Clone, PartialEq)]
    #[non_exhaustive]
    pub struct Pulse {
        pub samples: Vec<f64>,
        pub width: f64,
        pub start: f64,
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct PulseTaps {
        pub before: usize,
        pub weights: Vec<f64>,
    }
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Way {
        Spread,
        Back,
        Squared,
    }
    impl Pulse {
        pub fn new(samples: Vec<f64>, width: f64, start: f64) -> Pulse {}
        pub fn gaussian(fwhm: f64) -> Result<Pulse> {}
        pub fn with_tail(&self, decay: f64) -> Result<Pulse> {}
        pub fn check(&self) -> Result<()> {}
        pub fn end(&self) -> f64 {}
        pub fn fwhm(&self) -> f64 {}
        pub fn moments(&self) -> [f64; 2] {}
        pub fn taps(&self, bin_width: f64) -> Result<PulseTaps> {}
        pub fn taps_of_bins(&self, bin_width: f64) -> Result<PulseTaps> {}
    }
    impl PulseTaps {
        pub fn deviation(&self) -> f64 {}
        pub fn identity() -> PulseTaps {}
        pub fn blurred(&self, sigma: f64, reach: f64) -> PulseTaps {}
        pub fn words(&self) -> Vec<f32> {}
        pub fn spread(&self, histograms: &mut [f32], bins: usize) {}
        pub fn through(&self, histogram: &[f64], way: Way) -> Vec<f64> {}
    }
}
mod recorded {
    pub fn recorded_gate(capture: &mut Capture) -> Option<(AutoGate, usize)> {}
}
mod reflectance {
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Reflectance {
        Cosine,
        Lambertian,
        Retroreflective,
        Isotropic,
    }
    impl Reflectance {
        pub const ALL: [Reflectance; 4] = [
            Reflectance::Cosine,
            Reflectance::Lambertian,
            Reflectance::Retroreflective,
            Reflectance::Isotropic,
        ];
        pub fn name(self) -> &'static str {}
        pub fn has_normals(self) -> bool {}
        pub fn number(self) -> u32 {}
    }
}
pub mod scan {
    pub fn unit_of(width: f64) -> f64 {}
    pub fn decimals(usual: usize, width: f64) -> usize {}
    impl Capture {
        pub fn wall_extent(&self) -> [f64; 4] {}
        pub fn unit(&self) -> f64 {}
        pub fn spacing(&self) -> Option<f64> {}
        pub fn resolution(&self) -> [usize; 2] {}
        pub fn is_confocal(&self) -> bool {}
        pub fn is_planar(&self) -> bool {}
        pub fn set_wall(&mut self, size: f64) -> Result<()> {}
        pub fn scanned_points(&self) -> &[DVec3] {}
        pub fn laser_scans(&self) -> bool {}
    }
}
mod seen {
    impl Capture {
        #[cfg(feature = "formats")]
        pub fn has_whole_counts(&self) -> bool {}
    }
}
pub mod sum {
    impl Capture {
        pub fn binned(&self, n: usize) -> Result<Capture> {}
        pub fn take_sums(&mut self, narrow: &Capture) {}
        pub fn summed(&self, n: usize) -> Result<Capture> {}
    }
    pub fn sum_rows(
        to: &mut [f32],
        bins: usize,
        from: &[f32],
        narrow_bins: usize,
        n: usize,
    ) {}
}
pub mod summary {
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[non_exhaustive]
    pub struct Summary {
        pub name: String,
        pub scan: [usize; 2],
        pub pairs: usize,
        pub bins: usize,
        pub bin_width_m: f64,
        pub bin_width_ps: f64,
        pub pulse_fwhm_m: Option<f64>,
        pub spots_m: [Option<f64>; 2],
        pub t_start_m: f64,
        pub t_end_m: f64,
        pub pair_kind: PairKind,
        pub dropped_pairs: usize,
        pub resolution: [usize; 2],
        pub confocal: bool,
        pub planar: bool,
        pub wall_extent_m: [f64; 4],
        pub wall_depth_m: [f64; 2],
        pub signal_bins: Option<[usize; 2]>,
        pub peak: f64,
        pub peak_bin: usize,
        pub peak_pair: usize,
        pub total: f64,
        pub pairs_with_signal: usize,
        pub integer_counts: bool,
        pub laser_normals: bool,
        pub sensor_normals: bool,
        pub normals_estimated: bool,
    }
    impl Summary {
        pub fn of(capture: &Capture) -> Summary {}
    }
    impl Capture {
        pub fn summary(&self) -> Summary {}
    }
    impl std::fmt::Display for Summary {}
}
mod turn {
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
    #[private_fields]
    pub struct Turn {}
    impl Turn {
        pub fn parse(flip: Option<&str>, degrees: Option<u32>) -> Result<Turn> {}
        pub fn note(&self) -> Option<String> {}
    }
    impl Capture {
        pub fn turned(mut self, turn: Turn) -> Capture {}
    }
}
pub use background::Background;
#[cfg(feature = "formats")]
pub use formats::{
    Bounce, Given, Opened, read, read_given, read_kept, read_with_notes, write,
};
pub use gate::{AutoGate, Gate, auto_gate, published_gate};
#[cfg(feature = "formats")]
pub use keep::Keep;
pub use pairs::{PairKind, Product};
pub use pulse::{Pulse, PulseTaps, Way};
pub use recorded::recorded_gate;
pub use reflectance::Reflectance;
pub use summary::Summary;
pub use turn::Turn;
pub const METRES_PER_PICOSECOND: f64 = 299_792_458e-12;
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Capture {
    pub name: String,
    pub scan: [usize; 2],
    pub laser: Vec<DVec3>,
    pub sensor: Vec<DVec3>,
    pub laser_normal: Option<Vec<DVec3>>,
    pub sensor_normal: Option<Vec<DVec3>>,
    pub bins: usize,
    pub bin_width: f64,
    pub t_start: f64,
    pub histograms: Vec<f32>,
    pub integer_counts: bool,
    pub pulse: Option<Pulse>,
    pub laser_spot: Option<f64>,
    pub sensor_spot: Option<f64>,
    pub cycles: Option<f64>,
    pub direct: Option<f64>,
}
impl Capture {
    pub fn new(
        scan: [usize; 2],
        laser: Vec<DVec3>,
        sensor: Vec<DVec3>,
        bins: usize,
        bin_width: f64,
        histograms: Vec<f32>,
    ) -> Capture {}
    pub fn with(mut self, change: impl FnOnce(&mut Capture)) -> Capture {}
    pub fn outline(&self) -> Capture {}
}
// crates/export/src/lib.rs

pub mod benchmark {
    #[derive(Debug, Clone, PartialEq)]
    pub struct Page {
        pub version: String,
        pub seconds: f64,
        pub cases: Vec<Case>,
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct Case {
        pub scene: String,
        pub photons: Option<f64>,
        pub folder: String,
        pub was_there: bool,
        pub failed: bool,
        pub why: Option<String>,
        pub remedy: Option<Advice>,
        pub seconds: f64,
        pub comparison: Option<Comparison>,
    }
    impl Case {
        pub fn left_out(
            scene: &str,
            photons: Option<f64>,
            folder: &str,
            failed: bool,
            why: &Error,
        ) -> Case {}
    }
    impl Page {
        pub fn summary(&self) -> String {}
        pub fn markdown(&self) -> String {}
        pub fn html(&self, root: &Path) -> Result<String> {}
    }
    pub fn write(folder: &Path, page: &Page) -> Result<Vec<PathBuf>> {}
}
pub mod calibration {
    pub fn write(path: &Path, found: &Calibration) -> Result<()> {}
}
pub mod comparison {
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    pub struct Comparison {
        pub version: String,
        pub device: Device,
        pub capture: Summary,
        pub capture_file: PathBuf,
        pub truth: Option<PathBuf>,
        pub mask_fraction: Option<f64>,
        pub oracle: bool,
        pub repeats: usize,
        pub methods: Vec<MethodReport>,
        pub left_out: Vec<LeftOut>,
    }
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    pub struct LeftOut {
        pub name: String,
        pub why: String,
    }
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    pub struct MethodReport {
        pub name: String,
        pub method: String,
        pub foreign: bool,
        pub runs_on: String,
        pub folder: String,
        pub mask_fraction: Option<f64>,
        pub settings: serde_json::Value,
        pub trace_every: usize,
        pub iterations: usize,
        pub seconds: f64,
        pub repeats_s: Vec<f64>,
        pub preview_s: Option<f64>,
        pub active: usize,
        pub active_ratio: f64,
        pub metrics: Metrics,
        pub reach: Reached,
        pub trace: Vec<TraceEntry>,
    }
    #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
    pub struct Reached {
        pub depth_mae: Reach,
        pub normal_error_deg: Reach,
        pub best_iou: Reach,
        pub all: Reach,
    }
    impl MethodReport {
        pub fn name_and_model(&self) -> String {}
    }
    impl Comparison {
        pub fn table(&self) -> String {}
        pub fn markdown(&self) -> String {}
    }
    pub fn write_json(path: &Path, comparison: &Comparison) -> Result<()> {}
    pub fn read_json(path: &Path) -> Result<Comparison> {}
    pub fn write_markdown(path: &Path, comparison: &Comparison) -> Result<()> {}
}
pub mod confidence {
    pub fn write(path: &Path, maps: &Maps) -> Result<()> {}
}
pub mod curves {
    pub struct ErrorVsTime<'a>(pub &'a Comparison);
    impl Figure for ErrorVsTime<'_> {}
}
pub mod depth_error {
    pub fn write(path: &Path, maps: &Maps, truth: &Truth) -> Result<()> {}
}
pub mod exr {
    pub fn write(path: &Path, maps: &Maps) -> Result<()> {}
}
pub mod figure {
    pub trait Canvas: DrawingBackend<ErrorType: 'static> {}
    pub trait Figure {
        fn size(&self) -> [u32; 2];
        fn draw<B: Canvas>(&self, area: &Area<B>) -> Drawn<B>;
    }
    pub fn svg(figure: &impl Figure) -> Result<String> {}
    pub fn picture(figure: &impl Figure) -> Result<Picture> {}
}
pub mod foreign {
    pub fn read(path: &Path, extent: [f64; 4]) -> Result<Maps> {}
}
pub mod inspection {
    pub fn write(path: &Path, capture: &Capture) -> Result<()> {}
    pub fn write_with_direct(
        path: &Path,
        capture: &Capture,
        direct: Option<&[f64]>,
        shaped: bool,
    ) -> Result<()> {}
}
pub mod mesh {
    pub fn write(path: &Path, maps: &Maps) -> Result<()> {}
}
pub mod npz {
    pub fn write_maps(path: &Path, maps: &Maps) -> Result<()> {}
    pub fn read_maps(path: &Path) -> Result<Maps> {}
    pub fn write_truth(path: &Path, truth: &Truth) -> Result<()> {}
    pub fn read_truth(path: &Path) -> Result<Truth> {}
}
pub mod page {
    #[derive(Debug, Clone, Serialize)]
    #[private_fields]
    pub struct Light {}
    impl Light {
        pub fn of(capture: &Capture) -> Light {}
    }
    pub fn write(
        path: &Path,
        title: &str,
        maps: &Maps,
        light: &Light,
        report: &Report,
    ) -> Result<()> {}
}
pub mod picture {
    pub const BACKGROUND: [u8; 3] = [20, 20, 26];
    pub const INK: [u8; 3] = [230, 230, 230];
    pub const SIDE: usize = 512;
    pub const CAPITAL: usize = 11;
    #[derive(Debug, Clone, PartialEq, Eq)]
    pub struct Picture {
        pub width: usize,
        pub height: usize,
        pub rgb: Vec<u8>,
    }
    pub fn rows(maps: &Maps) -> Vec<usize> {}
    pub fn enlargement(maps: &Maps) -> usize {}
    pub fn colour(share: f64) -> [u8; 3] {}
    impl Picture {
        pub fn new(width: usize, height: usize) -> Picture {}
        pub fn of_maps(
            maps: &Maps,
            factor: usize,
            colour: impl Fn(usize) -> [u8; 3],
        ) -> Picture {}
        pub fn fill(
            &mut self,
            x: usize,
            y: usize,
            width: usize,
            height: usize,
            colour: [u8; 3],
        ) {}
        pub fn paste(&mut self, other: &Picture, x: usize, y: usize) {}
        pub fn blend(&mut self, [column, row]: [i32; 2], colour: [u8; 3], cover: f64) {}
        pub fn shrunk(&self, factor: usize) -> Picture {}
        pub fn write(&mut self, words: &str, at: [f32; 2], em: f32, colour: [u8; 3]) {}
        pub fn text(&mut self, words: &str, [x, y]: [usize; 2]) {}
        pub fn colour_bar(
            &mut self,
            x: usize,
            [top,
            bottom,
            ]: [usize; 2],
            first: f64,
            labels: &[String],
            ink: [u8; 3],
        ) {}
        pub fn bar_width(labels: &[String]) -> usize {}
    }
    pub fn text_width(words: &str) -> usize {}
}
pub mod plot {
    #[derive(Debug, Clone, PartialEq)]
    pub struct Plot {
        pub title: String,
        pub x: String,
        pub y: String,
        pub logarithmic: [bool; 2],
        pub curves: Vec<(String, Vec<[f64; 2]>)>,
        pub mark: Option<(String, f64)>,
    }
    impl Figure for Plot {}
}
pub mod ply {
    pub fn write(path: &Path, maps: &Maps) -> Result<()> {}
}
pub mod png {
    pub fn write_albedo(path: &Path, maps: &Maps) -> Result<()> {}
    pub fn albedo_of(maps: &Maps) -> Picture {}
    pub fn write_depth(path: &Path, maps: &Maps) -> Result<()> {}
    pub fn write_preview(path: &Path, maps: &Maps) -> Result<()> {}
    pub fn preview(maps: &Maps) -> Result<Vec<u8>> {}
    pub fn depth_of(maps: &Maps) -> Picture {}
    pub fn write_normal(path: &Path, maps: &Maps) -> Result<()> {}
    pub fn normal_of(maps: &Maps) -> Picture {}
    pub fn write(path: &Path, picture: &Picture) -> Result<()> {}
    pub fn packed(picture: &Picture) -> Result<Vec<u8>> {}
}
pub mod report {
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    pub struct Report {
        pub version: String,
        pub device: Device,
        pub settings: serde_json::Value,
        pub capture: Summary,
        pub plan: Plan,
        pub trace: Vec<TraceEntry>,
        pub totals: Totals,
        pub metrics: Option<Metrics>,
    }
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    pub struct Device {
        pub name: String,
        pub driver: String,
        pub kind: String,
    }
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    pub struct Plan {
        pub variants: Vec<String>,
        pub left_out: Vec<String>,
        pub parts: [Vec<usize>; 2],
        pub stored_bytes: u64,
        pub buffers: BTreeMap<String, u64>,
        pub full: bool,
    }
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    pub struct TraceEntry {
        pub iteration: usize,
        pub seconds: f64,
        pub gpu_seconds: Option<f64>,
        pub lateral: usize,
        pub pairs: usize,
        pub active: usize,
        pub active_ratio: f64,
        pub loss: f64,
        pub data_loss: Option<f64>,
        pub residual: Option<f64>,
        pub metrics: Option<Metrics>,
    }
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    pub struct Totals {
        pub load_s: f64,
        pub solve_s: f64,
        pub export_s: f64,
        pub preview_s: Option<f64>,
        pub pairs: f64,
        pub pairs_per_s: f64,
        pub peak_device_bytes: u64,
    }
    pub fn write(path: &Path, report: &Report) -> Result<()> {}
    pub fn read(path: &Path) -> Result<Report> {}
}
pub mod volume {
    #[derive(Debug, Clone, PartialEq)]
    pub struct Volume {
        pub size: [usize; 3],
        pub extent: [f64; 6],
        pub albedo: Vec<f32>,
        pub normal: Option<Vec<[f32; 3]>>,
    }
    pub fn write(path: &Path, volume: &Volume) -> Result<()> {}
    pub fn read(path: &Path) -> Result<Volume> {}
}
pub fn write_maps(folder: &Path, maps: &Maps) -> Result<Vec<PathBuf>> {}
// crates/gpu/src/lib.rs

mod access {
    pub fn barriers(
        commands: &[Command],
        bound: impl Fn(Kernel) -> &'static [Binding],
    ) -> usize {}
}
mod budget {
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[private_fields]
    pub struct Memory {
        pub storage_range: u64,
        pub free: [u64; 2],
        pub shared: bool,
    }
    impl Memory {
        pub fn of_card(storage_range: u64, free: [u64; 2]) -> Memory {}
    }
    impl Gpu {
        pub fn memory(&self) -> Memory {}
    }
    pub fn check(
        plan: &[BufferPlan],
        memory: &Memory,
        budget: Option<u64>,
    ) -> Result<()> {}
}
pub mod caller {
    mod buffer {
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[private_fields]
        pub struct Moment {}
        impl Moment {
            pub unsafe fn new(semaphore: vk::Semaphore, value: u64) -> Moment {}
        }
        #[derive(Clone)]
        #[private_fields]
        pub struct Lent {}
        impl Lent {
            pub unsafe fn new(
                buffer: vk::Buffer,
                offset: u64,
                bytes: u64,
            ) -> Result<Lent> {}
            pub fn bytes(&self) -> u64 {}
            pub fn is_on(&self, gpu: &Gpu) -> bool {}
        }
        #[derive(Clone)]
        pub struct Imported(Arc<Memory>);
        impl Imported {
            pub unsafe fn by_fd(
                gpu: &Gpu,
                fd: i32,
                [memory_bytes,
                bytes,
                ]: [u64; 2],
                memory_type: Option<u32>,
            ) -> Result<Imported> {}
            pub fn buffer(&self) -> vk::Buffer {}
            pub fn lend(&self) -> Result<Lent> {}
        }
        impl Drop for Memory {}
        impl Gpu {
            pub fn wait_for(&self, moment: Moment, limit: Duration) -> Result<bool> {}
            pub fn signal(&self, moment: Moment) -> Result<()> {}
        }
        impl Executor {
            pub fn take_lent(
                &mut self,
                from: &Lent,
                to: Buffer,
                [after,
                taken,
                ]: [Option<Moment>; 2],
            ) -> Result<Ticket> {}
            pub fn give_lent(
                &mut self,
                content: &[u8],
                through: Buffer,
                to: &Lent,
                done: Option<Moment>,
            ) -> Result<()> {}
        }
    }
    mod requirements {
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
        pub struct Features {
            pub timeline_semaphore: bool,
            pub int64_atomics: bool,
            pub float_atomics: bool,
            pub memory_budget: bool,
            pub portability_subset: bool,
            pub external_memory_fd: bool,
            pub debug_utils: bool,
        }
        impl Features {
            pub fn extensions(&self) -> Vec<&'static CStr> {}
        }
        #[derive(Debug, Clone, PartialEq, Eq)]
        pub struct Requirements {
            pub api_version: u32,
            pub family: u32,
            pub features: Features,
        }
        impl Requirements {
            pub fn extensions(&self) -> Vec<&'static CStr> {}
        }
        pub unsafe fn requirements(
            get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
            instance: vk::Instance,
            api_version: u32,
            physical_device: vk::PhysicalDevice,
        ) -> Result<Requirements> {}
    }
    pub use buffer::{Imported, Lent, Moment};
    pub use requirements::{Features, Requirements, requirements};
    pub trait QueueLock: Send + Sync {
        fn lock(&self);
        fn unlock(&self);
    }
    #[derive(Debug, Clone, Copy)]
    pub struct Block {
        pub memory: vk::DeviceMemory,
        pub offset: u64,
        pub mapped: *mut std::ffi::c_void,
    }
    unsafe impl Send for Block {}
    unsafe impl Sync for Block {}
    pub unsafe trait BlockSource: Send + Sync {
        fn allocate(
            &self,
            requirements: &vk::MemoryRequirements,
            place: Place,
        ) -> Option<Block>;
        fn free(&self, block: Block);
    }
    #[derive(Clone)]
    pub struct Vulkan {
        pub get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
        pub instance: vk::Instance,
        pub api_version: u32,
        pub physical_device: vk::PhysicalDevice,
        pub device: vk::Device,
        pub queue: vk::Queue,
        pub family: u32,
        pub enabled: Features,
        pub lock: Option<Arc<dyn QueueLock>>,
        pub blocks: Option<Arc<dyn BlockSource>>,
        pub pipeline_cache: vk::PipelineCache,
    }
    impl Gpu {
        pub unsafe fn of_caller(vulkan: &Vulkan) -> Result<Gpu> {}
    }
}
mod device {
    pub const MOST_STORAGE: u32 = 12;
    #[derive(Debug, Clone, Default)]
    pub struct GpuOptions {
        pub device: Option<String>,
        pub validation: bool,
        pub instrumented: bool,
        pub robust: bool,
        pub timings: bool,
        pub statistics: bool,
        pub listings: bool,
        pub work: Option<u64>,
        pub binding: Option<u64>,
        pub pipeline_cache: Option<PathBuf>,
        pub faults: Faults,
    }
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Accumulations {
        pub float: bool,
        pub int64: bool,
    }
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Limits {
        pub storage_range: u64,
        pub texels: u64,
        pub workgroup_invocations: u32,
        pub shared_memory: u32,
        pub groups: [u32; 3],
        pub subgroup: u32,
        pub work: u64,
    }
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Abilities {
        pub kind: DeviceKind,
        pub accumulations: Accumulations,
        pub limits: Limits,
    }
    #[derive(Clone)]
    pub struct Gpu(Arc<Opened>);
    impl Deref for Gpu {
        type Target = Opened;
    }
    #[private_fields]
    pub struct Opened {
        pub info: DeviceInfo,
        pub accumulations: Accumulations,
        pub limits: Limits,
    }
    impl Gpu {
        pub fn open(options: &GpuOptions) -> Result<Gpu> {}
        pub fn open_all(options: &GpuOptions) -> Result<Vec<Gpu>> {}
        pub fn is(&self, other: &Gpu) -> bool {}
        pub fn abilities(&self) -> Abilities {}
        pub fn validation_messages(&self) -> Vec<String> {}
    }
}
mod exchange {
    pub const EXCHANGED: Buffer = Buffer::named("exchanged");
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Summed {
        pub buffer: Buffer,
        pub bytes: u64,
        pub counted: Option<Counted>,
    }
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Counted {
        pub buffer: Buffer,
        pub word: u32,
        pub bytes: u64,
    }
    pub fn room_for(sums: &[Summed]) -> u64 {}
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct Exchanged {
        pub times: u64,
        pub bytes: u64,
        pub seconds: f64,
    }
    #[private_fields]
    pub struct Exchange {}
    impl Exchange {
        pub fn among(count: usize) -> Vec<Exchange> {}
        pub fn number(&self) -> usize {}
        pub fn add_up(&self, counts: &[u32], values: &mut Vec<f32>) -> Result<()> {}
    }
    impl Drop for Exchange {}
    pub fn is_left(error: &Error) -> bool {}
    impl Executor {
        pub fn join(&mut self, exchange: Exchange) {}
        pub fn exchanged(&self) -> Exchanged {}
    }
}
mod executables {
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct Compiled {
        pub seconds: f64,
        pub executables: Vec<Executable>,
    }
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct Executable {
        pub name: String,
        pub subgroup: u32,
        pub statistics: Vec<(String, f64)>,
        pub listings: Vec<(String, String)>,
    }
    impl Gpu {
        pub fn compile(
            &self,
            kernel: impl Into<Kernel>,
            code: &KernelCode,
            constants: &[(Constant, u32)],
        ) -> Result<Compiled> {}
        pub fn tells_of_kernels(&self) -> bool {}
    }
}
mod execute {
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct KernelTime {
        pub calls: u64,
        pub seconds: f64,
    }
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
    pub struct Ticket(pub(super) u64);
    #[private_fields]
    pub struct Executor {}
    impl Executor {
        pub fn new(gpu: &Gpu, arena: Arena) -> Result<Executor> {}
        pub fn arena(&self) -> &Arena {}
        pub fn submit(&mut self, schedule: &Schedule) -> Result<Ticket> {}
        pub fn wait(&mut self, ticket: Ticket) -> Result<()> {}
        pub fn settle(&mut self) -> Result<()> {}
        pub fn run(&mut self, schedule: &Schedule) -> Result<()> {}
        pub fn run_once(&mut self, write: impl FnOnce(&mut Schedule)) -> Result<()> {}
        pub fn spare_schedule(&mut self) -> Schedule {}
        pub fn keep_schedule(&mut self, mut schedule: Schedule) {}
        pub fn gpu_seconds(&self) -> f64 {}
        pub fn times(&self) -> &BTreeMap<&'static str, KernelTime> {}
        pub fn take_times(&mut self) -> BTreeMap<&'static str, KernelTime> {}
    }
    impl Drop for Executor {}
}
mod faults {
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Point {
        Allocation,
        Object,
        Submission,
        Wait,
    }
    impl Point {
        pub const ALL: [Point; 4] = [
            Point::Allocation,
            Point::Object,
            Point::Submission,
            Point::Wait,
        ];
    }
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
    pub struct Faults {
        pub fail: Option<(Point, u64)>,
        pub hang: Option<u64>,
        pub told: Option<u64>,
        pub poison: Option<u32>,
        pub shuffle: Option<u64>,
        pub guard: bool,
    }
    impl Gpu {
        pub fn reached(&self, point: Point) -> u64 {}
        pub fn allocated(&self) -> u64 {}
        pub fn close(self) -> Vec<String> {}
    }
}
mod few {
    #[derive(Clone, Copy)]
    #[private_fields]
    pub struct Few<T, const N: usize> {}
    impl<T, const N: usize> Deref for Few<T, N> {
        type Target = [T];
    }
    impl<T: PartialEq, const N: usize> PartialEq for Few<T, N> {}
    impl<T: Eq, const N: usize> Eq for Few<T, N> {}
    impl<T: fmt::Debug, const N: usize> fmt::Debug for Few<T, N> {}
}
mod guard {
    #[derive(Debug, Clone, PartialEq, Eq)]
    pub struct Overrun {
        pub buffer: Buffer,
        pub bytes: u64,
        pub at: u64,
    }
    #[derive(Debug, Clone, Default, PartialEq, Eq)]
    pub struct Guarded {
        pub buffers: usize,
        pub overruns: Vec<Overrun>,
    }
    impl Gpu {
        pub fn take_guarded(&self) -> Guarded {}
    }
}
mod host {
    impl Executor {
        pub fn read<T: bytemuck::Pod>(
            &self,
            buffer: Buffer,
            items: impl RangeBounds<usize>,
        ) -> Vec<T> {}
        pub fn read_behind<T: bytemuck::Pod>(
            &self,
            done: Ticket,
            buffer: Buffer,
            items: impl RangeBounds<usize>,
            into: &mut Vec<T>,
        ) {}
        pub fn write(&mut self, buffer: Buffer, bytes: &[u8]) {}
        pub fn write_at(&mut self, buffer: Buffer, offset: u64, bytes: &[u8]) {}
    }
}
mod instance {
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
    pub enum DeviceKind {
        Discrete,
        Virtual,
        Integrated,
        Cpu,
        Other,
    }
    impl std::fmt::Display for DeviceKind {}
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    pub struct DeviceInfo {
        pub index: usize,
        pub name: String,
        pub kind: DeviceKind,
        pub driver: String,
        pub api: String,
        pub uuid: String,
        pub memory: u64,
    }
    pub fn devices() -> Result<Vec<DeviceInfo>> {}
}
mod make {
    #[derive(Debug, Clone)]
    pub struct Wanted<'c> {
        pub kernel: Kernel,
        pub code: &'c KernelCode,
        pub constants: Vec<(Constant, u32)>,
    }
    impl Executor {
        pub fn add_kernels(&mut self, wanted: &[Wanted<'_>]) -> Result<()> {}
        pub fn has_kernel(&self, kernel: Kernel) -> bool {}
        pub fn add_kernel(
            &mut self,
            kernel: impl Into<Kernel>,
            code: &KernelCode,
            constants: &[(Constant, u32)],
        ) -> Result<()> {}
    }
}
mod memory {
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub enum Place {
        Device,
        Upload,
        Readback,
        Store,
    }
    #[derive(Debug, Clone, PartialEq, Eq)]
    pub struct BufferPlan {
        pub buffer: Buffer,
        pub bytes: u64,
        pub place: Place,
    }
    impl BufferPlan {
        pub const LEAST: u64 = 16;
        pub fn new(buffer: Buffer, bytes: u64, place: Place) -> BufferPlan {}
    }
    #[private_fields]
    pub struct Arena {}
    impl Arena {
        pub fn new(
            gpu: &Gpu,
            plan: &[BufferPlan],
            budget: Option<u64>,
        ) -> Result<Arena> {}
        pub fn bytes(&self) -> u64 {}
        pub fn taken(&self) -> u64 {}
        pub fn stored(&self) -> u64 {}
        pub fn sizes(&self) -> BTreeMap<Buffer, u64> {}
        pub fn size(&self, buffer: Buffer) -> u64 {}
    }
    impl Drop for Arena {}
}
mod names {
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
    #[private_fields]
    pub struct Buffer {}
    impl Buffer {
        pub const fn named(name: &'static str) -> Buffer {}
        pub const fn at(self, index: u16) -> Buffer {}
        pub const fn family(self) -> Buffer {}
    }
    impl fmt::Display for Buffer {}
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub struct Kernel(&'static str);
    impl Kernel {
        pub const fn named(name: &'static str) -> Kernel {}
        pub const fn name(self) -> &'static str {}
    }
    impl fmt::Display for Kernel {}
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub struct Constant(&'static str);
    impl Constant {
        pub const fn named(name: &'static str) -> Constant {}
        pub const fn name(self) -> &'static str {}
    }
    impl fmt::Display for Constant {}
}
mod pace {
    impl Gpu {
        pub fn expected_rate(&self) -> f64 {}
    }
}
mod record {
    impl Executor {
        pub fn reserve(&mut self, schedule: &Schedule) -> Result<()> {}
    }
}
mod recording {
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct HostSpan {
        pub what: &'static str,
        pub from: f64,
        pub to: f64,
    }
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Ran {
        pub kernel: &'static str,
        pub stage: Option<usize>,
        pub submission: u64,
        pub from: f64,
        pub to: f64,
    }
    #[derive(Debug, Clone)]
    pub struct KernelMade {
        pub code: KernelCode,
        pub constants: Vec<(String, u32)>,
        pub statistics: Vec<(String, f64)>,
    }
    #[derive(Debug, Clone, Default)]
    pub struct Recording {
        pub host: Vec<HostSpan>,
        pub stages: Vec<Stage>,
        pub device: Vec<Ran>,
        pub kernels: BTreeMap<&'static str, KernelMade>,
    }
    impl Gpu {
        pub fn span(&self, what: &'static str) -> OpenSpan<'_> {}
        pub fn take_recording(&self) -> Recording {}
        pub fn has_clock(&self) -> bool {}
        pub fn now(&self) -> f64 {}
    }
}
mod rounding {
    impl Gpu {
        pub fn promises_rounding(&self) -> bool {}
    }
    pub fn to_nearest(words: &[u32]) -> Vec<u32> {}
}
mod schedule {
    #[derive(Debug, Clone, PartialEq, Eq)]
    pub enum Size {
        Groups([u32; 3]),
        Indirect(Buffer, u64, Option<[u32; 3]>),
    }
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Binds(Few<(Buffer, Buffer), MOST_BINDS>);
    impl Default for Binds {}
    impl Binds {
        pub fn buffer_of(&self, block: Buffer) -> Buffer {}
    }
    #[derive(Debug, Clone, PartialEq, Eq)]
    pub enum Command {
        Dispatch {
            kernel: Kernel,
            size: Size,
            bind: Binds,
            push: [u32; PUSH_WORDS],
            work: u64,
            first: [u32; 3],
        },
        Copy { from: Buffer, from_offset: u64, to: Buffer, to_offset: u64, bytes: u64 },
        Fill { buffer: Buffer, offset: u64, bytes: u64, value: u32 },
        Exchange(Vec<Summed>),
        Stage(Stage),
    }
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Stage {
        pub name: &'static str,
        pub values: Few<(&'static str, u64), MOST_NUMBERS>,
    }
    impl Stage {
        pub fn new(name: &'static str, values: &[(&'static str, u64)]) -> Stage {}
        pub fn value(&self, name: &str) -> Option<u64> {}
    }
    impl fmt::Display for Stage {}
    #[derive(Debug, Clone, Default, PartialEq, Eq)]
    pub struct Schedule {
        pub commands: Vec<Command>,
    }
    impl Schedule {
        pub fn of(write: impl FnOnce(&mut Schedule)) -> Schedule {}
        pub fn clear(&mut self) {}
        pub fn dispatch(
            &mut self,
            kernel: impl Into<Kernel>,
            groups: [u32; 3],
            turns: u64,
        ) -> &mut Command {}
        pub fn indirect(
            &mut self,
            kernel: impl Into<Kernel>,
            buffer: Buffer,
            offset: u64,
            turns: u64,
        ) -> &mut Command {}
        pub fn copy(&mut self, from: Buffer, to: Buffer, bytes: u64) {}
        pub fn copy_from(&mut self, [from, to]: [Buffer; 2], offset: u64, bytes: u64) {}
        pub fn fill(&mut self, buffer: Buffer, bytes: u64, value: u32) {}
        pub fn set(&mut self, buffer: Buffer, index: u32, value: u32) {}
        pub fn copy_word(&mut self, buffer: Buffer, from: u32, to: u32) {}
        pub fn exchange(&mut self, sums: &[Summed]) {}
        pub fn stage(&mut self, name: &'static str, values: &[(&'static str, u64)]) {}
        pub fn append(&mut self, other: &mut Schedule) {}
    }
    impl Command {
        pub fn bind(&mut self, block: Buffer, buffer: Buffer) -> &mut Command {}
        pub fn at_most(&mut self, groups: [u32; 3]) -> &mut Command {}
        pub fn with(&mut self, values: impl bytemuck::NoUninit) -> &mut Command {}
        pub fn work(&self) -> u64 {}
        pub fn name(&self) -> &'static str {}
    }
    impl fmt::Display for Schedule {}
}
pub mod spirv {
    mod class {
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
        pub struct Counts {
            pub fma: u32,
            pub special: u32,
            pub other: u32,
            pub conversions: u32,
            pub loads: u32,
            pub stores: u32,
            pub broadcasts: u32,
            pub shared: u32,
            pub atomics: u32,
            pub shared_atomics: u32,
            pub bytes: u32,
        }
        impl Counts {
            pub fn issued(&self) -> u32 {}
        }
    }
    pub use class::Counts;
    pub fn count_loop<N: AsRef<str>>(
        code: &KernelCode,
        constants: &[(N, u32)],
    ) -> Option<[Counts; 2]> {}
    pub fn extended<N: AsRef<str>>(
        code: &KernelCode,
        constants: &[(N, u32)],
    ) -> Option<Vec<u32>> {}
}
mod state {
    impl Executor {
        pub fn download(&mut self, buffer: Buffer, through: Buffer) -> Result<Vec<u8>> {}
        pub fn restore(
            &mut self,
            buffer: Buffer,
            content: &[u8],
            through: Buffer,
        ) -> Result<()> {}
    }
}
pub use access::barriers;
pub use budget::{Memory, check};
pub use device::{
    Abilities, Accumulations, Gpu, GpuOptions, Limits, MOST_STORAGE, Opened,
};
pub use exchange::{Counted, EXCHANGED, Exchange, Exchanged, Summed, is_left, room_for};
pub use executables::{Compiled, Executable};
pub use execute::{Executor, KernelTime, Ticket};
pub use faults::{Faults, Point};
pub use few::Few;
pub use guard::{Guarded, Overrun};
pub use instance::{DeviceInfo, DeviceKind, devices};
pub use make::Wanted;
pub use memory::{Arena, BufferPlan, Place};
pub use names::{Buffer, Constant, Kernel};
pub use recording::{HostSpan, KernelMade, Ran, Recording};
pub use rounding::to_nearest;
pub use schedule::{Binds, Command, Schedule, Size, Stage};
#[derive(Debug, Clone, Copy)]
pub struct KernelCode {
    pub name: &'static str,
    pub spirv: &'static [u8],
    pub bindings: &'static [Binding],
    pub constants: &'static [(Constant, u32)],
}
impl From<&KernelCode> for Kernel {}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    Uniform,
    Storage,
    Texels { words: u32 },
}
#[derive(Debug, Clone, Copy)]
pub struct Binding {
    pub block: Buffer,
    pub slot: u32,
    pub view: View,
    pub reads: bool,
    pub writes: bool,
}
// crates/maps/src/lib.rs

pub mod maps {
    mod confidence {
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Conditions {
            pub noise: f64,
            pub width: f64,
            pub aperture: f64,
            pub voxel: [f64; 2],
            pub two_cosines: bool,
        }
        impl Maps {
            pub fn set_confidence(&mut self, known: &Conditions) {}
        }
    }
    mod parts {
        impl Maps {
            pub fn leave_out_uncertain_parts(&mut self) -> bool {}
        }
    }
    pub use confidence::Conditions;
    #[derive(Debug, Clone, PartialEq)]
    pub struct Maps {
        pub nx: usize,
        pub ny: usize,
        pub extent: [f64; 4],
        pub albedo: Vec<f32>,
        pub depth: Vec<f32>,
        pub normal: Vec<[f32; 3]>,
        pub mask: Vec<bool>,
        pub mask_fraction: Option<f64>,
        pub confidence: Option<Vec<f32>>,
        pub behind: Option<Layer>,
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct Layer {
        pub albedo: Vec<f32>,
        pub depth: Vec<f32>,
        pub normal: Vec<[f32; 3]>,
        pub mask: Vec<bool>,
        pub confidence: Option<Vec<f32>>,
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct Truth {
        pub nx: usize,
        pub ny: usize,
        pub extent: [f64; 4],
        pub depth: Vec<f32>,
        pub normal: Vec<[f32; 3]>,
        pub mask: Vec<bool>,
        pub behind: Option<Layer>,
    }
    impl Maps {
        pub const MASK_FRACTION: f64 = 0.3;
        pub fn empty([nx, ny]: [usize; 2], extent: [f64; 4]) -> Maps {}
        pub fn mask_of(albedo: &[f32], fraction: f64) -> Vec<bool> {}
        pub fn white(albedo: &[f32]) -> f32 {}
        pub fn set_mask(&mut self, fraction: impl Into<Option<f64>>) {}
        pub fn layer(&self, layer: usize) -> Option<Maps> {}
        pub fn check(&self) -> Result<()> {}
        pub fn finer(&self, factor: usize) -> Maps {}
        pub fn pixel_at(&self, x: f64, y: f64) -> Option<usize> {}
        pub fn centre(&self, ix: usize, iy: usize) -> [f64; 2] {}
    }
    impl Truth {
        pub fn check(&self) -> Result<()> {}
        pub fn centre(&self, ix: usize, iy: usize) -> [f64; 2] {}
    }
    pub fn percentile(values: &[f32], p: f64) -> Option<f32> {}
}
pub mod measure {
    pub mod calibration {
        pub const WITHIN: f64 = 0.68;
        #[derive(Debug, Clone, Default, PartialEq)]
        #[private_fields]
        pub struct Calibration {}
        impl Calibration {
            pub fn add(&mut self, confidence: f64, error: f64) {}
            pub fn within(&self) -> Option<f64> {}
            pub fn quarters(&self) -> Vec<[f64; 2]> {}
        }
    }
    pub mod metrics {
        pub const SWEEP: [f64; 14] = [
            0.01,
            0.02,
            0.03,
            0.05,
            0.075,
            0.1,
            0.15,
            0.2,
            0.25,
            0.3,
            0.4,
            0.5,
            0.6,
            0.8,
        ];
        #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
        pub struct Metrics {
            pub fraction: Option<f64>,
            pub predicted_pixels: usize,
            pub true_pixels: usize,
            pub hit_pixels: usize,
            pub completeness: Option<f64>,
            pub iou: Option<f64>,
            pub depth_mae: Option<f64>,
            pub depth_rmse: Option<f64>,
            pub depth_mae_whole: Option<f64>,
            pub depth_rmse_whole: Option<f64>,
            pub normal_error_deg: Option<f64>,
            pub normal_mae: Option<f64>,
            pub paper: PaperMeasure,
            pub best_iou: Option<f64>,
            pub best_fraction: Option<f64>,
            pub at_best: Option<AtBest>,
            pub within_confidence: Option<f64>,
            pub calibration: Vec<[f64; 2]>,
            pub layers: Vec<LayerMetrics>,
            pub sweep: Vec<[f64; 2]>,
        }
        #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
        pub struct AtBest {
            pub hit_pixels: usize,
            pub completeness: Option<f64>,
            pub depth_mae: Option<f64>,
            pub depth_rmse: Option<f64>,
            pub normal_error_deg: Option<f64>,
        }
        #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
        pub struct LayerMetrics {
            pub true_pixels: usize,
            pub hit_pixels: usize,
            pub completeness: Option<f64>,
            pub iou: Option<f64>,
            pub depth_mae: Option<f64>,
            pub normal_error_deg: Option<f64>,
        }
        impl Metrics {
            pub fn brief(mut self) -> Metrics {}
        }
        pub fn metrics(
            maps: &Maps,
            truth: &Truth,
            fraction: impl Into<Option<f64>>,
        ) -> Result<Metrics> {}
    }
    pub mod paper {
        #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
        pub struct PaperMeasure {
            pub depth_mae: Option<f64>,
            pub depth_rmse: Option<f64>,
            pub normal_mae: Option<f64>,
            pub normal_rmse: Option<f64>,
        }
    }
    pub mod reach {
        #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
        pub struct Reach {
            pub target: Option<f64>,
            pub first_s: Option<f64>,
            pub kept_s: Option<f64>,
        }
        pub fn reach(target: Option<f64>, trace: &[(f64, bool)]) -> Reach {}
        pub fn median(values: &[f64]) -> Option<f64> {}
    }
    pub use calibration::Calibration;
    pub use metrics::{AtBest, LayerMetrics, Metrics, metrics};
    pub use paper::PaperMeasure;
    pub use reach::{Reach, median, reach};
}
// crates/simulate/src/lib.rs

mod builtin {
    impl Scene {
        pub fn named(spec: &str) -> Result<Scene> {}
        pub fn known() -> &'static [(&'static str, &'static str)] {}
    }
}
mod figure {
    pub fn figure(centre: DVec3, height: f64) -> Vec<Mesh> {}
}
mod letters {
    pub fn letter(name: char, centre: DVec3, height: f64) -> Result<Mesh> {}
}
mod mesh {
    #[derive(Debug, Clone, PartialEq, Default)]
    pub struct Mesh {
        pub triangles: Vec<[DVec3; 3]>,
        pub normals: Vec<[DVec3; 3]>,
        pub self_occluding: bool,
    }
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Placement {
        pub fit: Option<f64>,
        pub scale: f64,
        pub rotate: [f64; 3],
        pub translate: DVec3,
    }
    impl Default for Placement {}
    impl Mesh {
        pub fn geometric_normal(&self, i: usize) -> DVec3 {}
        pub fn area(&self, i: usize) -> f64 {}
        pub fn total_area(&self) -> f64 {}
        pub fn bounds(&self) -> Option<(DVec3, DVec3)> {}
        pub fn translated(mut self, offset: DVec3) -> Mesh {}
        pub fn placed(mut self, placement: &Placement) -> Result<Mesh> {}
        pub fn extend(&mut self, other: Mesh) {}
    }
}
#[cfg(feature = "formats")]
mod mesh_file {
    pub fn load_mesh(path: &Path) -> Result<Mesh> {}
}
mod moving {
    impl Scene {
        pub fn moving(&self, frames: usize, step: f64) -> Result<Vec<Scene>> {}
    }
}
mod noise {
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub enum Dark {
        Fraction(f64),
        Counts(f64),
    }
    pub fn photon_noise(
        capture: &Capture,
        photons: f64,
        dark: Dark,
        pile_up: Option<f64>,
        seed: u64,
    ) -> Result<Capture> {}
}
mod pairs {
    #[derive(Debug, Clone, Copy, PartialEq, Default)]
    pub enum Layout {
        Confocal,
        OneLaser { point: DVec2 },
        OneSensor { point: DVec2 },
        Exhaustive { lasers: usize },
        Irregular { seed: u64 },
    }
    impl Layout {
        pub fn pair_count(self, scan: usize) -> f64 {}
        pub fn point(self) -> Option<DVec2> {}
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct Pairs {
        pub scan: [usize; 2],
        pub laser: Vec<DVec3>,
        pub sensor: Vec<DVec3>,
        pub laser_normal: Option<Vec<DVec3>>,
        pub sensor_normal: Option<Vec<DVec3>>,
    }
    impl Pairs {
        pub fn new(layout: Layout, n: usize, wall: f64, shape: WallShape) -> Pairs {}
        pub fn confocal(n: usize, wall: f64) -> Pairs {}
        pub fn one_sensor(n: usize, wall: f64, sensor: DVec3) -> Pairs {}
        pub fn is_confocal(&self) -> bool {}
        pub fn sensor_scans(&self) -> bool {}
        pub fn check(&self) -> Result<()> {}
    }
}
mod pile_up {
    pub fn pile_up(capture: &mut Capture, mean: f64) -> Result<()> {}
}
mod render {
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct RenderOptions {
        pub noise: f64,
        pub max_samples: usize,
        pub seed: u64,
    }
    impl Default for RenderOptions {}
    #[derive(Debug, Clone, PartialEq)]
    pub struct Rendering {
        pub capture: Capture,
        pub noise: f64,
        pub samples: usize,
        pub converged: bool,
    }
    pub fn simulate(scene: &Scene, options: &RenderOptions) -> Result<Rendering> {}
    pub fn render(scene: &Scene, options: &RenderOptions) -> Result<Rendering> {}
    pub fn render_pairs(
        scene: &Scene,
        pairs: &Pairs,
        options: &RenderOptions,
    ) -> Result<Rendering> {}
}
mod scene {
    #[derive(Debug, Clone, PartialEq)]
    pub struct Object {
        pub mesh: Mesh,
        pub albedo: f64,
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct Scene {
        pub name: String,
        pub objects: Vec<Object>,
        pub wall: f64,
        pub wall_shape: WallShape,
        pub scan: usize,
        pub layout: Layout,
        pub occlusion: bool,
        pub bin_width: f64,
        pub bins: Option<usize>,
        pub t_start: f64,
        pub reflectance: Reflectance,
        pub pulse: Option<Pulse>,
        pub spots: [f64; 2],
        pub pile_up: Option<f64>,
        pub photons: Option<f64>,
        pub dark: Dark,
        pub seed: u64,
    }
    impl Scene {
        pub fn new(name: impl Into<String>, objects: Vec<Object>) -> Scene {}
        pub fn set_albedo(&mut self, albedo: f64) {}
        pub fn bin_count(&self) -> usize {}
        pub fn pairs(&self) -> Pairs {}
        pub fn extent(&self) -> [f64; 4] {}
        pub fn check(&self) -> Result<()> {}
    }
}
mod shapes {
    pub fn sphere(centre: DVec3, radius: f64) -> Mesh {}
    pub fn ellipsoid(centre: DVec3, radii: DVec3) -> Mesh {}
    pub fn capsule(from: DVec3, from_radius: f64, to: DVec3, to_radius: f64) -> Mesh {}
    pub fn torus(centre: DVec3, axis: DVec3, ring: f64, tube: f64) -> Mesh {}
    pub fn rectangle(centre: DVec3, half_u: DVec3, half_v: DVec3) -> Mesh {}
}
mod truth {
    pub const DEFAULT_RESOLUTION: usize = 128;
    pub fn truth(scene: &Scene, n: usize) -> Result<Truth> {}
}
mod wall {
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum WallShape {
        Flat,
        Bump,
    }
    impl WallShape {
        pub fn point(self, x: f64, y: f64, side: f64) -> DVec3 {}
        pub fn normal(self, x: f64, y: f64, side: f64) -> Option<DVec3> {}
        pub fn front(self, side: f64) -> f64 {}
    }
}
pub use capture::Reflectance;
pub use figure::figure;
pub use letters::letter;
pub use mesh::{Mesh, Placement};
#[cfg(feature = "formats")]
pub use mesh_file::load_mesh;
pub use noise::{Dark, photon_noise};
pub use pairs::{Layout, Pairs};
pub use pile_up::pile_up;
pub use render::{RenderOptions, Rendering, render, render_pairs, simulate};
pub use scene::{Object, Scene};
pub use shapes::{capsule, ellipsoid, rectangle, sphere, torus};
pub use truth::{DEFAULT_RESOLUTION, truth};
pub use wall::WallShape;
// crates/tags/src/lib.rs

mod afterpulsing {
    #[derive(Debug, Clone, Copy, PartialEq)]
    #[non_exhaustive]
    pub struct Afterpulsing {
        pub share: f64,
        pub error: f64,
        pub pulses: u32,
    }
    impl Afterpulsing {
        pub fn text(&self, period: Option<f64>) -> String {}
    }
}
mod arrange {
    #[derive(Debug, Clone, PartialEq)]
    pub struct Scan {
        pub laser: Vec<DVec3>,
        pub sensor: Vec<DVec3>,
        pub per_line: Option<usize>,
    }
    impl Scan {
        pub fn grid(
            [columns,
            rows,
            ]: [usize; 2],
            wall: f64,
            snake: bool,
        ) -> Result<Scan> {}
        pub fn read(path: &Path) -> Result<Scan> {}
        pub fn read_galvo(path: &Path, galvo: &Galvo) -> Result<Scan> {}
        pub fn points(&self) -> usize {}
        pub fn is_confocal(&self) -> bool {}
    }
}
mod curves {
    #[derive(Debug, Clone, PartialEq)]
    pub struct Curve {
        pub tick: f64,
        pub counts: Vec<u32>,
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct Curves {
        pub curves: Vec<Curve>,
    }
    impl Curves {
        pub fn is_one(path: &Path) -> bool {}
        pub fn read(path: &Path) -> Result<Curves> {}
    }
}
mod division {
    #[derive(Debug, Clone, PartialEq)]
    pub enum Division {
        Pixels { marker: u32, frame: Option<u32> },
        Lines { start: u32, stop: Option<u32>, frame: Option<u32> },
        Pulses { each: u64, before: u64 },
        Starts(Vec<(Start, Option<Start>)>),
    }
    impl Division {
        pub fn of_image(image: &Image) -> Option<Division> {}
    }
}
mod galvo {
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Galvo {
        pub origin: DVec3,
        pub forward: DVec3,
        pub up: DVec3,
        pub scale: [f64; 2],
        pub offset: [f64; 2],
        pub between: f64,
        pub wall: [DVec3; 2],
    }
    impl Galvo {
        pub fn read(path: &Path) -> Result<Galvo> {}
        pub fn point(&self, values: [f64; 2]) -> Option<DVec3> {}
    }
}
mod growing {
    pub fn passes(
        path: &Path,
        scan: &Scan,
        asked: &Asked,
        wait: &dyn Fn() -> ControlFlow<()>,
        hear: &mut dyn FnMut(Capture) -> ControlFlow<()>,
    ) -> Result<()> {}
}
mod histogram {
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
    pub enum PileUp {
        Auto,
        On,
        Off,
    }
    #[derive(Debug, Clone, PartialEq)]
    pub struct Asked {
        pub inputs: Inputs,
        pub division: Option<Division>,
        pub channel: Option<i32>,
        pub bin_width: Option<f64>,
        pub zero: Zero,
        pub until: Option<f64>,
        pub pile_up: PileUp,
        pub turn: Turn,
        pub seen_from: Option<[DVec3; 2]>,
    }
    impl Default for Asked {}
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Dark {
        pub per_bin: f64,
        pub per_second: Option<f64>,
    }
    #[derive(Debug, Clone, PartialEq)]
    #[non_exhaustive]
    pub struct Histograms {
        pub capture: Capture,
        pub instrument: String,
        pub survey: Option<Survey>,
        pub direct: Option<Vec<f64>>,
        pub photons: u64,
        pub left_out: u64,
        pub pulses: Option<[u64; 2]>,
        pub dark: Dark,
        pub afterpulsing: Option<Afterpulsing>,
        pub shaped: bool,
        pub dropped: usize,
        pub notes: Vec<String>,
    }
    pub fn histogram(path: &Path, scan: &Scan, asked: &Asked) -> Result<Histograms> {}
}
mod starts {
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub enum Start {
        Pulse(i64),
        Seconds(f64),
    }
    pub fn starts(path: &Path) -> Result<Vec<(Start, Option<Start>)>> {}
}
mod survey {
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[private_fields]
    pub struct Channel {
        pub channel: i32,
        pub photons: u64,
        pub longest: i64,
        pub second: u64,
    }
    #[derive(Debug, Clone, Default, PartialEq)]
    #[non_exhaustive]
    pub struct Survey {
        pub channels: Vec<Channel>,
        pub markers: Vec<(i64, u16)>,
        pub out_of_order: usize,
        pub pulses: i64,
        pub period: Option<f64>,
        pub passed: Passed,
    }
    impl Survey {
        pub fn of(tags: &Tags) -> Result<Survey> {}
        pub fn channel(&self, wanted: Option<i32>) -> Result<Channel> {}
    }
}
mod zero {
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub enum Zero {
        Direct,
        At(f64),
    }
}
pub use afterpulsing::Afterpulsing;
pub use arrange::Scan;
pub use curves::{Curve, Curves};
pub use division::Division;
pub use galvo::Galvo;
pub use growing::passes;
pub use histogram::{Asked, Dark, Histograms, PileUp, histogram};
pub use starts::{Start, starts};
pub use survey::{Channel, Survey};
pub use zero::Zero;
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Record {
    Sync { time: i64 },
    Photon { channel: i32, time: i64, delay: u32 },
    Marker { bits: u16, time: i64 },
}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    Photon { channel: i32, sync: i64, delay: i64 },
    Marker { bits: u16, sync: i64 },
}
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Inputs {
    pub sync: i32,
    pub markers: Vec<i32>,
}
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Image {
    pub markers: [Option<u32>; 3],
    pub size: [Option<usize>; 2],
    pub both_ways: bool,
}
#[private_fields]
pub struct Tags {
    pub instrument: String,
    pub tick: f64,
    pub period: Option<f64>,
    pub image: Image,
}
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Passed {
    pub records: u64,
    pub unknown: u64,
    pub without_sync: u64,
    pub period: Option<f64>,
    pub notes: Vec<String>,
}
pub fn is_picoquant(path: &Path) -> bool {}
impl Tags {
    pub fn open(path: &Path, inputs: &Inputs) -> Result<Tags> {}
    pub fn records(&self, hear: impl FnMut(Record)) -> Result<Passed> {}
    pub fn events(&self, hear: impl FnMut(Event)) -> Result<Passed> {}
}
