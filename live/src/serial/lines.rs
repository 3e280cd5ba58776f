//! Lines of numbers.

use crate::numbers::Readers;
use haptograph_nodes::network::link::Count;
use std::fmt;

/// A column of the lines, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Column(pub usize);

impl fmt::Display for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "column {}", self.0)
    }
}

/// Largest length of a line, bytes.
const MAX_LINE_BYTES: usize = 512;

/// Splits bytes into lines. The bytes before the first end of a line are dropped, because they may be part of a line.
#[derive(Debug)]
pub(super) struct Lines {
    buffer: [u8; MAX_LINE_BYTES],
    /// Bytes of the present line; none while it is dropped.
    length: Option<usize>,
    is_first: bool,
}

impl Lines {
    pub(super) fn new() -> Self {
        Self { buffer: [0; MAX_LINE_BYTES], length: None, is_first: true }
    }

    /// Passes on each line that ends in these bytes; an error stands for a line that is too long.
    pub(crate) fn take(&mut self, bytes: &[u8], mut each: impl FnMut(Result<&[u8], Count>)) {
        for byte in bytes {
            if matches!(byte, b'\n' | b'\r') {
                match self.length {
                    Some(0) => {}
                    Some(length) => each(Ok(&self.buffer[..length])),
                    None if self.is_first => {}
                    None => each(Err(Count::TooLarge)),
                }
                (self.length, self.is_first) = (Some(0), false);
            } else if let Some(length) = self.length {
                self.length = match self.buffer.get_mut(length) {
                    Some(room) => {
                        *room = *byte;
                        Some(length + 1)
                    }
                    None => None,
                };
            }
        }
    }
}

/// The number in a column of a line.
fn number(line: &[u8], column: usize) -> Result<f64, Count> {
    let line = std::str::from_utf8(line).map_err(|_| Count::Malformed)?;
    let cell = match line.contains(',') {
        true => line.split(',').nth(column - 1).map(str::trim),
        false => line.split_whitespace().nth(column - 1),
    };
    cell.and_then(|cell| cell.parse().ok()).ok_or(Count::Malformed)
}

/// Publishes the numbers of a line to their readers.
pub(super) fn publish_line(line: Result<&[u8], Count>, readers: &Readers<Column>) {
    readers.publish(|column| Some(line.and_then(|line| number(line, column.0))));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Reader;
    use haptograph_nodes::network::link::Counts;
    use proptest::prelude::*;
    use std::sync::Arc;
    use std::time::Duration;

    /// The numbers that pieces of bytes have in a column, in order, and the counts.
    fn values_of(column: usize, pieces: &[&[u8]]) -> (Vec<f64>, Counts) {
        let (readers, reader) = (Readers::default(), Reader::new("", Column(column), Duration::ZERO));
        let link = Arc::clone(&reader.link);
        readers.list().push(reader);
        let (mut lines, mut values) = (Lines::new(), Vec::new());
        for piece in pieces {
            lines.take(piece, |line| {
                let before = link.counts().accepted;
                publish_line(line, &readers);
                if link.counts().accepted > before {
                    values.push(link.sensed.look().unwrap().1[0]);
                }
            });
        }
        (values, link.counts())
    }

    #[test]
    fn columns_are_separated_by_commas_spaces_or_tabs() {
        let lines: &[u8] = b"\n1, 2 ,3\r\n4 5\t 6\n7\t8 9\n,10,\n";
        assert_eq!(values_of(2, &[lines]).0, [2.0, 5.0, 8.0, 10.0]);
        assert_eq!(values_of(1, &[b"\n-1.5e2 \n+3\n"]).0, [-150.0, 3.0]);
    }

    #[test]
    fn the_half_line_at_the_start_is_dropped_and_pieces_are_joined() {
        assert_eq!(values_of(1, &[b"23\n4", b"5\n6", b"7"]).0, [45.0]);
    }

    #[test]
    fn an_invalid_number_is_counted_and_changes_nothing() {
        let (values, counts) = values_of(1, &[b"\nnan\ninf\n1e999\nx\n\xff\xfe\n,1\n5\n"]);
        assert_eq!((values, counts.not_numbers, counts.malformed), (vec![5.0], 3, 3));
    }

    #[test]
    fn an_endless_line_is_dropped_whole() {
        let endless = vec![b'1'; 3 * MAX_LINE_BYTES];
        let (values, counts) = values_of(1, &[b"\n", &endless, b"\n7\n"]);
        assert_eq!((values, counts.too_large), (vec![7.0], 1));
    }

    proptest! {
        #[test]
        fn any_bytes_give_finite_numbers(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            prop_assert!(values_of(1, &[&bytes]).0.iter().all(|x| x.is_finite()));
        }
    }
}
