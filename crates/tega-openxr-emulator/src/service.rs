//! The connection to the process that has the poses: a line is asked, a line is answered.

use std::env;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;

/// Names `HOST:PORT` of the service.
const ADDRESS: &str = "TEGA_OPENXR_EMULATOR";

/// A connection that lasts until the service is gone.
pub struct Service {
    stream: BufReader<TcpStream>,
}

impl Service {
    /// Connects; `None` where nobody listens or nothing says where.
    pub fn connect() -> Option<Self> {
        let stream = TcpStream::connect(env::var(ADDRESS).ok()?).ok()?;
        stream.set_nodelay(true).ok()?;
        let stream = BufReader::new(stream);
        Some(Self { stream })
    }

    /// Asks and waits for the answer, as long as that takes; `None` once the service is gone.
    pub fn ask(&mut self, question: &str) -> Option<String> {
        writeln!(self.stream.get_mut(), "{question}").ok()?;
        let mut answer = String::new();
        self.stream.read_line(&mut answer).ok()?;
        answer.ends_with('\n').then(|| answer.trim_end().to_owned())
    }
}
