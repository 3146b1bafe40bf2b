//! Runs of a build of the command, and what their reports say.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use thirdbounce::export::npz::read_maps;
use thirdbounce::maps::{Maps, Truth};
use thirdbounce::measure::metrics;
use thirdbounce_benchmark::pages::{CPU, ESTIMATES, FILES, MEMORY, SOLVE, Values, WALL, values_of};

/// A run that takes longer fails.
const LONGEST: Duration = Duration::from_secs(1800);

/// The file of a kept run that has its seconds and memory. It is written last.
const COST: &str = "run.json";

/// A build of the command.
pub struct Build {
    /// Where it was found.
    pub program: PathBuf,
    /// The copy that is run: another build may take the place of the program meanwhile.
    copy: PathBuf,
    /// A name for its content.
    pub digest: String,
    /// Its folder of compiled kernels: no build finds those that another one compiled.
    cache: PathBuf,
    /// Options of `reconstruct` that disable unmeasured work, if supported by this build.
    quiet: Vec<&'static str>,
}

/// A run that ended well.
pub struct Run {
    pub maps: Maps,
    pub report: Value,
    /// Seconds of all CPU cores, system calls included.
    pub cpu: f64,
    /// Seconds on the clock.
    pub wall: f64,
    /// Most memory that the process held at a time, bytes.
    pub memory: f64,
    /// The kernels were compiled in a run before, whose seconds do not count.
    pub again: bool,
    /// The run was kept from an earlier comparison.
    pub reused: bool,
}

impl Build {
    /// # Errors
    /// A program that cannot be read or does not run.
    pub fn of(program: &Path, keep: &Path) -> Result<Build, String> {
        let at = |e: std::io::Error| format!("{}: {e}", program.display());
        let bytes = fs::read(program).map_err(at)?;
        let mut hash = DefaultHasher::new();
        bytes.hash(&mut hash);
        let digest = format!("{:016x}", hash.finish());
        let copy = keep.join("programs").join(&digest);
        if fs::read(&copy).ok().as_ref() != Some(&bytes) {
            fs::create_dir_all(keep.join("programs")).map_err(at)?;
            let partial = copy.with_extension(std::process::id().to_string());
            fs::write(&partial, &bytes).map_err(at)?;
            fs::set_permissions(&partial, fs::metadata(program).map_err(at)?.permissions()).map_err(at)?;
            fs::rename(&partial, &copy).map_err(at)?;
        }
        let help = Command::new(&copy).args(["reconstruct", "--help"]).output().map_err(at)?;
        if !help.status.success() {
            return Err(format!("{}: has no command reconstruct", program.display()));
        }
        let text = String::from_utf8_lossy(&help.stdout).into_owned();
        let quiet = ["--no-preview", "--quiet"].into_iter().filter(|option| text.contains(option)).collect();
        let cache = keep.join("kernels").join(&digest);
        Ok(Build { program: program.into(), copy, digest, cache, quiet })
    }

    /// Reconstructs a capture. A run that compiles kernels is repeated: its seconds are not those of the next ones.
    ///
    /// # Errors
    /// The first line that a run that fails says.
    pub fn reconstruct(&self, capture: &Path, out: &Path, options: &[String]) -> Result<Run, String> {
        let compiled = kernels(&self.cache);
        let run = self.once(capture, out, options)?;
        if kernels(&self.cache) == compiled {
            return Ok(run);
        }
        self.once(capture, out, options).map(|run| Run { again: true, ..run })
    }

    fn once(&self, capture: &Path, out: &Path, options: &[String]) -> Result<Run, String> {
        let io = |e: std::io::Error| format!("{}: {e}", out.display());
        if out.exists() {
            fs::remove_dir_all(out).map_err(io)?;
        }
        fs::create_dir_all(out.parent().unwrap_or(out)).map_err(io)?;
        fs::create_dir_all(&self.cache).map_err(io)?;
        let said = out.with_extension("stderr");
        let errors = fs::File::create(&said).map_err(io)?;
        let (before, start) = (cpu_of_children(), Instant::now());
        let mut command = Command::new(&self.copy);
        command.arg("reconstruct").arg(capture).arg("--out").arg(out).args(&self.quiet).args(options);
        command.env("XDG_CACHE_HOME", &self.cache).env_remove("MESA_SHADER_CACHE_DIR");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(errors);
        let mut child = command.spawn().map_err(|e| format!("{}: {e}", self.program.display()))?;
        let (mut memory, process) = (f64::NAN, format!("/proc/{}/status", child.id()));
        let status = loop {
            memory = memory.max(peak_memory(&process));
            match child.try_wait().map_err(io)? {
                Some(status) => break status,
                None if start.elapsed() > LONGEST => {
                    let _ = child.kill();
                    let _ = child.wait();
                    return Err(format!("ran longer than {} s", LONGEST.as_secs()));
                }
                None => std::thread::sleep(Duration::from_millis(5)),
            }
        };
        let (wall, cpu) = (start.elapsed().as_secs_f64(), cpu_of_children() - before);
        if !status.success() {
            let text = fs::read_to_string(&said).unwrap_or_default();
            let line = text.lines().find(|l| l.contains("error:")).or(text.lines().next());
            return Err(line.map_or(status.to_string(), |line| line.trim_start_matches("error: ").into()));
        }
        Run::read(out).map(|run| Run { cpu, wall, memory, ..run })
    }
}

/// Most memory that a process held so far, bytes; NaN where the system does not tell.
fn peak_memory(status: &str) -> f64 {
    let text = fs::read_to_string(status).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kibibytes = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok());
    kibibytes.map_or(f64::NAN, |k| 1024.0 * k)
}

/// Sizes and names of the files in a folder of compiled kernels.
fn kernels(folder: &Path) -> Vec<(PathBuf, u64)> {
    let mut all = vec![];
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        match entry.metadata() {
            Ok(data) if data.is_dir() => all.extend(kernels(&entry.path())),
            Ok(data) => all.push((entry.path(), data.len())),
            Err(_) => {}
        }
    }
    all.sort();
    all
}

/// Seconds of all CPU cores of the programs that this one started and that ended; NaN where the system does not tell.
fn cpu_of_children() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit_once(") ").map_or(vec![], |s| s.1.split(' ').collect());
    let ticks = |field: usize| fields.get(field).and_then(|ticks| ticks.parse::<f64>().ok());
    ticks(13).zip(ticks(14)).map_or(f64::NAN, |(user, system)| (user + system) / 100.0)
}

/// The first number among these keys.
fn number(report: &Value, keys: &[&str]) -> f64 {
    keys.iter().find_map(|key| report.pointer(key)?.as_f64()).unwrap_or(f64::NAN)
}

impl Run {
    /// The result in a folder.
    ///
    /// # Errors
    /// Maps or report that are not there or cannot be read.
    pub fn read(folder: &Path) -> Result<Run, String> {
        let file = folder.join("report.json");
        let bytes = fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        let report = serde_json::from_slice(&bytes).map_err(|e| format!("{}: {e}", file.display()))?;
        let maps = read_maps(&folder.join("maps.npz")).map_err(|e| e.to_string())?;
        let nan = f64::NAN;
        Ok(Run { maps, report, cpu: nan, wall: nan, memory: nan, again: false, reused: false })
    }

    /// Keeps the result that is in the folder `out`.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn keep(&self, out: &Path, folder: &Path) -> Result<(), String> {
        let io = |e: std::io::Error| format!("{}: {e}", folder.display());
        fs::create_dir_all(folder).map_err(io)?;
        for name in ["maps.npz", "report.json"] {
            fs::copy(out.join(name), folder.join(name)).map_err(io)?;
        }
        let cost = json!({ "cpu": self.cpu, "wall": self.wall, "memory": self.memory, "again": self.again });
        fs::write(folder.join(COST), cost.to_string()).map_err(io)
    }

    /// A result that was kept in a folder. `None` without one.
    pub fn kept(folder: &Path) -> Option<Run> {
        let cost: Value = serde_json::from_slice(&fs::read(folder.join(COST)).ok()?).ok()?;
        let [cpu, wall, memory] = ["/cpu", "/wall", "/memory"].map(|key| number(&cost, &[key]));
        let again = cost["again"] == true;
        Some(Run { cpu, wall, memory, again, reused: true, ..Run::read(folder).ok()? })
    }

    /// The reflectance model in use.
    pub fn model(&self) -> Option<String> {
        self.report["settings"]["model"].as_str().map(String::from)
    }

    /// Metrics against a truth, and costs.
    ///
    /// # Errors
    /// Maps that cannot be measured.
    pub fn values(&self, truth: &Truth, wall: f64) -> Result<Values, String> {
        let mut values = values_of(&metrics(&self.maps, truth, None).map_err(|e| e.to_string())?, wall);
        values[CPU] = self.cpu;
        values[WALL] = self.wall;
        values[ESTIMATES] = number(&self.report, &["/settings/trials_s"]);
        values[SOLVE] = number(&self.report, &["/totals/solve_s"]);
        values[MEMORY] = 1e-6 * self.memory;
        values[FILES] =
            number(&self.report, &["/totals/load_s"]) + number(&self.report, &["/totals/export_s"]);
        Ok(values)
    }
}
