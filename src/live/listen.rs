//! Streams of programs that connect. One is read at a time.

use std::io::{self, BufReader, ErrorKind, Read};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::Arrived;
use super::stream::{begin as begin_thread, fill, read, wrong};
use crate::{Error, Result};

/// A frame has to arrive within this time, the pause before it included.
const OF_FRAME: Duration = Duration::from_secs(10);
/// A program that makes others wait for so long gives way to the newest.
const PAUSE: Duration = Duration::from_millis(100);
/// Programs that are connected at once.
const MOST: usize = 16;
/// Between two tries to take a connection, where the system has none left to give.
const AGAIN: Duration = Duration::from_millis(100);
/// The first bytes of a token.
const TOKEN: &[u8; 4] = b"TBTK";
/// Longest token, bytes.
const LONGEST: usize = 1024;

/// What a program sends before its frames where a token is asked for: `TBTK`, the token's length as 16 bits, the lower byte
/// first, and the token.
pub fn token_bytes(token: &str) -> Vec<u8> {
    [TOKEN, &(token.len() as u16).to_le_bytes()[..], token.as_bytes()].concat()
}

/// The connections of a listener. A fault of the system, such as no descriptor left, is waited for.
pub(super) fn connections(listener: &TcpListener) -> impl Iterator<Item = TcpStream> {
    listener.incoming().filter_map(|stream| stream.inspect_err(|_| std::thread::sleep(AGAIN)).ok())
}

/// Begins to take connections.
///
/// # Errors
/// The address is taken, or is one of the network's and there is no token.
pub(super) fn begin(
    address: SocketAddr,
    token: Option<&str>,
    size: [usize; 2],
    give: SyncSender<Arrived>,
) -> Result<()> {
    if token.is_none() && !address.ip().is_loopback() {
        return Err(Error::options(
            format!("{address} lets others on the network send frames, and no token is asked of them"),
            "give a token that they send first, or listen at 127.0.0.1",
        ));
    }
    if token.is_some_and(|token| token.is_empty() || token.len() > LONGEST) {
        return Err(Error::options("the token is empty or too long", "give 1 to 1024 bytes"));
    }
    let listener = TcpListener::bind(address)
        .map_err(|e| Error::options(format!("{address}: {e}"), "give another address or port"))?;
    let token = token.map(token_bytes).unwrap_or_default();
    let (newest, open, turn) =
        (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)), Arc::new(Mutex::new(())));
    begin_thread(move || {
        for stream in connections(&listener) {
            let slot = Slot::of(&open);
            if open.load(Relaxed) > MOST {
                continue;
            }
            let number = newest.fetch_add(1, Relaxed) + 1;
            let (newest, turn, give, token) = (newest.clone(), turn.clone(), give.clone(), token.clone());
            let work = move || {
                let _slot = slot;
                let _turn = turn.lock().unwrap_or_else(PoisonError::into_inner);
                let until = Instant::now() + OF_FRAME;
                give_all(Connection { stream, until, number, newest }, &token, size, &give);
            };
            // Without a thread the connection closes.
            let _ = begin_thread(work);
        }
    })
}

/// One of the connections at a time; free again when it is dropped.
pub(super) struct Slot(Arc<AtomicUsize>);

impl Slot {
    pub(super) fn of(open: &Arc<AtomicUsize>) -> Slot {
        open.fetch_add(1, Relaxed);
        Slot(open.clone())
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Relaxed);
    }
}

/// A connection whose bytes have to come in time. It ends where a newer one waits and nothing comes.
struct Connection {
    stream: TcpStream,
    until: Instant,
    number: usize,
    newest: Arc<AtomicUsize>,
}

impl Read for Connection {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        loop {
            let left = self.until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(ErrorKind::TimedOut.into());
            }
            self.stream.set_read_timeout(Some(left.min(PAUSE).max(Duration::from_millis(1))))?;
            match self.stream.read(to) {
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    if self.newest.load(Relaxed) != self.number {
                        return Ok(0);
                    }
                }
                done => return done,
            }
        }
    }
}

/// Gives the frames of a connection on.
fn give_all(connection: Connection, token: &[u8], size: [usize; 2], give: &SyncSender<Arrived>) {
    let mut from = BufReader::new(connection);
    let told = (|| {
        let mut sent = vec![0; token.len()];
        fill(&mut from, &mut sent)?;
        // As long for a wrong byte as for a right one.
        if sent.iter().zip(token).fold(0, |unlike, (a, b)| unlike | (a ^ b)) != 0 {
            return Err(wrong("a program has connected without the token"));
        }
        loop {
            from.get_mut().until = Instant::now() + OF_FRAME;
            let Some(counts) = read(&mut from, size)? else { return Ok(()) };
            if give.send(Arrived::Counts(counts)).is_err() {
                return Ok(());
            }
        }
    })();
    if let Err(error) = told {
        let _ = give.send(Arrived::Wrong(error));
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::sync::mpsc::{Receiver, sync_channel};

    use super::super::stream::write;
    use super::*;

    fn listening(token: Option<&str>) -> (SocketAddr, Receiver<Arrived>) {
        let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let (give, take) = sync_channel(8);
        begin(free, token, [2, 2], give).unwrap();
        (free, take)
    }

    fn frame(number: u64) -> Vec<u8> {
        let mut bytes = vec![];
        write(&mut bytes, number, 2, &[1.0; 4]).unwrap();
        bytes
    }

    fn next(take: &Receiver<Arrived>) -> std::result::Result<u64, Error> {
        match take.recv_timeout(Duration::from_secs(5)).expect("something arrives") {
            Arrived::Counts(counts) => Ok(counts.frame),
            Arrived::Wrong(error) => Err(error),
        }
    }

    #[test]
    fn a_program_that_is_slow_gives_way() {
        let (address, take) = listening(None);
        let mut slow = TcpStream::connect(address).unwrap();
        // It has its turn once a frame of it is there.
        slow.write_all(&frame(1)).unwrap();
        assert_eq!(next(&take).unwrap(), 1);
        slow.write_all(&frame(4)[..5]).unwrap();
        let mut fast = TcpStream::connect(address).unwrap();
        fast.write_all(&frame(2)).unwrap();
        assert!(next(&take).unwrap_err().what.contains("ends after 5 bytes"));
        assert_eq!(next(&take).unwrap(), 2);
        // One that is between two frames goes without a word.
        let mut third = TcpStream::connect(address).unwrap();
        third.write_all(&frame(3)).unwrap();
        assert_eq!(next(&take).unwrap(), 3);
    }

    #[test]
    fn whoever_is_beyond_this_machine_needs_the_token() {
        let (give, _take) = sync_channel(1);
        let error = begin("0.0.0.0:0".parse().unwrap(), None, [2, 2], give).unwrap_err();
        assert!(error.what.contains("no token"), "{error}");
        let (address, take) = listening(Some("key"));
        for (sent, is_right) in [("key", true), ("kex", false)] {
            let mut stream = TcpStream::connect(address).unwrap();
            stream.write_all(&[token_bytes(sent), frame(7)].concat()).unwrap();
            match next(&take) {
                Ok(number) => assert!(is_right && number == 7),
                Err(error) => assert!(!is_right && error.what.contains("without the token"), "{error}"),
            }
        }
    }
}
