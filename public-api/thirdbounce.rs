#[cfg(feature = "formats")]
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Written {
    pub maps: Maps,
    pub metrics: Option<Metrics>,
    pub notes: Vec<String>,
    pub verdict: crate::Verdict,
    pub warnings: Vec<String>,
    pub files: Vec<std::path::PathBuf>,
}
#[cfg(feature = "formats")]
pub fn evaluate(
    maps: &Maps,
    truth: &Truth,
    mask_fraction: Option<f64>,
) -> Result<Metrics> {}
#[cfg(feature = "formats")]
pub fn prepare(capture: Capture, settings: &Settings) -> Result<Capture> {}
#[cfg(feature = "formats")]
pub fn read(path: impl AsRef<std::path::Path>, settings: &Settings) -> Result<Capture> {}
#[cfg(feature = "formats")]
pub fn read_truth(path: impl AsRef<std::path::Path>) -> Result<Truth> {}
#[cfg(feature = "formats")]
pub fn reconstruct_file(
    gpu: &Gpu,
    capture: impl AsRef<std::path::Path>,
    settings: &Settings,
    truth: Option<&std::path::Path>,
    folder: impl AsRef<std::path::Path>,
    on_progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Written> {}
#[cfg(feature = "formats")]
pub fn write(
    folder: impl AsRef<std::path::Path>,
    maps: &Maps,
) -> Result<Vec<std::path::PathBuf>> {}
pub fn reconstruct(
    gpu: &Gpu,
    capture: &Capture,
    settings: &Settings,
) -> Result<Reconstruction> {}
pub fn reconstruct_with(
    gpu: &Gpu,
    capture: &Capture,
    settings: &Settings,
    on_progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<Reconstruction> {}
pub fn session(
    gpu: &Gpu,
    frame: &Capture,
    settings: &Settings,
    options: SessionOptions,
) -> Result<(Session, Vec<String>)> {}
pub fn session_with(
    gpu: &Gpu,
    frame: &Capture,
    settings: &Settings,
    options: SessionOptions,
    on_progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<(Session, Vec<String>)> {}
pub struct BpSettings {
    pub image: ImageSettings,
    pub lateral: Option<usize>,
}
pub struct DlctSettings {
    pub image: ImageSettings,
    pub lateral: Option<usize>,
    pub snr: Option<f64>,
}
pub struct FbpSettings {
    pub image: ImageSettings,
    pub lateral: Option<usize>,
    pub filter: Option<Filter>,
    pub filter_width: Option<f64>,
}
pub struct FkSettings {
    pub image: ImageSettings,
    pub lateral: Option<usize>,
}
pub struct LctSettings {
    pub image: ImageSettings,
    pub lateral: Option<usize>,
    pub snr: Option<f64>,
}
pub struct PhasorBpSettings {
    pub image: ImageSettings,
    pub lateral: Option<usize>,
    pub wavelength: Option<f64>,
    pub cycles: Option<f64>,
}
pub struct PhasorSettings {
    pub image: ImageSettings,
    pub lateral: Option<usize>,
    pub wavelength: Option<f64>,
    pub cycles: Option<f64>,
}
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Doing {
    Preview,
    Trial,
    Search,
    Solve,
}
#[derive(Debug, Clone)]
pub struct Progress {
    pub doing: Doing,
    pub point: TracePoint,
    pub iterations: usize,
    pub remaining: Option<f64>,
    pub maps: Option<Maps>,
}
#[derive(Debug, Clone)]
#[non_exhaustive]
#[private_fields]
pub struct Reconstruction {
    pub maps: Maps,
    pub volume: Option<VolumeMap>,
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
    pub verdict: Option<Arc<Verdict>>,
    pub trace: Vec<TracePoint>,
    pub solve_seconds: f64,
    pub is_warm: bool,
}
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
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeMap {
    pub grid: Grid,
    pub albedo: Vec<f32>,
}
pub enum Method {
    Paper(PaperSettings),
    Surface(SurfaceSettings),
    Lct(LctSettings),
    Dlct(DlctSettings),
    Fk(FkSettings),
    Phasor(PhasorSettings),
    PhasorBp(PhasorBpSettings),
    Fbp(FbpSettings),
    Bp(BpSettings),
}
impl Default for Method {}
pub struct PaperSettings {
    pub domain: DomainSettings,
    pub noise: NoiseSettings,
    pub lateral: Option<usize>,
    pub iterations: Option<usize>,
    pub seed: Option<u32>,
    pub accumulation: Option<Accumulation>,
    pub general: Option<bool>,
    pub reflectance: Option<Reflectance>,
    pub learning_rate: Option<f64>,
    pub learning_rate_decay: Option<Decay>,
    pub beta1: Option<f64>,
    pub beta2: Option<f64>,
    pub epsilon: Option<f64>,
    pub restart_every: Option<usize>,
    pub l1: Option<f64>,
    pub peak: Option<f64>,
    pub initial_albedo: Option<f64>,
    pub sampling: Option<Sampling>,
    pub binning: Option<Binning>,
    pub gradient: Option<Gradient>,
}
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Preset {
    Synthetic,
    Captured,
}
impl Preset {
    pub fn name(self) -> &'static str {}
}
#[derive(Clone)]
#[private_fields]
pub struct Canceller();
impl Canceller {
    pub fn cancel(&self) {}
}
#[derive(Clone)]
pub struct ExternalCounts {
    pub counts: ExternalBuffer,
    pub format: Format,
    pub after: Option<TimelinePoint>,
    pub taken: Option<TimelinePoint>,
}
#[derive(Clone)]
pub struct ExternalFrame {
    pub counts: ExternalCounts,
    pub maps: Option<ExternalBuffer>,
    pub done: Option<TimelinePoint>,
}
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
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Format {
    F32,
    U32,
    U16,
}
impl Format {
    pub fn bytes_of(self, counts: usize) -> u64 {}
}
#[derive(Debug, Clone)]
pub struct Frame {
    pub id: FrameId,
    pub result: Reconstruction,
    pub left: Option<Arc<Capture>>,
}
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId(pub u64);
pub type Hear = Box<dyn FnMut(FrameId, &Progress) -> ControlFlow<()> + Send>;
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
#[private_fields]
pub struct Session {}
impl Session {
    pub fn gpu(&self) -> &Gpu {}
    pub fn size(&self) -> [usize; 2] {}
    pub fn submit(&mut self, histograms: &[f32]) -> Result<FrameId> {}
    pub fn submit_part(
        &mut self,
        histograms: &[f32],
        measured: &[bool],
    ) -> Result<FrameId> {}
    pub fn submit_external(&mut self, frame: ExternalFrame) -> Result<FrameId> {}
    pub fn external_maps_bytes(&self) -> u64 {}
    pub fn subtracts(&self) -> bool {}
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
    pub moving: Option<usize>,
    pub external: bool,
}
#[derive(Clone)]
#[private_fields]
pub struct Submitter {}
impl Submitter {
    pub fn latency(&self) -> Latency {}
    pub fn submit(&self, histograms: &[f32]) -> Result<FrameId> {}
    pub fn submit_part(&self, histograms: &[f32], measured: &[bool]) -> Result<FrameId> {}
}
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Calibrate {
    None,
    Auto,
    File(PathBuf),
}
impl Calibrate {
    pub fn corrections(&self) -> Result<Vec<Correction>> {}
}
#[derive(Debug, Clone, PartialEq)]
pub enum ImpulseResponse {
    None,
    Auto,
    Gaussian { fwhm: f64, tail: Option<f64> },
    File(PathBuf),
}
impl ImpulseResponse {
    pub fn samples(&self) -> Result<Option<Pulse>> {}
}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReflectanceSetting {
    Auto,
    Known(Reflectance),
}
pub struct Settings {
    pub wall: Option<f64>,
    pub bin_width: Option<f64>,
    pub speed: Option<f64>,
    pub wall_depth_unit: Option<f64>,
    pub bounce: Option<Bounce>,
    pub tof: Option<PathBuf>,
    pub axes: Option<AxisOrder>,
    pub array: Option<String>,
    pub keep_empty: Option<bool>,
    pub flip: Option<Flip>,
    pub rotate: Option<usize>,
    pub stride: Option<usize>,
    pub subset: Option<usize>,
    pub gate: Option<Gate>,
    pub empty: Option<PathBuf>,
    pub auto_gate: Option<bool>,
    pub calibrate: Option<Calibrate>,
    pub device_at: Option<DevicePosition>,
    pub pulse: Option<ImpulseResponse>,
    pub spot: Option<[f64; 2]>,
    pub model: Option<ReflectanceSetting>,
    pub preset: Option<Preset>,
    pub seed: Option<u32>,
    pub deterministic: Option<bool>,
    pub bins: Option<Bins>,
    pub depth_pitch: Option<f64>,
    pub volume: Option<Volume>,
    pub keep_volume: Option<bool>,
    pub mask_fraction: Option<f64>,
    pub device: Option<String>,
    pub memory: Option<u64>,
    pub method: Method,
}
impl Settings {
    pub fn from_texts<'t>(
        texts: impl IntoIterator<Item = (&'t str, &'t str)> + Clone,
    ) -> Result<Settings> {}
    pub fn set(&mut self, key: &str, text: &str) -> Result<()> {}
    pub fn has(&self, key: &str) -> bool {}
    pub fn all_rows() -> Vec<(&'static Row, String)> {}
    pub fn with(mut self, change: impl FnOnce(&mut Settings)) -> Settings {}
    pub fn files(&self) -> impl Iterator<Item = &Path> {}
    pub fn with_instrument<'c>(&self, capture: &'c Capture) -> Result<Cow<'c, Capture>> {}
    pub fn for_frames<'c>(&self, scan: &'c Capture) -> Result<Cow<'c, Capture>> {}
    pub fn seed(&self) -> u32 {}
    pub fn check(&self) -> Result<()> {}
}
impl<T: Into<SolverOptions>> From<T> for Settings {}
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follow {
    pub iterations: Option<usize>,
    pub cut_above: f64,
    pub budget: Option<Duration>,
}
impl Default for Follow {}
pub struct SurfaceSettings {
    pub lateral: Option<usize>,
    pub iterations: Option<usize>,
    pub accumulation: Option<Accumulation>,
    pub general: Option<bool>,
    pub reflectance: Option<Reflectance>,
    pub min_depth: Option<f64>,
    pub begin: Option<Begin>,
    pub grow: Option<bool>,
    pub pairs: Option<usize>,
    pub points: Option<usize>,
    pub high_pass: Option<f64>,
    pub high_pass_floor: Option<f64>,
    pub sparsity: Option<f64>,
    pub background: Option<bool>,
}
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    pub n: [usize; 3],
    pub origin: DVec3,
    pub pitch: DVec3,
}
impl Grid {
    pub fn voxels(&self) -> usize {}
    pub fn contains(&self, c: [usize; 3]) -> bool {}
    pub fn index(&self, c: [usize; 3]) -> usize {}
    pub fn voxel(&self, index: usize) -> [usize; 3] {}
    pub fn position(&self, g: DVec3) -> DVec3 {}
    pub fn extent(&self) -> [f64; 4] {}
    pub fn depth_range(&self) -> [f64; 2] {}
}
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    pub min: DVec3,
    pub max: DVec3,
}
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
    Options,
}
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AdvicePart {
    Text(Cow<'static, str>),
    Change(Remedy),
    Look(Look),
}
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[private_fields]
pub struct Advice();
impl Advice {
    pub fn parts(&self) -> &[AdvicePart] {}
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
impl<const N: usize> From<[AdvicePart; N]> for Advice {}
impl From<&[AdvicePart]> for Advice {}
#[derive(Debug, Clone, thiserror::Error)]
pub struct Error {
    pub kind: Kind,
    pub what: String,
    pub hint: Advice,
}
impl Error {
    pub fn new(kind: Kind, what: impl Into<String>, hint: impl Into<Advice>) -> Self {}
    pub fn input(what: impl Into<String>, hint: impl Into<Advice>) -> Self {}
    pub fn options(what: impl Into<String>, hint: impl Into<Advice>) -> Self {}
    pub fn device(what: impl Into<String>, hint: impl Into<Advice>) -> Self {}
    pub fn memory(what: impl Into<String>, hint: impl Into<Advice>) -> Self {}
    pub fn output(what: impl Into<String>, hint: impl Into<Advice>) -> Self {}
    pub fn advised(self, hint: impl Into<Advice>) -> Self {}
    pub fn at(mut self, place: impl std::fmt::Display) -> Self {}
}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Input,
    Options,
    Device,
    Memory,
    Output,
    Cancelled,
}
pub type Result<T> = std::result::Result<T, Error>;
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[private_fields]
pub struct AxisOrder();
impl AxisOrder {
    pub fn parse(text: &str) -> Result<AxisOrder> {}
}
impl fmt::Display for AxisOrder {}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bounce {
    Nth(usize),
    All,
}
impl Bounce {
    pub fn parse(text: &str) -> Result<Bounce> {}
}
impl fmt::Display for Bounce {}
#[derive(Clone, PartialEq)]
#[non_exhaustive]
#[private_fields]
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
    pub empty: Option<Vec<f32>>,
    pub noise: Option<[f64; 2]>,
    pub integer_counts: bool,
    pub pulse: Option<Pulse>,
    pub laser_spot: Option<f64>,
    pub sensor_spot: Option<f64>,
    pub cycles: Option<f64>,
    pub direct: Option<f64>,
    pub devices: [Option<DVec3>; 2],
}
impl Capture {
    pub fn stride(&self, n: usize) -> Result<Capture> {}
    pub fn subset(&self, count: usize, seed: u64) -> Result<Capture> {}
    pub fn histogram(&self, pair: usize) -> &[f32] {}
}
impl Capture {
    pub fn set_empty(&mut self, room: &Capture) -> Result<Vec<String>> {}
}
impl Capture {
    pub fn warnings(&self) -> Vec<String> {}
}
impl std::fmt::Debug for Capture {}
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
}
impl Capture {
    pub fn check(&self) -> Result<()> {}
    pub fn check_counts(&self, histograms: &[f32]) -> Result<()> {}
    pub fn check_scan(&self) -> Result<()> {}
    pub fn t_end(&self) -> f64 {}
    pub fn mean_histogram(&self) -> Vec<f64> {}
    pub fn set_pulse(&mut self, pulse: Option<Pulse>) -> Result<()> {}
    pub fn pair_count(&self) -> usize {}
}
impl Capture {
    pub fn gains(&self, law: GainLaw) -> Option<Vec<f64>> {}
    pub fn without_gains(&self, law: GainLaw) -> Option<Capture> {}
    pub fn divide(&mut self, mut gains: Vec<f64>) {}
    pub fn apply_gains(&mut self, law: GainLaw) -> Result<()> {}
    pub fn behind(&self, law: GainLaw) -> Error {}
}
impl Capture {
    #[cfg(feature = "formats")]
    pub fn has_whole_counts(&self) -> bool {}
}
impl Capture {
    pub fn wall_extent(&self) -> [f64; 4] {}
    pub fn unit(&self) -> f64 {}
    pub fn spacing(&self) -> Option<f64> {}
    pub fn resolution(&self) -> [usize; 2] {}
    pub fn is_confocal(&self) -> bool {}
    pub fn is_nearly_confocal(&self) -> bool {}
    pub fn offset(&self) -> Option<DVec3> {}
    pub fn is_planar(&self) -> bool {}
    pub fn set_wall(&mut self, size: f64) -> Result<()> {}
    pub fn scanned_points(&self) -> &[DVec3] {}
    pub fn laser_scans(&self) -> bool {}
}
impl Capture {
    pub fn summary(&self) -> Summary {}
}
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Flip {
    X,
    Y,
    Xy,
}
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
#[non_exhaustive]
pub struct Pulse {
    pub samples: Vec<f64>,
    pub width: f64,
    pub start: f64,
}
impl Pulse {
    pub fn new(samples: Vec<f64>, width: f64, start: f64) -> Pulse {}
    pub fn gaussian(fwhm: f64) -> Result<Pulse> {}
    pub fn with_tail(&self, decay: f64) -> Result<Pulse> {}
    pub fn check(&self) -> Result<()> {}
    pub fn end(&self) -> f64 {}
    pub fn fwhm(&self) -> f64 {}
    pub fn deviation(&self) -> f64 {}
}
impl Pulse {
    pub fn read(path: &Path) -> Result<Pulse> {}
}
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
}
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
    pub wall_points_m: f64,
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
impl std::fmt::Display for Summary {}
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
#[private_fields]
pub struct ExternalBuffer {}
impl ExternalBuffer {
    pub unsafe fn new(
        buffer: vk::Buffer,
        offset: u64,
        bytes: u64,
    ) -> Result<ExternalBuffer> {}
    pub fn bytes(&self) -> u64 {}
    pub fn is_on(&self, gpu: &Gpu) -> bool {}
}
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
#[derive(Clone)]
#[private_fields]
pub struct Imported();
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
    pub fn lend(&self) -> Result<ExternalBuffer> {}
}
pub trait QueueLock: Send + Sync {
    fn lock(&self);
    fn unlock(&self);
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[private_fields]
pub struct TimelinePoint {}
impl TimelinePoint {
    pub unsafe fn new(semaphore: vk::Semaphore, value: u64) -> TimelinePoint {}
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
pub unsafe fn requirements(
    get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    instance: vk::Instance,
    api_version: u32,
    physical_device: vk::PhysicalDevice,
) -> Result<Requirements> {}
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum DeviceKind {
    Discrete,
    Virtual,
    Integrated,
    Host,
    Cpu,
    Other,
}
impl std::fmt::Display for DeviceKind {}
#[derive(Clone)]
#[private_fields]
pub struct Gpu();
impl Deref for Gpu {
    type Target = DeviceState;
}
impl Gpu {
    pub fn open(options: &GpuOptions) -> Result<Gpu> {}
    pub fn is_host(&self) -> bool {}
    pub fn is(&self, other: &Gpu) -> bool {}
    pub fn validation_messages(&self) -> Vec<String> {}
}
impl Gpu {
    pub fn wait_for(&self, moment: TimelinePoint, limit: Duration) -> Result<bool> {}
    pub fn signal(&self, moment: TimelinePoint) -> Result<()> {}
}
impl Gpu {
    pub unsafe fn of_external(vulkan: &Vulkan) -> Result<Gpu> {}
}
#[derive(Debug, Clone, Default)]
#[private_fields]
pub struct GpuOptions {
    pub device: Option<String>,
    pub validation: bool,
    pub timings: bool,
    pub pipeline_cache: Option<PathBuf>,
}
impl GpuOptions {
    pub fn vulkan() -> GpuOptions {}
}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    Device,
    Upload,
    Readback,
}
pub fn devices() -> Vec<DeviceInfo> {}
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    pub albedo: Vec<f32>,
    pub depth: Vec<f32>,
    pub normal: Vec<[f32; 3]>,
    pub mask: Vec<bool>,
    pub depth_error: Option<Vec<f32>>,
}
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
    pub depth_error: Option<Vec<f32>>,
    pub probability: Option<Vec<f32>>,
    pub behind: Option<Layer>,
}
impl Maps {
    pub const MASK_FRACTION: f64 = 0.3;
    pub fn empty([nx, ny]: [usize; 2], extent: [f64; 4]) -> Maps {}
    pub fn set_mask(&mut self, fraction: impl Into<Option<f64>>) {}
    pub fn layer(&self, layer: usize) -> Option<Maps> {}
    pub fn check(&self) -> Result<()> {}
    pub fn pixel_at(&self, x: f64, y: f64) -> Option<usize> {}
    pub fn centre(&self, ix: usize, iy: usize) -> [f64; 2] {}
}
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    pub nx: usize,
    pub ny: usize,
    pub extent: [f64; 4],
    pub depth: Vec<f32>,
    pub normal: Vec<[f32; 3]>,
    pub mask: Vec<bool>,
    pub albedo: Option<Vec<f32>>,
    pub behind: Option<Layer>,
}
impl Truth {
    pub fn check(&self) -> Result<()> {}
    pub fn centre(&self, ix: usize, iy: usize) -> [f64; 2] {}
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
    pub depth_mae_far: Option<f64>,
    pub depth_mae_nearest: Option<f64>,
    pub normal_error_deg: Option<f64>,
    pub normal_mae: Option<f64>,
    pub albedo_spread: Option<f64>,
    pub albedo_ratio_error: Option<f64>,
    pub paper: PaperMeasure,
    pub best_iou: Option<f64>,
    pub best_fraction: Option<f64>,
    pub at_best: Option<AtBest>,
    pub within_depth_error: Option<f64>,
    pub coverage: Vec<[f64; 2]>,
    pub layers: Vec<LayerMetrics>,
    pub sweep: Vec<[f64; 2]>,
}
impl Metrics {
    pub fn brief(mut self) -> Metrics {}
}
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct PaperMeasure {
    pub depth_mae: Option<f64>,
    pub depth_rmse: Option<f64>,
    pub normal_mae: Option<f64>,
    pub normal_rmse: Option<f64>,
}
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Grade {
    Good,
    Fair,
    Poor,
}
impl Grade {
    pub fn name(self) -> &'static str {}
}
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    pub grade: Grade,
    pub reasons: Vec<String>,
    pub left: Option<[f64; 2]>,
    pub expected_iou: Option<f64>,
}
impl Verdict {
    pub const GOOD: Verdict = Verdict {
        grade: Grade::Good,
        reasons: vec![],
        left: None,
        expected_iou: None,
    };
    pub fn add(&mut self, grade: Grade, reason: impl Into<String>) {}
}
impl fmt::Display for Verdict {}
