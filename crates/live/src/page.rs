//! A page with the newest maps, the totals and the last error, for a browser.
//!
//! It answers GET for five paths and nothing else, so it is written here in a hundred lines instead of taking a server crate
//! with its four dependencies. Limits: a request of 4 KiB within two seconds, 16 connections at once, and a Host that names
//! the loopback (elsewhere: an IP address), so that no page of another site can read it through a name of its own (DNS
//! rebinding).

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::motion::MotionShown;
use thirdbounce::export::picture::Picture;
use thirdbounce::export::png;
use thirdbounce::maps::Maps;
use thirdbounce::session::{Frame, Latency};
use thirdbounce::{Error, Result};

const MOST_BYTES: usize = 4096;
const MOST_CONNECTIONS: usize = 16;
const PATIENCE: Duration = Duration::from_secs(2);
/// Time between two attempts to accept a connection while the system has no descriptor left.
const AGAIN: Duration = Duration::from_millis(100);

const HTML: &str = include_str!("page.html");

/// Results whose intervals give the expected interval.
const LAST: usize = 17;
/// Number of expected intervals without a result after which the page is stale.
const STALE: u32 = 3;

/// What a page shows, besides results.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shows {
    /// Depths of the first and the last colour, metres; `None`: those of the reconstructed box.
    pub depths: Option<[f64; 2]>,
    /// Expected interval between results; `None`: the median of the last ones.
    pub interval: Option<Duration>,
}

/// Totals of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LiveTotals {
    /// Times of the last frames, and the numbers of solved and dropped ones.
    pub latency: Latency,
    /// Frames that arrived, whole or not: solved, replaced, failed, or not solved at the end.
    pub arrived: u64,
    pub solved: u64,
    /// Frames that newer ones replaced, or were added to, before they were solved.
    pub replaced: u64,
    /// Frames that could not be read, streams that broke off, and solves that failed.
    pub failed: u64,
    /// Frames of the folder that were left out, as they were there at the start.
    pub skipped: u64,
    /// Names of files of the folder that are no frames.
    pub others: Vec<String>,
}

/// A page that is served. It ends with the program.
pub struct LivePage {
    address: SocketAddr,
    state: Arc<Mutex<PageState>>,
}

/// One of the open connections; released when dropped.
struct Slot(Arc<AtomicUsize>);

impl Slot {
    fn of(open: &Arc<AtomicUsize>) -> Slot {
        open.fetch_add(1, Relaxed);
        Slot(open.clone())
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Relaxed);
    }
}

struct PageState {
    shows: Shows,
    /// Depths of the box.
    depths: [f64; 2],
    begun: Instant,
    newest: Option<(String, Arc<Frame>)>,
    /// What moves, where the room is subtracted.
    motion: Option<MotionShown>,
    /// Times of the last results.
    results: VecDeque<Instant>,
    totals: LiveTotals,
    failure: Option<(Option<String>, String, Instant)>,
}

/// Content of `status.json`. Times are in milliseconds, lengths in metres.
#[derive(Serialize)]
struct PageStatus {
    /// `waiting` for a first frame, `live`, or `stale`: no result for three expected intervals.
    state: &'static str,
    arrived: u64,
    solved: u64,
    failed: u64,
    dropped: u64,
    /// Time since the last result, or since the start.
    age_ms: f64,
    /// Expected interval between results.
    interval_ms: Option<f64>,
    depths: [f64; 2],
    last_error: Option<Failure>,
    frame: Option<Newest>,
    motion: Option<MotionShown>,
}

#[derive(Serialize)]
struct Failure {
    frame: Option<String>,
    what: String,
    age_ms: f64,
}

#[derive(Serialize)]
struct Newest {
    name: String,
    number: u64,
    #[serde(flatten)]
    figures: Figures,
    last_ms: f64,
    median_ms: f64,
    p90_ms: f64,
    p99_ms: f64,
    frames_per_second: f64,
}

/// Key figures of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figures {
    /// Whether it began with the surface of the frame before.
    pub warm: bool,
    /// Iterations of the fit.
    pub iterations: usize,
    /// Milliseconds of the solve.
    pub solve_ms: f64,
    /// The verdict: good, fair or poor.
    pub verdict: Option<&'static str>,
    /// Share of the light that the maps do not explain: ‖Av − h‖ / ‖h‖. `None` for closed forms.
    pub residual: Option<f64>,
    /// Pixels of surface.
    pub pixels: usize,
    /// Median depth of the surface, metres.
    pub depth: Option<f32>,
    /// Median of its expected error, metres.
    pub depth_error: Option<f32>,
}

impl Figures {
    /// Those of a solved frame.
    pub fn of(frame: &Frame) -> Figures {
        let (result, maps) = (&frame.result, &frame.result.maps);
        let last = result.trace.last();
        Figures {
            warm: result.is_warm,
            iterations: last.map_or(0, |p| p.iteration),
            solve_ms: 1e3 * result.solve_seconds,
            verdict: result.verdict.as_ref().map(|verdict| verdict.grade.name()),
            residual: last.and_then(|p| result.residual(p.data_loss)).filter(|r| r.is_finite()),
            pixels: maps.surface_pixels(),
            depth: maps.median(&maps.depth),
            depth_error: maps.depth_error.as_deref().and_then(|values| maps.median(values)),
        }
    }
}

impl LivePage {
    /// Serves the page; port 0 is a free one.
    ///
    /// # Errors
    /// The address is not of this machine, the port is taken, or no thread starts.
    pub fn serve(address: SocketAddr, shows: Shows) -> Result<LivePage> {
        let failed = |e: std::io::Error| {
            Error::options(
                format!("the page cannot be served on {address}: {e}"),
                "give an address of this machine and another port, or port 0 for a free one",
            )
        };
        let listener = TcpListener::bind(address).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let state = Arc::new(Mutex::new(PageState {
            shows,
            depths: [0.0, 1.0],
            begun: Instant::now(),
            newest: None,
            motion: None,
            results: VecDeque::new(),
            totals: LiveTotals::default(),
            failure: None,
        }));
        let (shown, open) = (state.clone(), Arc::new(AtomicUsize::new(0)));
        super::stream::begin(move || {
            for stream in listener.incoming() {
                let Ok(stream) = stream else {
                    std::thread::sleep(AGAIN);
                    continue;
                };
                let slot = Slot::of(&open);
                if open.load(Relaxed) > MOST_CONNECTIONS {
                    continue;
                }
                let shown = shown.clone();
                let answer = move || {
                    let _slot = slot;
                    // A browser that goes away is no error.
                    let _ = answer(stream, address, &shown);
                };
                // Without a thread the connection closes.
                let _ = std::thread::Builder::new().name("thirdbounce page".into()).spawn(answer);
            }
        })?;
        Ok(LivePage { address, state })
    }

    /// Its address.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Frames come from now on. `depths` are those of the reconstructed box.
    pub(super) fn begin(&self, depths: [f64; 2]) {
        let mut state = locked(&self.state);
        (state.depths, state.begun) = (depths, Instant::now());
    }

    /// Shows a frame from now on, and what moves in it.
    pub(super) fn show(&self, name: &str, frame: Arc<Frame>, motion: Option<MotionShown>) {
        let mut state = locked(&self.state);
        (state.newest, state.motion) = (Some((name.into(), frame)), motion);
        state.results.push_back(Instant::now());
        if state.results.len() > LAST {
            state.results.pop_front();
        }
    }

    /// Shows an error.
    pub(super) fn fail(&self, name: Option<&str>, error: &Error) {
        let failure = (name.map(String::from), error.what.clone(), Instant::now());
        locked(&self.state).failure = Some(failure);
    }

    /// Shows these totals.
    pub(super) fn count(&self, totals: &LiveTotals) {
        locked(&self.state).totals = totals.clone();
    }
}

fn locked(state: &Mutex<PageState>) -> MutexGuard<'_, PageState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

fn answer(mut stream: TcpStream, address: SocketAddr, state: &Mutex<PageState>) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let Some(request) = request_of(&mut stream)? else { return Ok(()) };
    let (code, kind, body) = answered(&request, address, state);
    let head = format!(
        "HTTP/1.1 {code}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nContent-Security-Policy: default-src 'self' 'unsafe-inline'\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n\
         Referrer-Policy: no-referrer\r\n\
         Connection: close\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(&body)
}

/// The head of a request; `None` if it is too long, too late, or none.
fn request_of(stream: &mut TcpStream) -> std::io::Result<Option<String>> {
    let (begun, mut all) = (Instant::now(), vec![]);
    let mut bytes = [0; 512];
    while !all.windows(4).any(|w| w == b"\r\n\r\n") {
        let got = stream.read(&mut bytes)?;
        all.extend_from_slice(&bytes[..got]);
        if got == 0 || all.len() > MOST_BYTES || begun.elapsed() > PATIENCE {
            return Ok(None);
        }
    }
    Ok(String::from_utf8(all).ok())
}

type Answer = (&'static str, &'static str, Vec<u8>);

/// The answer to a request: status, type and content.
fn answered(request: &str, address: SocketAddr, state: &Mutex<PageState>) -> Answer {
    let mut lines = request.lines();
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (method, path) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let host = lines.find_map(|l| l.split_once(':').filter(|(name, _)| name.eq_ignore_ascii_case("host")));
    if !host.is_some_and(|(_, name)| is_own(name.trim(), address)) {
        return (
            "403 Forbidden",
            "text/plain",
            b"not a name of this page: open it by localhost or an IP address".to_vec(),
        );
    }
    if method != "GET" {
        return ("405 Method Not Allowed", "text/plain", b"only GET".to_vec());
    }
    let (frame, status) = {
        let state = locked(state);
        (state.newest.as_ref().map(|(_, frame)| frame.clone()), state.status())
    };
    let depths = status.depths;
    let picture = |of: &dyn Fn(&Maps) -> Picture| match &frame {
        None => ("404 Not Found", "text/plain", b"no frame yet".to_vec()),
        Some(frame) => match png::packed(&of(&frame.result.maps)) {
            Ok(bytes) => ("200 OK", "image/png", bytes),
            Err(error) => ("500 Internal Server Error", "text/plain", error.what.into_bytes()),
        },
    };
    match path.split('?').next().unwrap_or_default() {
        "/" => ("200 OK", "text/html; charset=utf-8", HTML.as_bytes().to_vec()),
        "/albedo.png" => picture(&|maps| png::with_axes(&png::albedo_of(maps), maps)),
        "/depth.png" => picture(&|maps| png::depth_between(maps, depths)),
        "/normal.png" => picture(&|maps| png::with_axes(&png::normal_of(maps), maps)),
        "/status.json" => ("200 OK", "application/json", serde_json::to_vec(&status).unwrap_or_default()),
        _ => ("404 Not Found", "text/plain", b"nothing here".to_vec()),
    }
}

/// Whether a Host names the page: the loopback with any port, as a tunnel may have another, or an IP address where it is served
/// on one.
fn is_own(host: &str, address: SocketAddr) -> bool {
    let name = host.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_ok()).map_or(host, |(n, _)| n);
    let ip = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    name == "localhost" || ip.is_ok_and(|ip| ip.is_loopback() || !address.ip().is_loopback())
}

impl PageState {
    /// Expected interval between results.
    fn interval(&self) -> Option<Duration> {
        let mut between: Vec<Duration> =
            self.results.iter().zip(self.results.iter().skip(1)).map(|(a, b)| *b - *a).collect();
        between.sort();
        self.shows.interval.or_else(|| between.get(between.len() / 2).copied())
    }

    fn status(&self) -> PageStatus {
        let ms = |time: Duration| 1e3 * time.as_secs_f64();
        let (interval, latency) = (self.interval(), self.totals.latency);
        let age = self.results.back().unwrap_or(&self.begun).elapsed();
        let newest = |(name, frame): &(String, Arc<Frame>)| Newest {
            name: name.clone(),
            number: frame.id.0,
            figures: Figures::of(frame),
            last_ms: ms(latency.last),
            median_ms: ms(latency.median),
            p90_ms: ms(latency.p90),
            p99_ms: ms(latency.p99),
            frames_per_second: latency.frames_per_second,
        };
        let failure = |(frame, what, since): &(Option<String>, String, Instant)| Failure {
            frame: frame.clone(),
            what: what.clone(),
            age_ms: ms(since.elapsed()),
        };
        PageStatus {
            state: match (interval.is_some_and(|interval| age > STALE * interval), &self.newest) {
                (true, _) => "stale",
                (false, None) => "waiting",
                (false, Some(_)) => "live",
            },
            arrived: self.totals.arrived,
            solved: latency.frames,
            failed: self.totals.failed,
            dropped: latency.dropped,
            age_ms: ms(age),
            interval_ms: interval.map(ms),
            depths: self.shows.depths.unwrap_or(self.depths),
            last_error: self.failure.as_ref().map(failure),
            frame: self.newest.as_ref().map(newest),
            motion: self.motion.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(page: &LivePage, request: &str) -> String {
        let mut stream = TcpStream::connect(page.address()).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = vec![];
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    #[test]
    fn it_answers_its_own_machine_and_nothing_else() {
        let page = LivePage::serve(([127, 0, 0, 1], 0).into(), Shows::default()).unwrap();
        let host = format!("Host: {}\r\n\r\n", page.address());
        let begins = |request: &str, with: &str| {
            let answer = asked(&page, request);
            assert!(answer.starts_with(with), "{request:?}: {answer}");
            answer
        };
        assert!(begins(&format!("GET / HTTP/1.1\r\n{host}"), "HTTP/1.1 200").contains("<html"));
        assert!(
            begins(&format!("GET /status.json HTTP/1.1\r\n{host}"), "HTTP/1.1 200").contains("\"waiting\"")
        );
        begins(&format!("GET /albedo.png?3 HTTP/1.1\r\n{host}"), "HTTP/1.1 404");
        begins(&format!("GET /../etc/passwd HTTP/1.1\r\n{host}"), "HTTP/1.1 404");
        begins(&format!("POST / HTTP/1.1\r\n{host}"), "HTTP/1.1 405");
        begins("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", "HTTP/1.1 403");
        begins("GET / HTTP/1.1\r\n\r\n", "HTTP/1.1 403");
        // A tunnel with another port.
        begins("GET / HTTP/1.1\r\nHost: localhost:9\r\n\r\n", "HTTP/1.1 200");
        begins("GET / HTTP/1.1\r\nHost: 192.168.1.7\r\n\r\n", "HTTP/1.1 403");
        assert!(is_own("192.168.1.7:80", ([0, 0, 0, 0], 80).into()));
        assert!(!is_own("evil.example:80", ([0, 0, 0, 0], 80).into()));
        // A request without end is closed, and the page lives on.
        assert_eq!(asked(&page, &"x".repeat(2 * MOST_BYTES)), "");
        begins(&format!("GET / HTTP/1.1\r\n{host}"), "HTTP/1.1 200");
    }

    #[test]
    fn a_page_is_stale_after_three_expected_intervals() {
        let second = Duration::from_secs(1);
        let shows = Shows { interval: Some(second), ..Shows::default() };
        let page = LivePage::serve(([127, 0, 0, 1], 0).into(), shows).unwrap();
        let state = || locked(&page.state).status().state;
        assert_eq!(state(), "waiting");
        locked(&page.state).begun -= 4 * second;
        assert_eq!(state(), "stale", "nothing came");
        // Results every two seconds, the last one five or seven seconds ago; nothing states an interval.
        for (age, is_stale) in [(5, false), (7, true)] {
            let now = Instant::now();
            let mut state = locked(&page.state);
            state.shows.interval = None;
            state.results = (0..4).rev().map(|i| now - (age + 2 * i) * second).collect();
            assert_eq!(state.status().state == "stale", is_stale, "{age}");
        }
    }
}
