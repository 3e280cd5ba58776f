//! Messages of the Language Server Protocol: a header with a length, then JSON.

use serde_json::Value;
use std::io::{BufRead, Error, ErrorKind, Read, Result, Write};

/// Maximum size of a message, bytes; graph files are limited to half of it.
const MAX_BYTES: usize = 32 << 20;
/// Maximum length of a header line, bytes.
const MAX_HEADER_BYTES: u64 = 1024;

/// Reads the next message; `None` at the end of the input.
pub(super) fn read(input: &mut impl BufRead) -> Result<Option<Value>> {
    let mut length = None;
    loop {
        let mut line = String::new();
        if input.by_ref().take(MAX_HEADER_BYTES).read_line(&mut line)? == 0 {
            return Ok(None);
        }
        let line = line.trim_end();
        if line.is_empty() {
            break;
        }
        if let Some((name, value)) = line.split_once(':')
            && name.eq_ignore_ascii_case("content-length")
        {
            length = value.trim().parse::<usize>().ok();
        }
    }
    let wrong = |why: &str| Error::new(ErrorKind::InvalidData, why.to_owned());
    let length = length
        .filter(|length| *length <= MAX_BYTES)
        .ok_or_else(|| wrong("a message needs a Content-Length of at most 32 MiB"))?;
    let mut body = vec![0; length];
    input.read_exact(&mut body)?;
    let message = serde_json::from_slice(&body);
    message.map(Some).map_err(|error| wrong(&format!("a message is not JSON: {error}")))
}

/// Writes a message.
pub(super) fn write(output: &mut impl Write, message: &Value) -> Result<()> {
    let body = message.to_string();
    write!(output, "Content-Length: {}\r\n\r\n{body}", body.len())?;
    output.flush()
}
