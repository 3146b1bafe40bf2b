//! A page on the loopback with the newest maps, for a browser on the same machine.
//!
//! It answers GET for five paths and nothing else, so it is written here in a hundred lines instead of taking a server crate
//! with its four dependencies. Limits: a request of 4 KiB within two seconds, 16 connections at once, and a Host that names
//! the loopback, so that no page of another site can read it through a name of its own (DNS rebinding).

use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::export::png;
use crate::maps::Maps;
use crate::session::{Frame, Latency};
use crate::{Error, Result};

const MOST_BYTES: usize = 4096;
const MOST_CONNECTIONS: usize = 16;
const PATIENCE: Duration = Duration::from_secs(2);
/// Time between two attempts to accept a connection while the system has no descriptor left.
const AGAIN: Duration = Duration::from_millis(100);

const HTML: &str = include_str!("page.html");

/// A page that is served. It goes with the program.
pub struct Page {
    address: SocketAddr,
    newest: Arc<Mutex<Option<Shown>>>,
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

struct Shown {
    frame: Arc<Frame>,
    latency: Latency,
    since: Instant,
}

/// What `status.json` tells. Times are in milliseconds.
#[derive(Serialize)]
struct Status {
    frame: u64,
    warm: bool,
    iterations: usize,
    solve_ms: f64,
    last_ms: f64,
    median_ms: f64,
    p90_ms: f64,
    p99_ms: f64,
    frames_per_second: f64,
    frames: u64,
    dropped: u64,
    age_ms: f64,
}

impl Page {
    /// Serves the page on a port of the loopback; 0: a free one.
    ///
    /// # Errors
    /// The port is taken, or no thread starts.
    pub fn serve(port: u16) -> Result<Page> {
        let failed = |e: std::io::Error| {
            Error::options(
                format!("the page cannot be served on port {port}: {e}"),
                "give another port, or 0 for a free one",
            )
        };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let newest: Arc<Mutex<Option<Shown>>> = Arc::default();
        let (shown, open) = (newest.clone(), Arc::new(AtomicUsize::new(0)));
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
        Ok(Page { address, newest })
    }

    /// Where it is.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Shows a frame from now on.
    pub(super) fn show(&self, frame: Arc<Frame>, latency: Latency) {
        let shown = Shown { frame, latency, since: Instant::now() };
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(shown);
    }
}

fn answer(mut stream: TcpStream, address: SocketAddr, newest: &Mutex<Option<Shown>>) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let Some(request) = request_of(&mut stream)? else { return Ok(()) };
    let (code, kind, body) = answered(&request, address, newest);
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
fn answered(request: &str, address: SocketAddr, newest: &Mutex<Option<Shown>>) -> Answer {
    let mut lines = request.lines();
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (method, path) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let host = lines.find_map(|l| l.split_once(':').filter(|(name, _)| name.eq_ignore_ascii_case("host")));
    let port = address.port();
    let own = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    if !host.is_some_and(|(_, name)| own.iter().any(|own| own == name.trim())) {
        return ("403 Forbidden", "text/plain", b"only for this machine".to_vec());
    }
    if method != "GET" {
        return ("405 Method Not Allowed", "text/plain", b"only GET".to_vec());
    }
    let (frame, status) = {
        let newest = newest.lock().unwrap_or_else(PoisonError::into_inner);
        (newest.as_ref().map(|s| s.frame.clone()), newest.as_ref().map(Status::of))
    };
    let picture = |of: fn(&Maps) -> crate::export::picture::Picture| match &frame {
        None => ("404 Not Found", "text/plain", b"no frame yet".to_vec()),
        Some(frame) => match png::packed(&of(&frame.result.maps)) {
            Ok(bytes) => ("200 OK", "image/png", bytes),
            Err(error) => ("500 Internal Server Error", "text/plain", error.what.into_bytes()),
        },
    };
    match path.split('?').next().unwrap_or_default() {
        "/" => ("200 OK", "text/html; charset=utf-8", HTML.as_bytes().to_vec()),
        "/albedo.png" => picture(png::albedo_of),
        "/depth.png" => picture(png::depth_of),
        "/normal.png" => picture(png::normal_of),
        "/status.json" => ("200 OK", "application/json", serde_json::to_vec(&status).unwrap_or_default()),
        _ => ("404 Not Found", "text/plain", b"nothing here".to_vec()),
    }
}

impl Status {
    fn of(shown: &Shown) -> Status {
        let (result, reported) = (&shown.frame.result, &shown.latency);
        let ms = |time: Duration| 1e3 * time.as_secs_f64();
        Status {
            frame: shown.frame.id.0,
            warm: result.is_warm,
            iterations: result.trace.last().map_or(0, |p| p.iteration),
            solve_ms: 1e3 * result.solve_seconds,
            last_ms: ms(reported.last),
            median_ms: ms(reported.median),
            p90_ms: ms(reported.p90),
            p99_ms: ms(reported.p99),
            frames_per_second: reported.frames_per_second,
            frames: reported.frames,
            dropped: reported.dropped,
            age_ms: ms(shown.since.elapsed()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(page: &Page, request: &str) -> String {
        let mut stream = TcpStream::connect(page.address()).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = vec![];
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    #[test]
    fn it_answers_its_own_machine_and_nothing_else() {
        let page = Page::serve(0).unwrap();
        let host = format!("Host: {}\r\n\r\n", page.address());
        let begins = |request: &str, with: &str| {
            let answer = asked(&page, request);
            assert!(answer.starts_with(with), "{request:?}: {answer}");
            answer
        };
        assert!(begins(&format!("GET / HTTP/1.1\r\n{host}"), "HTTP/1.1 200").contains("<html"));
        assert!(begins(&format!("GET /status.json HTTP/1.1\r\n{host}"), "HTTP/1.1 200").ends_with("null"));
        begins(&format!("GET /albedo.png?3 HTTP/1.1\r\n{host}"), "HTTP/1.1 404");
        begins(&format!("GET /../etc/passwd HTTP/1.1\r\n{host}"), "HTTP/1.1 404");
        begins(&format!("POST / HTTP/1.1\r\n{host}"), "HTTP/1.1 405");
        begins("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", "HTTP/1.1 403");
        begins("GET / HTTP/1.1\r\n\r\n", "HTTP/1.1 403");
        // A request without end is closed, and the page lives on.
        assert_eq!(asked(&page, &"x".repeat(2 * MOST_BYTES)), "");
        begins(&format!("GET / HTTP/1.1\r\n{host}"), "HTTP/1.1 200");
    }
}
