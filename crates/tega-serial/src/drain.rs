//! The port, its thread, and what waits to be taken.

use std::fs::File;
use std::io::{self, PipeReader, PipeWriter, Read};
use std::os::fd::{AsRawFd, OwnedFd};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

/// So much waits for the reader; then all of that is old and thrown away.
const MOST_BYTES: usize = 1 << 20;

/// A port and the thread that drains it. Dropping it ends the thread.
pub struct Drain {
    waiting: Arc<Mutex<Waiting>>,
    /// The thread leaves when this is closed.
    stop: Option<PipeWriter>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Waiting {
    bytes: Vec<u8>,
    arrival_ns: i64,
    /// The system's number of the error that ended the reading.
    error: Option<i32>,
}

impl Drain {
    /// Starts the thread.
    ///
    /// # Arguments
    ///
    /// * `port`: an open port that does not keep a reader waiting (`O_NONBLOCK`)
    ///
    /// # Errors
    ///
    /// The system gives no pipe or no thread.
    pub fn start(port: OwnedFd) -> io::Result<Self> {
        let (told, stop) = io::pipe()?;
        let waiting = Arc::new(Mutex::new(Waiting::default()));
        let ours = Arc::clone(&waiting);
        let thread = thread::Builder::new().name("tega-serial".to_owned()).spawn(move || {
            if let Err(error) = drain(&mut File::from(port), &told, &ours) {
                lock(&ours).error = Some(error.raw_os_error().unwrap_or(libc::EIO));
            }
        })?;
        Ok(Self { waiting, stop: Some(stop), thread: Some(thread) })
    }

    /// Returns what has arrived since the last call, and when the last byte so far did: nanoseconds of the system's
    /// monotonic clock, 0 before the first.
    ///
    /// # Errors
    ///
    /// The port is gone, and all that came before is taken.
    pub fn take(&self) -> io::Result<(Vec<u8>, i64)> {
        let mut waiting = lock(&self.waiting);
        match waiting.error {
            Some(number) if waiting.bytes.is_empty() => Err(io::Error::from_raw_os_error(number)),
            _ => Ok((std::mem::take(&mut waiting.bytes), waiting.arrival_ns)),
        }
    }
}

impl Drop for Drain {
    fn drop(&mut self) {
        self.stop.take();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn lock(waiting: &Mutex<Waiting>) -> MutexGuard<'_, Waiting> {
    waiting.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reads until the stop pipe is written, or the port is gone.
fn drain(port: &mut File, stop: &PipeReader, waiting: &Mutex<Waiting>) -> io::Result<()> {
    let mut piece = [0; 4096];
    while something_to_read(port, stop)? {
        match port.read(&mut piece) {
            // Ready, and yet there is nothing: so the system reports a port that was unplugged.
            Ok(0) => return Err(io::Error::from_raw_os_error(libc::EIO)),
            Ok(n) => {
                let arrival_ns = monotonic_ns();
                let mut waiting = lock(waiting);
                if waiting.bytes.len() + n > MOST_BYTES {
                    waiting.bytes.clear();
                }
                waiting.bytes.extend_from_slice(&piece[..n]);
                waiting.arrival_ns = arrival_ns;
            }
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Waits until the port has something to say; `false` if the thread is to leave.
fn something_to_read(port: &File, stop: &PipeReader) -> io::Result<bool> {
    let watch = |fd| libc::pollfd { fd, events: libc::POLLIN, revents: 0 };
    let mut watched = [watch(port.as_raw_fd()), watch(stop.as_raw_fd())];
    loop {
        // SAFETY: both descriptors are open as long as their owners, which are borrowed, and the array has two entries.
        if unsafe { libc::poll(watched.as_mut_ptr(), 2, -1) } >= 0 {
            return Ok(watched[1].revents == 0);
        }
        let error = io::Error::last_os_error();
        if error.kind() != io::ErrorKind::Interrupted {
            return Err(error);
        }
    }
}

fn monotonic_ns() -> i64 {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the clock exists on every system, and `now` is a whole `timespec`.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut now) };
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::os::fd::OwnedFd;
    use std::os::unix::net::UnixStream;
    use std::thread;

    use super::{Drain, MOST_BYTES, monotonic_ns};

    fn port() -> (UnixStream, Drain) {
        let (ours, theirs) = UnixStream::pair().unwrap();
        theirs.set_nonblocking(true).unwrap();
        (ours, Drain::start(OwnedFd::from(theirs)).unwrap())
    }

    fn wait<T>(mut look: impl FnMut() -> Option<T>) -> T {
        loop {
            if let Some(seen) = look() {
                return seen;
            }
            thread::yield_now();
        }
    }

    #[test]
    fn all_that_is_written_is_taken_in_order_with_the_time_of_the_last_byte() {
        let (mut board, drain) = port();
        let sent: Vec<u8> = (0..200_000_u32).map(|k| (k % 251) as u8).collect();
        let (told, before_ns) = (sent.clone(), monotonic_ns());
        let writer = thread::spawn(move || board.write_all(&told).map(|()| board).unwrap());
        let (mut came, mut last_ns) = (Vec::new(), 0);
        wait(|| {
            let (bytes, t_ns) = drain.take().unwrap();
            assert!(t_ns >= last_ns && (bytes.is_empty() || t_ns >= before_ns));
            last_ns = t_ns;
            came.extend(bytes);
            (came.len() == sent.len()).then_some(())
        });
        assert_eq!(came, sent);
        let after_ns = monotonic_ns();
        assert!(last_ns <= after_ns);
        drop(writer.join().unwrap());
    }

    #[test]
    fn a_port_that_goes_is_told_of_after_its_last_bytes() {
        let (mut board, drain) = port();
        board.write_all(b"last").unwrap();
        drop(board);
        let (mut came, error) = (Vec::new(), ());
        wait(|| match drain.take() {
            Ok((bytes, _)) => {
                came.extend(bytes);
                None
            }
            Err(_) => Some(error),
        });
        assert_eq!(came, b"last");
        assert!(drain.take().is_err());
    }

    #[test]
    fn nobody_who_takes_nothing_keeps_the_thread_or_the_memory() {
        let (mut board, drain) = port();
        board.write_all(&vec![0; 2 * MOST_BYTES]).unwrap();
        board.write_all(&[7]).unwrap();
        let came = wait(|| {
            let waiting = super::lock(&drain.waiting);
            (waiting.bytes.last() == Some(&7)).then(|| waiting.bytes.len())
        });
        assert!(came <= MOST_BYTES);
        drop(drain); // returns: the thread has left
    }
}
