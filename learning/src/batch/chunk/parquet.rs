//! A chunk as a Parquet table: a row for each job, lists for the signals. Pages are plain: nothing is saved on noise.
//!
//! The description is in the footer. Its hash is that of the whole file, with zeros in place of the hash itself.

use super::thrift::{Kind, Struct, varint};
use super::{About, BLOCK, Chunk, Numbers, invalid};
use crate::batch::hex;
use crate::batch::plan::{Batch, Job};
use haptograph_signal::files::MAX_FOOTER_BYTES;
use haptograph_signal::quantity::Quantity;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::ops::Range;

/// The beginning and the end of a file.
const MAGIC: &[u8] = b"PAR1";
/// The beginning of a description.
const ABOUT: &[u8] = b"{\"haptograph\":";
/// Bytes of the signals in a group of rows, about. Readers decode whole groups.
const GROUP_BYTES: usize = 1 << 20;

// Numbers of the format's enumerations (parquet.thrift).
const INT64: i32 = 2;
const FLOAT: i32 = 4;
const DOUBLE: i32 = 5;
const BYTE_ARRAY: i32 = 6;
const REQUIRED: i32 = 0;
const REPEATED: i32 = 2;
const UTF8: i32 = 0;
const LIST: i32 = 3;
const UINT_64: i32 = 14;
const PLAIN: i32 = 0;
const RLE: i32 = 3;

/// A column of a table.
struct Column<'a> {
    name: &'static str,
    values: Values<'a>,
    /// Whether each row has a list of values.
    is_list: bool,
}

enum Values<'a> {
    Numbers(&'a Numbers),
    Names(Vec<&'a str>),
}

/// The numbers of samples of the rows, and of a row in memory.
struct Lengths {
    rows: Vec<usize>,
    longest: usize,
}

/// Writes a chunk with its description, to which the hash is added.
pub(super) fn write(chunk: &Chunk, mut about: About, batch: &Batch, file: &mut File) -> io::Result<About> {
    about.sha256 = "0".repeat(64);
    let jobs: Vec<Job> = batch.jobs_of(chunk.number).map(|job| batch.job(job)).collect();
    let rows: Vec<usize> = jobs.iter().map(|job| batch.samples_of(job)).collect();
    let lengths = Lengths { longest: rows.iter().copied().max().unwrap_or(0), rows };
    let row = batch.signals().len() * batch.samples().bytes() as usize * lengths.longest;
    let step = (GROUP_BYTES / row.max(1)).max(1);
    write_table(&columns(chunk, batch, &jobs), (&lengths, step), &about, file)?;
    let (_, sha256, place) = read(file)?;
    file.seek(SeekFrom::Start(place))?;
    file.write_all(sha256.as_bytes())?;
    Ok(About { sha256, ..about })
}

/// The columns of a chunk: its arrays, and the names of surfaces and motions.
fn columns<'a>(chunk: &'a Chunk, batch: &'a Batch, jobs: &[Job]) -> Vec<Column<'a>> {
    let motions: Vec<&str> = batch.motions().collect();
    let mut columns = vec![];
    for (name, shape, numbers) in &chunk.arrays {
        columns.push(Column { name, values: Values::Numbers(numbers), is_list: shape.len() == 2 });
        let names = |name, of: &dyn Fn(&Job) -> &'a str| {
            let values = Values::Names(jobs.iter().map(of).collect());
            Column { name, values, is_list: false }
        };
        match *name {
            "surface" => columns.push(names("surface_name", &|job| &batch.surfaces()[job.surface].name)),
            "motion" => columns.push(names("motion_name", &|job| motions[job.motion])),
            _ => {}
        }
    }
    columns
}

/// Writes all pages, `step` rows to a group, and the footer.
fn write_table(
    columns: &[Column<'_>],
    (lengths, step): (&Lengths, usize),
    about: &About,
    file: &mut File,
) -> io::Result<()> {
    let jobs = lengths.rows.len();
    let mut file = BufWriter::new(file);
    file.write_all(MAGIC)?;
    let mut at = MAGIC.len();
    let mut groups = vec![];
    for start in (0..jobs).step_by(step) {
        let rows = start..jobs.min(start + step);
        let (begin, mut parts) = (at, vec![]);
        for column in columns {
            let (page, count) = column.page(rows.clone(), lengths);
            file.write_all(&page)?;
            let part = column.part(at, page.len(), count);
            let part = column.extremes(rows.clone()).into_iter().fold(part, |part, [most, least]| {
                part.inner(12, Struct::default().text(5, most).text(6, least))
            });
            parts.push(Struct::default().long(2, at).inner(3, part).end());
            at += page.len();
        }
        let group = Struct::default().list(1, Kind::Struct, &parts);
        groups.push(group.long(2, at - begin).long(3, rows.len()).end());
    }
    let footer = footer(columns, jobs, &groups, about)?;
    file.write_all(&footer)?;
    file.write_all(&(footer.len() as u32).to_le_bytes())?;
    file.write_all(MAGIC)?;
    file.flush()
}

/// The schema, the places of the groups, and the description and the units as metadata.
fn footer(columns: &[Column<'_>], jobs: usize, groups: &[Vec<u8>], about: &About) -> io::Result<Vec<u8>> {
    let root = Struct::default().text(4, "job").int(5, columns.len() as i32).end();
    let schema: Vec<Vec<u8>> = [root].into_iter().chain(columns.iter().flat_map(Column::schema)).collect();
    let units = [
        ("vibration_m_s2", Quantity::ACCELERATION),
        ("speed_m_s", Quantity::SPEED),
        ("force_n", Quantity::FORCE),
        ("rate_hz", Quantity::FREQUENCY),
        ("update_hz", Quantity::FREQUENCY),
    ];
    let units = units.into_iter().filter(|(unit, _)| columns.iter().any(|column| column.name == *unit));
    let units: serde_json::Map<_, _> =
        units.map(|(name, quantity)| (name.to_owned(), quantity.unit().into())).collect();
    let metadata = [
        ("haptograph", serde_json::to_string(about)?),
        ("rendered", "true".to_owned()),
        ("units", serde_json::to_string(&units)?),
    ];
    let metadata = metadata.map(|(key, value)| Struct::default().text(1, key).text(2, &value).end());
    let footer = Struct::default().int(1, 1).list(2, Kind::Struct, &schema).long(3, jobs);
    let footer = footer.list(4, Kind::Struct, groups).list(5, Kind::Struct, &metadata);
    let footer = footer.text(6, concat!("haptograph version ", env!("CARGO_PKG_VERSION")));
    // Smallest and largest values are those of each type's own order.
    let order = Struct::default().inner(1, Struct::default()).end();
    Ok(footer.list(7, Kind::Struct, &vec![order; columns.len()]).end())
}

impl Column<'_> {
    /// The type of a value, and its meaning.
    fn types(&self) -> (i32, Option<i32>) {
        match self.values {
            Values::Names(_) => (BYTE_ARRAY, Some(UTF8)),
            Values::Numbers(Numbers::I64(_)) => (INT64, None),
            Values::Numbers(Numbers::U64(_)) => (INT64, Some(UINT_64)),
            Values::Numbers(Numbers::F32(_)) => (FLOAT, None),
            Values::Numbers(Numbers::F64(_)) => (DOUBLE, None),
        }
    }

    /// The elements of the schema.
    fn schema(&self) -> Vec<Vec<u8>> {
        let (kind, meaning) = self.types();
        let value = |name: &str| {
            let element = Struct::default().int(1, kind).int(3, REQUIRED).text(4, name);
            meaning.into_iter().fold(element, |element, meaning| element.int(6, meaning)).end()
        };
        if !self.is_list {
            return vec![value(self.name)];
        }
        let list = Struct::default().int(3, REQUIRED).text(4, self.name).int(5, 1).int(6, LIST).end();
        let entries = Struct::default().int(3, REPEATED).text(4, "list").int(5, 1).end();
        vec![list, entries, value("element")]
    }

    /// A page with some rows, and the number of its levels, which is that of its values where no list is empty.
    fn page(&self, rows: Range<usize>, lengths: &Lengths) -> (Vec<u8>, usize) {
        let (mut content, mut count) = (vec![], rows.len());
        if self.is_list {
            count = rows.clone().map(|row| lengths.rows[row].max(1)).sum();
            for levels in levels(&lengths.rows[rows.clone()]) {
                content.extend((levels.len() as u32).to_le_bytes());
                content.extend(levels);
            }
        }
        match &self.values {
            Values::Names(names) => {
                for name in &names[rows] {
                    content.extend((name.len() as u32).to_le_bytes());
                    content.extend(name.as_bytes());
                }
            }
            Values::Numbers(numbers) if self.is_list => {
                for row in rows {
                    let start = row * lengths.longest;
                    numbers.append(start..start + lengths.rows[row], &mut content);
                }
            }
            Values::Numbers(numbers) => numbers.append(rows, &mut content),
        }
        let bytes = content.len() as i32;
        let data = Struct::default().int(1, count as i32).int(2, PLAIN).int(3, RLE).int(4, RLE);
        let header = Struct::default().int(1, 0).int(2, bytes).int(3, bytes).inner(5, data).end();
        ([header, content].concat(), count)
    }

    /// The largest and the smallest value of some rows, by which engines leave out groups that they do not need.
    fn extremes(&self, rows: Range<usize>) -> Option<[Vec<u8>; 2]> {
        match &self.values {
            Values::Names(names) => {
                let names = names[rows].iter();
                Some([names.clone().max()?, names.min()?].map(|name| name.as_bytes().to_vec()))
            }
            Values::Numbers(Numbers::I64(numbers)) => {
                let numbers = numbers[rows].iter();
                Some([numbers.clone().max()?, numbers.min()?].map(|number| number.to_le_bytes().to_vec()))
            }
            Values::Numbers(_) => None,
        }
    }

    /// The description of a page, the only one of its column in a group.
    fn part(&self, at: usize, bytes: usize, count: usize) -> Struct {
        let inner: &[&str] = if self.is_list { &["list", "element"] } else { &[] };
        let path: Vec<Vec<u8>> = [&[self.name], inner].concat().into_iter().map(Vec::from).collect();
        let encodings = [PLAIN, RLE].map(|encoding| vec![2 * encoding as u8]);
        let part = Struct::default().int(1, self.types().0).list(2, Kind::Int, &encodings);
        let part = part.list(3, Kind::Text, &path).int(4, 0).long(5, count);
        part.long(6, bytes).long(7, bytes).long(9, at)
    }
}

/// The levels of lists: for each value whether it goes on with a list, and whether it is there; as runs of equal ones.
fn levels(lengths: &[usize]) -> [Vec<u8>; 2] {
    let (mut repeated, mut defined) = (vec![], vec![]);
    let run = |to: &mut Vec<u8>, count: usize, level: u8| {
        if count > 0 {
            varint(to, 2 * count as u64);
            to.push(level);
        }
    };
    for length in lengths {
        run(&mut repeated, 1, 0);
        run(&mut repeated, length.saturating_sub(1), 1);
        run(&mut defined, (*length).max(1), u8::from(*length > 0));
    }
    [repeated, defined]
}

/// The description of a chunk, the hash of its content, and where the hash is in the file. Neither pages nor the schema are decoded.
pub(super) fn read(mut file: &File) -> io::Result<(About, String, u64)> {
    let length = file.seek(SeekFrom::End(0))?;
    let mut tail = [0; 8];
    file.seek(SeekFrom::Start(length.saturating_sub(8)))?;
    file.read_exact(&mut tail)?;
    let [a, b, c, d, magic @ ..] = tail;
    // The footer, its length and the magic bytes.
    let bytes = u64::from(u32::from_le_bytes([a, b, c, d])) + 8;
    if magic != MAGIC || bytes > length.min(MAX_FOOTER_BYTES) {
        return Err(invalid("it is no Parquet file, or its end is missing"));
    }
    let start = length - bytes;
    file.seek(SeekFrom::Start(start))?;
    let mut footer = vec![0; bytes as usize];
    file.read_exact(&mut footer)?;
    // Names of surfaces come ahead of it, whatever they are.
    let begin = footer.windows(ABOUT.len()).rposition(|window| window == ABOUT).unwrap_or(footer.len());
    let described = &footer[begin..];
    let about = serde_json::Deserializer::from_slice(described).into_iter().next();
    let about: About = about.ok_or_else(|| invalid("its footer has no description"))??;
    let place = begin + find(described, about.sha256.as_bytes()).unwrap_or_default();
    footer[place..].iter_mut().take(about.sha256.len()).for_each(|byte| *byte = b'0');
    let mut hash = Sha256::new();
    file.rewind()?;
    let mut pages = file.take(start);
    let mut block = vec![0; BLOCK];
    loop {
        match pages.read(&mut block)? {
            0 => break,
            read => hash.update(&block[..read]),
        }
    }
    hash.update(&footer);
    Ok((about, hex(&hash.finalize()), start + place as u64))
}

fn find(bytes: &[u8], wanted: &[u8]) -> Option<usize> {
    bytes.windows(wanted.len().max(1)).position(|window| window == wanted)
}
