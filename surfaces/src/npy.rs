//! NumPy's array format, `.npy`: a header, which is a Python dictionary of three entries, and the numbers as they are in memory.
//! The reader takes the headers that NumPy writes for plain arrays (versions 1 to 3) and refuses all else within a bounded length.

use std::io::Read;

/// Largest header of an array, bytes. NumPy writes 128.
const MAX_HEADER_BYTES: usize = 4096;
const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// The header of an array, before its numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// The type of a number, in NumPy's notation: `<f8`.
    pub descr: String,
    /// True if the first index varies fastest.
    pub is_fortran: bool,
    /// The number of elements along each axis.
    pub shape: Vec<u64>,
}

/// Reason why bytes are not a supported array.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NpyError {
    /// The bytes are not an array, or end before its header does.
    #[error("it is not a NumPy array (.npy), or it is cut off; save it again with `numpy.save`")]
    NotAnArray,
    /// A version of the format after 3.
    #[error("its format has version {0}.{1}; versions 1 to 3 are read")]
    Version(u8, u8),
    /// A header that ends early or is longer than NumPy's.
    #[error("its header is not in NumPy's format")]
    HeaderLength,
    /// An unexpected entry at a byte of the header's text.
    #[error("its header is not in NumPy's format: expected {expected} at byte {at}")]
    Syntax {
        /// The expected entry.
        expected: &'static str,
        /// The place in the header's text.
        at: usize,
    },
    /// The number of axes, or of elements along an axis other than the first, is unexpected.
    #[error("its shape is {found:?}; expected (n) followed by {row:?}")]
    Shape {
        /// The shape of the array.
        found: Vec<u64>,
        /// The expected shape without the first axis.
        row: Vec<u64>,
    },
    /// An array of several axes with the first index fastest.
    #[error("it is in Fortran order; save it in C order")]
    FortranOrder,
    /// An unsupported type: integers, complex numbers and others.
    #[error("its number type is '{0}', which is not read; save doubles or singles, `astype(float)`")]
    Type(String),
    /// The number of values differs from that of the shape.
    #[error(
        "it has {bytes} bytes of data, which do not match its shape {shape:?}: the file is cut off or damaged; save it again"
    )]
    Length {
        /// Bytes after the header.
        bytes: usize,
        /// The shape that the header states.
        shape: Vec<u64>,
    },
}

impl Header {
    /// Reads a header; the numbers follow in `source`.
    pub fn read(source: &mut impl Read) -> Result<Self, NpyError> {
        let mut begin = [0; 8];
        let mut read = |into: &mut [u8]| source.read_exact(into);
        read(&mut begin).map_err(|_| NpyError::NotAnArray)?;
        let [.., major, minor] = begin;
        if !begin.starts_with(MAGIC) {
            return Err(NpyError::NotAnArray);
        }
        let mut length = [0; 4];
        let width = match (major, minor) {
            (1, 0) => 2,
            (2 | 3, 0) => 4,
            _ => return Err(NpyError::Version(major, minor)),
        };
        read(&mut length[..width]).map_err(|_| NpyError::NotAnArray)?;
        let length = usize::try_from(u32::from_le_bytes(length)).unwrap_or(usize::MAX);
        if length > MAX_HEADER_BYTES {
            return Err(NpyError::HeaderLength);
        }
        let mut text = vec![0; length];
        read(&mut text).map_err(|_| NpyError::HeaderLength)?;
        Dictionary { text: &text, at: 0 }.header()
    }

    /// The bytes of a header in version 1, with the shape as it stands between the round brackets. The numbers that follow
    /// are aligned to 64 bytes.
    pub(crate) fn bytes(descr: &str, shape: &str) -> Vec<u8> {
        let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({shape}), }}");
        let begun = MAGIC.len() + 4;
        let padding = (begun + text.len() + 1).next_multiple_of(64) - (begun + text.len() + 1);
        text.extend(std::iter::repeat_n(' ', padding));
        text.push('\n');
        let mut bytes = [MAGIC.as_slice(), &[1, 0]].concat();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes
    }
}

/// The doubles of an array whose rows have the shape `row`; single precision and both orders of bytes are read.
pub fn doubles(bytes: &[u8], row: &[u64]) -> Result<Vec<f64>, NpyError> {
    let mut data = bytes;
    let Header { descr, is_fortran, shape } = Header::read(&mut data)?;
    if shape.get(1..) != Some(row) {
        let row = row.to_vec();
        return Err(NpyError::Shape { found: shape, row });
    }
    if is_fortran && !row.is_empty() {
        return Err(NpyError::FortranOrder);
    }
    let width = match descr.as_str() {
        "<f8" | ">f8" => 8,
        "<f4" | ">f4" => 4,
        _ => return Err(NpyError::Type(descr)),
    };
    let wanted = shape.iter().try_fold(width, |bytes: u64, n| bytes.checked_mul(*n));
    if wanted != Some(data.len() as u64) {
        return Err(NpyError::Length { bytes: data.len(), shape });
    }
    let (eights, fours) = (data.as_chunks().0.iter(), data.as_chunks().0.iter());
    Ok(match descr.as_str() {
        "<f8" => eights.map(|&b| f64::from_le_bytes(b)).collect(),
        ">f8" => eights.map(|&b| f64::from_be_bytes(b)).collect(),
        "<f4" => fours.map(|&b| f32::from_le_bytes(b).into()).collect(),
        _ => fours.map(|&b| f32::from_be_bytes(b).into()).collect(),
    })
}

/// The text of a header, read from the left.
struct Dictionary<'a> {
    text: &'a [u8],
    at: usize,
}

impl Dictionary<'_> {
    /// `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }` and blanks; the entries in any order, each once.
    fn header(mut self) -> Result<Header, NpyError> {
        let (mut descr, mut is_fortran, mut shape) = (None, None, None);
        self.expect(b'{', "`{`")?;
        while !self.take(b'}') {
            let begin = self.at;
            let key = self.string()?;
            self.expect(b':', "`:`")?;
            let is_new = match key.as_str() {
                "descr" => descr.replace(self.string()?).is_none(),
                "fortran_order" => is_fortran.replace(self.truth()?).is_none(),
                "shape" => shape.replace(self.tuple()?).is_none(),
                _ => false,
            };
            if !is_new {
                self.at = begin;
                return self.failed("`descr`, `fortran_order` and `shape`, each once,");
            }
            if !self.take(b',') {
                self.expect(b'}', "`}`")?;
                break;
            }
        }
        self.skip_blanks();
        match (descr, is_fortran, shape) {
            _ if self.at < self.text.len() => self.failed("the end"),
            (Some(descr), Some(is_fortran), Some(shape)) => Ok(Header { descr, is_fortran, shape }),
            _ => self.failed("`descr`, `fortran_order` and `shape`"),
        }
    }

    fn failed<T>(&self, expected: &'static str) -> Result<T, NpyError> {
        let at = self.at;
        Err(NpyError::Syntax { expected, at })
    }

    fn skip_blanks(&mut self) {
        let rest = &self.text[self.at..];
        self.at += rest.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
    }

    /// Takes a character after blanks, if it is the next.
    fn take(&mut self, byte: u8) -> bool {
        self.skip_blanks();
        let is_next = self.text.get(self.at) == Some(&byte);
        self.at += usize::from(is_next);
        is_next
    }

    fn expect(&mut self, byte: u8, expected: &'static str) -> Result<(), NpyError> {
        match self.take(byte) {
            true => Ok(()),
            false => self.failed(expected),
        }
    }

    /// The next bytes for which `holds`.
    fn run(&mut self, holds: impl Fn(u8) -> bool) -> &str {
        let rest = &self.text[self.at..];
        let length = rest.iter().take_while(|byte| holds(**byte)).count();
        self.at += length;
        // Only ASCII is taken.
        str::from_utf8(&rest[..length]).unwrap_or_default()
    }

    /// Characters of ASCII in quotes of either form, without escapes.
    fn string(&mut self) -> Result<String, NpyError> {
        let expected = "a name in quotes";
        let Some(quote) = [b'\'', b'"'].into_iter().find(|quote| self.take(*quote)) else {
            return self.failed(expected);
        };
        let text = self.run(|byte| matches!(byte, b' '..=b'~') && byte != quote && byte != b'\\').to_owned();
        if self.text.get(self.at) != Some(&quote) {
            return self.failed(expected);
        }
        self.at += 1;
        Ok(text)
    }

    fn truth(&mut self) -> Result<bool, NpyError> {
        self.skip_blanks();
        let begin = self.at;
        match self.run(|byte| byte.is_ascii_alphabetic()) {
            "True" => Ok(true),
            "False" => Ok(false),
            _ => {
                self.at = begin;
                self.failed("`True` or `False`")
            }
        }
    }

    /// Whole numbers in round brackets. A single one needs its comma, as in Python.
    fn tuple(&mut self) -> Result<Vec<u64>, NpyError> {
        self.expect(b'(', "`(`")?;
        let mut numbers = Vec::new();
        while !self.take(b')') {
            self.skip_blanks();
            let begin = self.at;
            let Ok(number) = self.run(|byte| byte.is_ascii_digit()).parse::<u64>() else {
                self.at = begin;
                return self.failed("a number of elements");
            };
            numbers.push(number);
            if !self.take(b',') {
                let end = if numbers.len() > 1 { b')' } else { b',' };
                self.expect(end, "`,` or `)`")?;
                break;
            }
        }
        Ok(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An array of version 1 with this text as its header.
    fn array(text: &str, data: &[u8]) -> Vec<u8> {
        let length = (text.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00".as_slice(), &length, text.as_bytes(), data].concat()
    }

    fn header(text: &str) -> Result<Header, NpyError> {
        Header::read(&mut array(text, &[]).as_slice())
    }

    fn of(descr: &str, shape: &[u64]) -> Header {
        let (descr, shape) = (descr.to_owned(), shape.to_vec());
        Header { descr, is_fortran: false, shape }
    }

    #[test]
    fn headers_of_numpy_are_read() {
        // As `numpy.save` writes them, and as Python lets others write them.
        let texts = [
            "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }   \n",
            "{\"shape\":(3,2),\"descr\":\"<f8\",\"fortran_order\":False}",
            " { 'fortran_order' : False , 'shape' : ( 3 , 2 , ) , 'descr' : '<f8' , } ",
        ];
        for text in texts {
            assert_eq!(header(text), Ok(of("<f8", &[3, 2])), "{text}");
        }
        let one = "{'descr': '|u1', 'fortran_order': False, 'shape': (18446744073709551615,), }";
        assert_eq!(header(one), Ok(of("|u1", &[u64::MAX])));
        let none = "{'descr': '<f8', 'fortran_order': True, 'shape': (), }";
        assert_eq!(header(none).map(|h| (h.is_fortran, h.shape)), Ok((true, vec![])));
    }

    #[test]
    fn what_is_written_is_read() {
        for (shape, text) in [(&[7][..], "7,"), (&[7], "7, "), (&[7, 3], "7, 3, "), (&[7, 3], "7, 3")] {
            let bytes = Header::bytes("<f8", text);
            assert_eq!(bytes.len() % 64, 0);
            assert_eq!(Header::read(&mut bytes.as_slice()), Ok(of("<f8", shape)));
        }
    }

    #[test]
    fn versions_two_and_three_have_a_longer_length() {
        let text = "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }\n";
        for version in [2, 3] {
            let begin = [b"\x93NUMPY".as_slice(), &[version, 0]].concat();
            let bytes =
                [begin.as_slice(), (text.len() as u32).to_le_bytes().as_slice(), text.as_bytes()].concat();
            assert_eq!(Header::read(&mut bytes.as_slice()), Ok(of("<f8", &[3])));
            let long = [begin.as_slice(), [255; 4].as_slice(), text.as_bytes()].concat();
            assert_eq!(Header::read(&mut long.as_slice()), Err(NpyError::HeaderLength));
        }
    }

    #[test]
    fn hostile_headers_are_refused_where_they_are_wrong() {
        let good = array("{'descr': '<f8', 'fortran_order': False, 'shape': (1,), }", &[]);
        for end in 0..good.len() {
            assert!(Header::read(&mut &good[..end]).is_err(), "{end} bytes");
        }
        let version = [&good[..6], &[4, 0], &good[8..]].concat();
        assert_eq!(Header::read(&mut version.as_slice()), Err(NpyError::Version(4, 0)));
        let long = array(&" ".repeat(MAX_HEADER_BYTES + 1), &[]);
        assert_eq!(Header::read(&mut long.as_slice()), Err(NpyError::HeaderLength));
        for (text, at) in [
            ("", 0),
            ("{", 1),
            ("{}", 2),
            ("{'descr': '<f8'}", 16),
            (&*"(".repeat(4096), 0),
            (&*"{".repeat(4096), 1),
            (&*format!("{{'descr': {}", "[".repeat(2000)), 10),
            ("{'descr': [('x', '<f8')], 'fortran_order': False, 'shape': (1,), }", 10),
            ("{'descr': '<\\'f8'", 12),
            ("{'descr': '<f8", 14),
            ("{'\"descr': '<f8'", 1),
            ("{'descr': '<f8', 'descr': '<f8'", 17),
            ("{'descr': '<f8', 'order': False", 17),
            ("{'fortran_order': 1", 18),
            ("{'fortran_order': Falsehood", 18),
            ("{'shape': 3", 10),
            ("{'shape': (3)", 12),
            ("{'shape': (3 4)", 13),
            ("{'shape': (-3,)", 11),
            ("{'shape': (3, 18446744073709551616)", 14),
            ("{'shape': ((((((((1,),),),),),),),)", 11),
            ("{'descr': '<f8', 'fortran_order': False, 'shape': (1,), } or more", 58),
        ] {
            let found = header(text);
            let place = matches!(found, Err(NpyError::Syntax { at: found, .. }) if found == at);
            assert!(place, "{text}: {found:?}");
        }
    }

    #[test]
    fn numbers_of_both_widths_and_orders_of_bytes_are_read() {
        let array_of = |descr: &str, data: Vec<u8>| {
            let text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (2,), }}");
            doubles(&array(&text, &data), &[])
        };
        let wanted = Ok(vec![1.5, -2.0]);
        let values = [1.5_f64, -2.0];
        let singles = [1.5_f32, -2.0];
        assert_eq!(array_of("<f8", values.map(f64::to_le_bytes).concat()), wanted);
        assert_eq!(array_of(">f8", values.map(f64::to_be_bytes).concat()), wanted);
        assert_eq!(array_of("<f4", singles.map(f32::to_le_bytes).concat()), wanted);
        assert_eq!(array_of(">f4", singles.map(f32::to_be_bytes).concat()), wanted);
        assert_eq!(array_of("<i8", vec![0; 16]), Err(NpyError::Type("<i8".to_owned())));
        assert_eq!(array_of("<f8", vec![0; 15]), Err(NpyError::Length { bytes: 15, shape: vec![2] }));
    }

    #[test]
    fn shapes_and_orders_that_do_not_fit_are_refused() {
        let array_of = |order: &str, shape: &str| {
            let text = format!("{{'descr': '<f8', 'fortran_order': {order}, 'shape': ({shape}), }}");
            doubles(&array(&text, &[0; 48]), &[3])
        };
        assert_eq!(array_of("False", "2, 3").map(|numbers| numbers.len()), Ok(6));
        assert_eq!(array_of("True", "2, 3"), Err(NpyError::FortranOrder));
        assert!(matches!(array_of("False", "3, 2"), Err(NpyError::Shape { .. })));
        assert!(matches!(array_of("False", ""), Err(NpyError::Shape { .. })));
        let large = "6148914691236517206, 3";
        let shape = vec![6_148_914_691_236_517_206, 3];
        assert_eq!(array_of("False", large), Err(NpyError::Length { bytes: 48, shape }));
        // A single axis is the same in both orders.
        let text = "{'descr': '<f8', 'fortran_order': True, 'shape': (6,), }";
        assert!(doubles(&array(text, &[0; 48]), &[]).is_ok());
    }
}
