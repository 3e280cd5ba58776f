//! Thrift's compact protocol, as far as the metadata of Parquet need it.

/// The kind of the entries of a list.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    Int = 5,
    Text = 8,
    Struct = 12,
}

/// A struct to which fields are added in ascending order of their numbers.
#[derive(Default)]
pub(super) struct Struct {
    bytes: Vec<u8>,
    last: u8,
}

impl Struct {
    fn field(&mut self, number: u8, kind: u8) -> &mut Vec<u8> {
        self.bytes.push(((number - self.last) << 4) | kind);
        self.last = number;
        &mut self.bytes
    }

    /// A field of 32 bits; none is negative.
    pub(super) fn int(mut self, number: u8, value: i32) -> Self {
        varint(self.field(number, Kind::Int as u8), 2 * value as u64);
        self
    }

    /// A field of 64 bits.
    pub(super) fn long(mut self, number: u8, value: usize) -> Self {
        varint(self.field(number, 6), 2 * value as u64);
        self
    }

    pub(super) fn text(mut self, number: u8, text: impl AsRef<[u8]>) -> Self {
        let bytes = self.field(number, Kind::Text as u8);
        varint(bytes, text.as_ref().len() as u64);
        bytes.extend(text.as_ref());
        self
    }

    pub(super) fn inner(mut self, number: u8, inner: Self) -> Self {
        self.field(number, Kind::Struct as u8).extend(inner.end());
        self
    }

    /// A list of entries in their bytes; texts without their lengths.
    pub(super) fn list(mut self, number: u8, kind: Kind, entries: &[Vec<u8>]) -> Self {
        let bytes = self.field(number, 9);
        bytes.push(((entries.len().min(15) as u8) << 4) | kind as u8);
        if entries.len() >= 15 {
            varint(bytes, entries.len() as u64);
        }
        for entry in entries {
            if matches!(kind, Kind::Text) {
                varint(bytes, entry.len() as u64);
            }
            bytes.extend(entry);
        }
        self
    }

    /// The bytes of the struct.
    pub(super) fn end(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}

/// Appends a number in groups of seven bits, the lowest first.
pub(super) fn varint(to: &mut Vec<u8>, mut number: u64) {
    while number > 0x7f {
        to.push(number as u8 | 0x80);
        number >>= 7;
    }
    to.push(number as u8);
}
