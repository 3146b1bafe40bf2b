#[derive(Clone, Default)]
#[private_fields]
pub struct Options {}
impl Options {
    pub fn method(mut self, name: &str) -> Options {}
    pub fn model(mut self, name: &str) -> Options {}
    pub fn set(mut self, name: &'static str, value: impl Into<OptionValue>) -> Options {}
    pub fn volume(mut self, volume: Volume) -> Options {}
    pub fn memory(mut self, bytes: u64) -> Options {}
    pub fn mask_fraction(mut self, share: f64) -> Options {}
    pub fn with_volume(mut self) -> Options {}
    pub fn watch(
        mut self,
        hear: impl FnMut(&Progress) -> ControlFlow<()> + Send + 'static,
    ) -> Options {}
    pub fn session(
        &self,
        gpu: &Gpu,
        frame: &Capture,
        options: SessionOptions,
    ) -> Result<Session> {}
}
impl fmt::Debug for Options {}
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Solved {
    pub maps: Maps,
    pub volume: Option<VolumeMap>,
    pub notes: Vec<String>,
    pub trace: Vec<TracePoint>,
    pub seconds: f64,
}
pub fn reconstruct(gpu: &Gpu, capture: &Capture, options: &Options) -> Result<Solved> {}
#[cfg(feature = "formats")]
pub fn prepare(capture: Capture) -> Result<Capture> {}
#[cfg(feature = "formats")]
pub fn read(path: impl AsRef<std::path::Path>) -> Result<Capture> {}
#[cfg(feature = "formats")]
pub fn write(
    folder: impl AsRef<std::path::Path>,
    maps: &Maps,
) -> Result<Vec<std::path::PathBuf>> {}
#[derive(Clone)]
#[private_fields]
pub struct Canceller();
impl Canceller {
    pub fn cancel(&self) {}
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
#[derive(Clone)]
pub struct LentCounts {
    pub counts: Lent,
    pub format: Format,
    pub after: Option<Moment>,
    pub taken: Option<Moment>,
}
#[derive(Clone)]
pub struct LentFrame {
    pub counts: LentCounts,
    pub maps: Option<Lent>,
    pub done: Option<Moment>,
}
#[private_fields]
pub struct Session {}
impl Session {
    pub fn lent_maps_bytes(&self) -> u64 {}
}
impl Session {
    pub fn gpu(&self) -> &Gpu {}
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
#[derive(Clone)]
#[private_fields]
pub struct Submitter {}
impl Submitter {
    pub fn latency(&self) -> Latency {}
    pub fn submit(&self, histograms: &[f32]) -> Result<FrameId> {}
    pub fn submit_part(&self, histograms: &[f32], measured: &[bool]) -> Result<FrameId> {}
}
#[derive(Debug, Clone, PartialEq)]
pub enum OptionValue {
    Count(usize),
    Number(f64),
    Flag(bool),
    Word(String),
    Unset,
}
impl From<usize> for OptionValue {}
impl From<f64> for OptionValue {}
impl From<bool> for OptionValue {}
impl From<&str> for OptionValue {}
impl fmt::Display for OptionValue {}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Doing {
    Preview,
    Trial,
    Solve,
}
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Follow {
    pub iterations: Option<usize>,
    pub cut_above: f64,
    pub budget: Option<Duration>,
}
impl Default for Follow {}
#[derive(Debug, Clone)]
pub struct Progress {
    pub doing: Doing,
    pub point: TracePoint,
    pub iterations: usize,
    pub remaining: Option<f64>,
    pub maps: Option<Maps>,
}
#[derive(Debug, Clone)]
#[private_fields]
pub struct Reconstruction {
    pub maps: Maps,
    pub volume: Option<VolumeMap>,
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
    pub mend: Advice,
}
impl Error {
    pub fn new(kind: Kind, what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
    pub fn input(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
    pub fn options(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
    pub fn device(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
    pub fn memory(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
    pub fn output(what: impl Into<String>, mend: impl Into<Advice>) -> Self {}
    pub fn advised(self, mend: impl Into<Advice>) -> Self {}
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
    pub fn check(&self) -> Result<()> {}
    pub fn check_counts(&self, histograms: &[f32]) -> Result<()> {}
    pub fn check_scan(&self) -> Result<()> {}
    pub fn t_end(&self) -> f64 {}
    pub fn mean_histogram(&self) -> Vec<f64> {}
    pub fn pair_count(&self) -> usize {}
}
impl Capture {
    pub fn stride(&self, n: usize) -> Result<Capture> {}
    pub fn subset(&self, count: usize, seed: u64) -> Result<Capture> {}
    pub fn histogram(&self, pair: usize) -> &[f32] {}
}
impl Capture {
    pub fn doubts(&self) -> Vec<String> {}
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
    pub fn is_planar(&self) -> bool {}
    pub fn set_wall(&mut self, size: f64) -> Result<()> {}
    pub fn scanned_points(&self) -> &[DVec3] {}
    pub fn laser_scans(&self) -> bool {}
}
impl Capture {
    pub fn summary(&self) -> Summary {}
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
    pub fn read(path: &Path) -> Result<Pulse> {}
}
impl Pulse {
    pub fn new(samples: Vec<f64>, width: f64, start: f64) -> Pulse {}
    pub fn gaussian(fwhm: f64) -> Result<Pulse> {}
    pub fn with_tail(&self, decay: f64) -> Result<Pulse> {}
    pub fn check(&self) -> Result<()> {}
    pub fn end(&self) -> f64 {}
    pub fn fwhm(&self) -> f64 {}
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
    pub fn lend(&self) -> Result<Lent> {}
}
#[derive(Clone)]
#[private_fields]
pub struct Lent {}
impl Lent {
    pub unsafe fn new(buffer: vk::Buffer, offset: u64, bytes: u64) -> Result<Lent> {}
    pub fn bytes(&self) -> u64 {}
    pub fn is_on(&self, gpu: &Gpu) -> bool {}
}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[private_fields]
pub struct Moment {}
impl Moment {
    pub unsafe fn new(semaphore: vk::Semaphore, value: u64) -> Moment {}
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
    Cpu,
    Other,
}
impl std::fmt::Display for DeviceKind {}
#[derive(Clone)]
#[private_fields]
pub struct Gpu();
impl Gpu {
    pub fn wait_for(&self, moment: Moment, limit: Duration) -> Result<bool> {}
    pub fn signal(&self, moment: Moment) -> Result<()> {}
}
impl Gpu {
    pub unsafe fn of_caller(vulkan: &Vulkan) -> Result<Gpu> {}
}
impl Deref for Gpu {
    type Target = Opened;
}
impl Gpu {
    pub fn open(options: &GpuOptions) -> Result<Gpu> {}
    pub fn is(&self, other: &Gpu) -> bool {}
    pub fn validation_messages(&self) -> Vec<String> {}
}
#[derive(Debug, Clone, Default)]
#[private_fields]
pub struct GpuOptions {
    pub device: Option<String>,
    pub validation: bool,
    pub timings: bool,
    pub pipeline_cache: Option<PathBuf>,
}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    Device,
    Upload,
    Readback,
    Store,
}
pub fn devices() -> Result<Vec<DeviceInfo>> {}
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    pub albedo: Vec<f32>,
    pub depth: Vec<f32>,
    pub normal: Vec<[f32; 3]>,
    pub mask: Vec<bool>,
    pub confidence: Option<Vec<f32>>,
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
    pub confidence: Option<Vec<f32>>,
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
