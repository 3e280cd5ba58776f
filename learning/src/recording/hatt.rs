//! Recordings of the public haptic texture toolkit (HaTT): three XML files of a material, everything at 10 kHz in the world frame
//! (Table A.1 of the thesis). They are read as a stream. The origin, for which the toolkit has no field, is in a comment.

use super::{Gesture, ProcessedRecording, ReadError, Signals, WorldAxes};
use haptograph_signal::units::decimal::format_thousandfold;
use haptograph_surfaces::bounds::{MAX_FORCE_N, MAX_POSITION_M};
use haptograph_surfaces::files::hatt::{Xml, parse_label};
use haptograph_surfaces::{Origin, Provenance};
use quick_xml::Reader;
use quick_xml::events::Event;
use std::io::BufRead;

/// Reads a recording from the contents of `Accel_<material>.xml`, `Position_<material>.xml` and `Force_<material>.xml`.
/// Other fields are ignored. `source` names their origin, unless a comment of the first file does.
pub fn read_hatt(
    accel: impl BufRead,
    position: impl BufRead,
    force: impl BufRead,
    source: &str,
) -> Result<ProcessedRecording, ReadError> {
    let names = ["AccelUnits", "SampleRate", "Accel", "Accel_X", "Accel_Y", "Accel_Z"];
    let mut accel = Fields::read("the Accel file", accel, &names)?;
    let mut position = Fields::read(
        "the Position file",
        position,
        &["SpeedUnits", "PositionUnits", "SampleRate", "Speed", "Position_X", "Position_Y", "Position_Z"],
    )?;
    let names =
        ["ForceUnits", "SampleRate", "ForceNormal", "ForceTangential", "Force_X", "Force_Y", "Force_Z"];
    let mut force = Fields::read("the Force file", force, &names)?;

    accel.expect_unit("AccelUnits", &["m/s^2", "m/s2", "m/s²"])?;
    position.expect_unit("SpeedUnits", &["mm/s"])?;
    force.expect_unit("ForceUnits", &["N"])?;
    let rate_hz = accel.rate_hz()?;
    for other in [&position, &force] {
        let rate = other.rate_hz()?;
        if rate != rate_hz {
            return Err(
                other.error(format!("its rate is {rate} Hz, but the rate of the Accel file is {rate_hz} Hz"))
            );
        }
    }
    let axes = accel.axes(["Accel_X", "Accel_Y", "Accel_Z"]);
    let mut speed = position.array("Speed")?;
    speed.iter_mut().for_each(|v| *v /= 1000.0);
    let signals = Signals {
        rate_hz,
        acceleration_m_s2: accel.array("Accel")?,
        force_normal_n: force.array("ForceNormal")?,
        force_tangential_n: force.array("ForceTangential").ok(),
        speed_m_s: speed,
        axes_m_s2: axes,
    };
    let mut provenance = Provenance::new(Origin::Imported, source);
    if let Some((origin, source, version)) = accel.label.take() {
        (provenance.origin, provenance.source, provenance.version) = (origin, source, version);
    }
    // Nothing is learned from positions and forces by axis: what is unsound of them is left out.
    let samples = signals.acceleration_m_s2.len();
    let whole = |axes: Option<Vec<[f64; 3]>>, most: f64| {
        let is_sound = |axes: &Vec<[f64; 3]>| {
            axes.len() == samples && axes.as_flattened().iter().all(|x| x.abs() <= most)
        };
        axes.filter(is_sound)
    };
    let in_mm = position.expect_unit("PositionUnits", &["mm"]).is_ok();
    let position_mm = position.axes(["Position_X", "Position_Y", "Position_Z"]);
    let in_m = |axes: Vec<[f64; 3]>| axes.into_iter().map(|axes| axes.map(|mm| mm / 1000.0)).collect();
    let world = WorldAxes {
        position_m: whole(position_mm.filter(|_| in_mm).map(in_m), MAX_POSITION_M),
        force_n: whole(force.axes(["Force_X", "Force_Y", "Force_Z"]), MAX_FORCE_N),
    };
    Ok(ProcessedRecording::new(signals, Gesture::Drag, provenance)?.with_world(world)?)
}

/// The contents of `Accel_<material>.xml`, `Position_<material>.xml` and `Force_<material>.xml`. They have no field for the
/// gesture and for settings of the provenance. Axes are written where the recording has them.
pub fn write_hatt(recording: &ProcessedRecording) -> [String; 3] {
    let (signals, world) = (recording.signals(), recording.world());
    let file = |root: &str, inside: &dyn Fn(&mut Xml)| {
        let mut out = Xml::new("recording", recording.provenance());
        out.line(0, &format!("<{root}>"));
        inside(&mut out);
        out.line(0, &format!("</{root}>"));
        out.text
    };
    let rate = |out: &mut Xml| out.field(1, "SampleRate", &signals.rate_hz.to_string());
    let plain = |value: f64| value.to_string();
    let accel = file("accelSet", &|out| {
        out.field(1, "AccelUnits", "m/s^2");
        rate(out);
        array(out, "Accel", &signals.acceleration_m_s2, plain);
        by_axis(out, "Accel", signals.axes_m_s2.as_deref(), plain);
    });
    let position = file("positionSet", &|out| {
        out.field(1, "SpeedUnits", "mm/s");
        out.field(1, "PositionUnits", "mm");
        rate(out);
        array(out, "Speed", &signals.speed_m_s, format_thousandfold);
        by_axis(out, "Position", world.position_m.as_deref(), format_thousandfold);
    });
    let force = file("forceSet", &|out| {
        out.field(1, "ForceUnits", "N");
        rate(out);
        array(out, "ForceNormal", &signals.force_normal_n, plain);
        if let Some(tangential) = &signals.force_tangential_n {
            array(out, "ForceTangential", tangential, plain);
        }
        by_axis(out, "Force", world.force_n.as_deref(), plain);
    });
    [accel, position, force]
}

fn array(out: &mut Xml, name: &str, values: &[f64], text: impl Fn(f64) -> String) {
    out.list(1, name, true, values.iter().map(|value| text(*value)));
}

fn by_axis(out: &mut Xml, quantity: &str, axes: Option<&[[f64; 3]]>, text: impl Fn(f64) -> String) {
    let Some(axes) = axes else { return };
    for (number, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
        let values: Vec<f64> = axes.iter().map(|axes| axes[number]).collect();
        array(out, &format!("{quantity}_{axis}"), &values, &text);
    }
}

/// The requested fields of one file.
struct Fields {
    file: &'static str,
    byte: u64,
    fields: Vec<Field>,
    /// Origin, source and maker by haptograph's comment.
    label: Option<(Origin, String, String)>,
}

struct Field {
    name: &'static str,
    /// The first text in it, for units.
    text: String,
    values: Vec<f64>,
}

impl Fields {
    fn read(file: &'static str, source: impl BufRead, names: &[&'static str]) -> Result<Self, ReadError> {
        let fields = names.iter().map(|&name| Field { name, text: String::new(), values: vec![] }).collect();
        let mut this = Self { file, byte: 0, fields, label: None };
        let mut reader = Reader::from_reader(source);
        let mut buffer = Vec::new();
        // The requested field that is open, and the depth in it and in the document.
        let (mut open, mut depth) = (None, 0_usize);
        loop {
            this.byte = reader.buffer_position();
            match reader.read_event_into(&mut buffer) {
                Err(error) => return Err(this.error(error)),
                Ok(Event::Start(tag)) => {
                    depth += 1;
                    if open.is_none() {
                        let name = tag.local_name();
                        let found = this.fields.iter().position(|f| f.name.as_bytes() == name.as_ref());
                        open = found.map(|field| (field, depth));
                    }
                }
                Ok(Event::End(_)) => {
                    if open.is_some_and(|(_, at)| at == depth) {
                        open = None;
                    }
                    depth = depth.saturating_sub(1);
                }
                Ok(Event::Text(text)) => {
                    if let Some((field, _)) = open {
                        let text = std::str::from_utf8(&text).map_err(|e| this.error(e))?;
                        this.take(field, text)?;
                    }
                }
                Ok(Event::GeneralRef(_) | Event::CData(_)) if open.is_some() => {
                    return Err(this.error("expected plain text"));
                }
                Ok(Event::Comment(text)) if this.label.is_none() => {
                    this.label = std::str::from_utf8(&text).ok().and_then(parse_label);
                }
                Ok(Event::Eof) if depth == 0 => return Ok(this),
                Ok(Event::Eof) => return Err(this.error("the file ends in the middle of an element")),
                Ok(_) => {}
            }
            buffer.clear();
        }
    }

    fn take(&mut self, field: usize, text: &str) -> Result<(), ReadError> {
        let is_unit = self.fields[field].name.ends_with("Units");
        for word in text.split_ascii_whitespace() {
            if is_unit {
                self.fields[field].text = text.trim().to_owned();
                break;
            }
            let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
            let is_by_axis = ["Position_", "Force_"].iter().any(|of| self.fields[field].name.starts_with(of));
            // Those are left out as a whole.
            let value = value.or(is_by_axis.then_some(f64::NAN)).ok_or_else(|| {
                let start: String = word.chars().take(20).collect();
                self.error(format!("{start:?} in {} is not a finite number", self.fields[field].name))
            })?;
            self.fields[field].values.push(value);
        }
        Ok(())
    }

    fn error(&self, message: impl ToString) -> ReadError {
        ReadError::Xml { file: self.file, byte: self.byte, message: message.to_string() }
    }

    fn field(&mut self, name: &'static str) -> Option<&mut Field> {
        self.fields.iter_mut().find(|field| field.name == name)
    }

    /// Refuses any unit except these; a missing unit counts as the toolkit's.
    fn expect_unit(&mut self, name: &'static str, known: &[&str]) -> Result<(), ReadError> {
        let text = self.field(name).map(|field| field.text.clone()).unwrap_or_default();
        if text.is_empty() || known.contains(&text.as_str()) {
            return Ok(());
        }
        Err(self.error(format!("{name} is {text:?}; expected one of {known:?}")))
    }

    fn rate_hz(&self) -> Result<f64, ReadError> {
        let values =
            self.fields.iter().find(|field| field.name == "SampleRate").map(|field| &field.values[..]);
        match values {
            Some(&[rate_hz]) if rate_hz > 0.0 => Ok(rate_hz),
            _ => Err(self.error("it has no `SampleRate` above 0")),
        }
    }

    /// Removes and returns three arrays, if all are there and of one length.
    fn axes(&mut self, names: [&'static str; 3]) -> Option<Vec<[f64; 3]>> {
        let [x, y, z] = names.map(|name| self.array(name).unwrap_or_default());
        (!x.is_empty() && x.len() == y.len() && x.len() == z.len())
            .then(|| x.iter().zip(&y).zip(&z).map(|((&x, &y), &z)| [x, y, z]).collect())
    }

    /// Removes and returns an array.
    fn array(&mut self, name: &'static str) -> Result<Vec<f64>, ReadError> {
        let values = self.field(name).map(|field| std::mem::take(&mut field.values)).unwrap_or_default();
        if values.is_empty() { Err(self.error(format!("it has no values in {name}"))) } else { Ok(values) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An array as the toolkit writes it.
    fn array(name: &str, values: &[f64]) -> String {
        let values: String = values.iter().map(|v| format!("    <value>{v}</value>\n")).collect();
        format!("  <{name} type=\"array\">\n{values}  </{name}>\n")
    }

    fn triple() -> [String; 3] {
        let file =
            |inside: String| format!("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<set>\n{inside}</set>\n");
        let rate = "  <SampleRate>10000</SampleRate>\n";
        [
            file(format!(
                "  <AccelUnits>m/s^2</AccelUnits>\n{rate}{}{}{}{}",
                array("Accel", &[0.5, -0.25, 1e-3]),
                array("Accel_X", &[1.0, 2.0, 3.0]),
                array("Accel_Y", &[4.0, 5.0, 6.0]),
                array("Accel_Z", &[7.0, 8.0, 9.0]),
            )),
            file(format!(
                "  <SpeedUnits>mm/s</SpeedUnits>\n  <PositionUnits>mm</PositionUnits>\n{rate}{}{}",
                array("Speed", &[100.0, 110.0, 120.5]),
                ["X", "Y", "Z"].map(|axis| array(&format!("Position_{axis}"), &[1.0, 2.5, -4.0])).concat(),
            )),
            file(format!(
                "  <ForceUnits>N</ForceUnits>\n{rate}{}{}",
                array("ForceNormal", &[1.0, 1.5, 2.0]),
                array("ForceTangential", &[0.3, 0.4, 0.5])
                    + &array("Force_X", &[0.1, 0.2, 0.3])
                    + &array("Force_Y", &[0.0, 0.0, 0.0])
                    + &array("Force_Z", &[-1.0, -1.5, -2.0]),
            )),
        ]
    }

    fn read([a, p, f]: &[String; 3]) -> Result<ProcessedRecording, ReadError> {
        read_hatt(a.as_bytes(), p.as_bytes(), f.as_bytes(), "Cork")
    }

    #[test]
    fn a_triple_becomes_a_processed_recording_in_si_units() {
        let recording = read(&triple()).unwrap();
        let signals = recording.signals();
        assert_eq!(signals.rate_hz, 10_000.0);
        assert_eq!(signals.acceleration_m_s2, [0.5, -0.25, 1e-3]);
        assert_eq!(signals.speed_m_s, [0.1, 0.11, 0.1205]);
        assert_eq!(signals.force_tangential_n.as_deref(), Some(&[0.3, 0.4, 0.5][..]));
        assert_eq!(signals.axes_m_s2.as_ref().unwrap()[1], [2.0, 5.0, 8.0]);
        assert_eq!(recording.provenance().origin, Origin::Imported);
        let world = recording.world();
        assert_eq!(world.position_m.as_ref().unwrap()[1], [2.5e-3; 3]);
        assert_eq!(world.force_n.as_ref().unwrap()[2], [0.3, 0.0, -2.0]);
    }

    #[test]
    fn axes_that_nothing_is_learned_from_refuse_no_recording() {
        for wrong in ["nan", "none", "2000000"] {
            let mut triple = triple();
            triple[1] = triple[1].replace("<value>2.5</value>", &format!("<value>{wrong}</value>"));
            let recording = read(&triple).unwrap();
            assert!(recording.world().position_m.is_none() && recording.world().force_n.is_some(), "{wrong}");
        }
    }

    #[test]
    fn what_is_written_is_read_again_with_all_axes_and_its_origin() {
        let imported = read(&triple()).unwrap();
        let provenance = Provenance::new(Origin::Simulated, "a test");
        let signals = imported.signals().clone();
        let recording = ProcessedRecording::new(signals, imported.gesture(), provenance).unwrap();
        let recording = recording.with_world(imported.world().clone()).unwrap();
        let written = write_hatt(&recording);
        assert_eq!(read(&written).unwrap(), recording);
        for (file, names) in written.iter().zip([
            &["AccelUnits", "SampleRate", "Accel", "Accel_X", "Accel_Z"][..],
            &["SpeedUnits", "PositionUnits", "Speed", "Position_X", "Position_Z"],
            &["ForceUnits", "ForceNormal", "ForceTangential", "Force_X", "Force_Z"],
        ]) {
            assert!(names.iter().all(|name| file.contains(&format!("<{name}"))), "{file}");
        }
        // Recordings without axes, and positions in an unknown unit.
        let plain = ProcessedRecording::new(
            Signals { axes_m_s2: None, force_tangential_n: None, ..recording.signals().clone() },
            Gesture::Drag,
            recording.provenance().clone(),
        );
        let plain = plain.unwrap();
        assert_eq!(read(&write_hatt(&plain)).unwrap(), plain);
        let mut other = written.clone();
        other[1] = other[1].replace("<PositionUnits>mm<", "<PositionUnits>cubits<");
        let other = read(&other).unwrap();
        assert_eq!((&other.world().position_m, other.signals()), (&None, recording.signals()));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        let broken = |file: usize, from: &str, to: &str| {
            let mut triple = triple();
            triple[file] = triple[file].replace(from, to);
            read(&triple).unwrap_err().to_string()
        };
        assert!(broken(0, "-0.25", "nan").contains("Accel is not a finite number"));
        assert!(broken(1, "mm/s<", "m/s<").contains("SpeedUnits is \"m/s\""));
        assert!(broken(1, "10000", "1000").contains("its rate is 1000 Hz"));
        assert!(broken(2, "ForceNormal", "Other").contains("no values in ForceNormal"));
        assert!(broken(2, "</set>", "").contains("in the middle"));
        assert!(broken(2, "</ForceNormal>", "</Oops>").contains("the Force file, byte"));
        assert!(broken(0, "    <value>-0.25</value>\n", "").contains("normal force has 3 samples"));
    }
}
