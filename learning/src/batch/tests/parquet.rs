//! Chunks in Parquet, read back by a reader of plain pages. Python's tests read them with pyarrow, Polars and DuckDB.

use super::*;

/// A value of Thrift's compact protocol.
#[derive(Debug)]
enum Value {
    Number(u64),
    Text(Vec<u8>),
    List(Vec<Value>),
    Struct(BTreeMap<u8, Value>),
}

impl Value {
    fn read(bytes: &mut &[u8], kind: u8) -> Self {
        match kind {
            5 | 6 => Self::Number(varint(bytes) / 2),
            8 => {
                let length = varint(bytes) as usize;
                Self::Text(bytes.split_off(..length).unwrap().to_vec())
            }
            9 => {
                let head = byte(bytes);
                let count = if head >> 4 == 15 { varint(bytes) } else { u64::from(head >> 4) };
                Self::List((0..count).map(|_| Self::read(bytes, head & 15)).collect())
            }
            12 => {
                let (mut fields, mut number) = (BTreeMap::new(), 0);
                loop {
                    let head = byte(bytes);
                    if head == 0 {
                        return Self::Struct(fields);
                    }
                    number += head >> 4;
                    fields.insert(number, Self::read(bytes, head & 15));
                }
            }
            kind => panic!("kind {kind}"),
        }
    }

    fn at(&self, path: &[usize]) -> &Self {
        path.iter().fold(self, |value, at| match value {
            Self::List(entries) => &entries[*at],
            Self::Struct(fields) => &fields[&(*at as u8)],
            value => panic!("{value:?}"),
        })
    }

    fn number(&self, path: &[usize]) -> usize {
        let Self::Number(number) = self.at(path) else { panic!("{path:?}") };
        *number as usize
    }

    fn text(&self, path: &[usize]) -> &str {
        let Self::Text(text) = self.at(path) else { panic!("{path:?}") };
        std::str::from_utf8(text).unwrap()
    }

    fn len(&self, path: &[usize]) -> usize {
        let Self::List(entries) = self.at(path) else { panic!("{path:?}") };
        entries.len()
    }
}

fn byte(bytes: &mut &[u8]) -> u8 {
    *bytes.split_off_first().unwrap()
}

fn varint(bytes: &mut &[u8]) -> u64 {
    let mut number = 0;
    for place in 0.. {
        let group = byte(bytes);
        number |= u64::from(group & 127) << (7 * place);
        if group < 128 {
            break;
        }
    }
    number
}

fn footer(file: &[u8]) -> Value {
    let (rest, tail) = file.split_last_chunk::<8>().unwrap();
    assert_eq!((&tail[4..], &file[..4]), (&b"PAR1"[..], &b"PAR1"[..]));
    let length = u32::from_le_bytes(tail[..4].try_into().unwrap()) as usize;
    Value::read(&mut &rest[rest.len() - length..], 12)
}

/// The page of a column in a group: its number of levels, and its content.
fn page<'f>(file: &'f [u8], footer: &Value, group: usize, column: usize) -> (usize, &'f [u8]) {
    let part = footer.at(&[4, group, 1, column, 3]);
    let mut bytes = &file[part.number(&[9])..][..part.number(&[7])];
    let header = Value::read(&mut bytes, 12);
    assert_eq!((header.number(&[2]), header.number(&[3])), (bytes.len(), bytes.len()));
    assert_eq!(header.number(&[5, 1]), part.number(&[5]));
    (header.number(&[5, 1]), bytes)
}

/// Levels as runs.
fn levels(bytes: &mut &[u8]) -> Vec<u8> {
    let length = u32::from_le_bytes(bytes.split_off(..4).unwrap().try_into().unwrap()) as usize;
    let mut runs = bytes.split_off(..length).unwrap();
    let mut all = vec![];
    while !runs.is_empty() {
        let count = varint(&mut runs) as usize / 2;
        all.extend(vec![byte(&mut runs); count]);
    }
    all
}

/// The lists of a column of doubles in a group.
fn lists(file: &[u8], footer: &Value, group: usize, column: usize) -> Vec<Vec<f64>> {
    let (count, mut bytes) = page(file, footer, group, column);
    let [repeated, defined] = [levels(&mut bytes), levels(&mut bytes)];
    assert_eq!((repeated.len(), defined.len()), (count, count));
    let mut numbers = bytes.chunks_exact(8).map(|number| f64::from_le_bytes(number.try_into().unwrap()));
    let mut lists: Vec<Vec<f64>> = vec![];
    for (repeated, defined) in repeated.into_iter().zip(defined) {
        if repeated == 0 {
            lists.push(vec![]);
        }
        lists.last_mut().unwrap().extend((defined == 1).then(|| numbers.next().unwrap()));
    }
    assert_eq!(numbers.next(), None);
    lists
}

/// The bytes of the only chunk of a plan.
fn file_of(plan: &str) -> (TempDir, Batch, Vec<u8>) {
    let plan = plan.replace("jobs_per_chunk: 3", "format: Parquet, samples: Float64, jobs_per_chunk: 100");
    let folder = with_plan(&plan);
    let batch = load(&folder).unwrap();
    render_to(&batch, &folder.path().join("data"), None, 1);
    let file = fs::read(folder.path().join("data/chunk-000000.parquet")).unwrap();
    (folder, batch, file)
}

#[test]
fn a_row_is_a_job_with_its_labels_and_signals() {
    let (_folder, batch, file) = file_of(PLAN);
    let footer = footer(&file);
    let names: Vec<&str> = (0..footer.len(&[2])).map(|element| footer.text(&[2, element, 4])).collect();
    let labels = ["job", "surface", "surface_name", "motion", "motion_name", "seed"];
    let numbers = ["samples", "rate_hz", "gain", "update_hz", "mean_speed_m_s", "mean_force_n", "outside"];
    let list = |name| [name, "list", "element"];
    let lists_of = ["vibration_m_s2", "speed_m_s", "force_n"].map(list).concat();
    assert_eq!(names, [&["job"][..], &labels, &numbers, &lists_of].concat());
    assert_eq!((footer.number(&[3]), footer.number(&[4, 0, 3]), footer.len(&[4])), (20, 20, 1));
    let whole = |column| -> Vec<u64> {
        let (_, bytes) = page(&file, &footer, 0, column);
        bytes.chunks_exact(8).map(|number| u64::from_le_bytes(number.try_into().unwrap())).collect()
    };
    let jobs = (0..20).map(|job| batch.job(job));
    assert_eq!(whole(0), (0..20).collect::<Vec<u64>>());
    assert_eq!(whole(1), jobs.clone().map(|job| job.surface as u64).collect::<Vec<_>>());
    assert_eq!(whole(5), jobs.clone().map(|job| job.seed).collect::<Vec<_>>());
    assert_eq!(page(&file, &footer, 0, 2).1[..16], *b"\x04\0\0\0cork\x04\0\0\0cork");
    let vibrations: Vec<Vec<f64>> = jobs.map(|job| vibration(&batch, job).unwrap()).collect();
    assert_eq!(lists(&file, &footer, 0, 13), vibrations);
    let lengths: Vec<u64> = vibrations.iter().map(|vibration| vibration.len() as u64).collect();
    assert_eq!(whole(6), lengths);
    for (job, outside) in (0..20).map(|job| batch.job(job)).zip(whole(12)) {
        let outside = f64::from_bits(outside);
        assert_eq!((outside == 0.0, outside < 1.0), (job.motion == 0, true), "{outside}");
    }
    let metadata: BTreeMap<&str, &str> =
        (0..3).map(|pair| (footer.text(&[5, pair, 1]), footer.text(&[5, pair, 2]))).collect();
    let units: serde_json::Value = serde_json::from_str(metadata["units"]).unwrap();
    assert_eq!((&units["vibration_m_s2"], &units["rate_hz"]), (&"m/s2".into(), &"Hz".into()));
    let about: serde_json::Value = serde_json::from_str(metadata["haptograph"]).unwrap();
    assert_eq!((about["batch"].as_str(), metadata["rendered"]), (Some(batch.identity()), "true"));
}

#[test]
fn a_walk_without_ranges_stays_within_what_was_recorded() {
    let (folder, _, file) = file_of(&PLAN.replace(", speed_mm_s: (5, 170), force_n: (0.1, 2.0)", ""));
    let (_, bytes) = page(&file, &footer(&file), 0, 12);
    assert!(bytes.chunks_exact(8).all(|share| share == 0f64.to_le_bytes()));
    // Of a surface of fitted models nobody knows.
    let path = folder.path().join("surfaces/cork.ron");
    let text = fs::read_to_string(&path).unwrap().replace("measured", "fitted");
    fs::write(&path, text).unwrap();
    let refused = load(&folder).unwrap_err();
    assert!(
        matches!(refused.problem, PlanProblem::NoRange { range: "speed_mm_s" }) && refused.place.is_some()
    );
}

#[test]
fn a_large_chunk_has_several_groups_of_rows() {
    let (_folder, batch, file) = file_of(&PLAN.replace("seconds: 0.1", "seconds: 10"));
    let footer = footer(&file);
    // The longest row takes 480 kB.
    assert_eq!(footer.len(&[4]), 10);
    let rows = (0..10).flat_map(|group| lists(&file, &footer, group, 13));
    let lengths: Vec<usize> = rows.map(|row| row.len()).collect();
    assert_eq!(lengths, (0..20).map(|job| batch.samples_of(&batch.job(job))).collect::<Vec<_>>());
}

#[test]
fn every_changed_or_missing_byte_is_noticed() {
    let plan = PLAN.replace("0.05", "0.002").replace("seconds: 0.1", "seconds: 0.002");
    let (folder, batch, sound) = file_of(&plan);
    let path = folder.path().join("data/chunk-000000.parquet");
    let verify = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        chunk::verify(&path, document::Format::Parquet, batch.identity(), 0)
    };
    for at in (0..sound.len()).step_by(41).chain(sound.len() - 100..sound.len()) {
        let mut changed = sound.clone();
        changed[at] ^= 0x21;
        assert!(verify(&changed).is_err(), "byte {at} of {}", sound.len());
        assert!(verify(&sound[..at]).is_err(), "{at} of {} bytes", sound.len());
    }
    verify(&sound).unwrap();
}
