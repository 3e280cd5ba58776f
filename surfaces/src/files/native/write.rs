//! Writes a surface as RON with its own layout, because RON's printer puts each number on a line.

use super::FORMAT;
use crate::{Recorded, Surface, Taps, TextureModel, VertexKind};
use haptograph_signal::units::decimal::format_thousandfold;
use std::fmt::Write;

/// Writes the text of a `.ron` file. Reading it gives a bitwise equal surface.
pub fn write(surface: &Surface) -> String {
    let mut out = String::from(
        "// A haptograph surface. Speeds in mm/s, forces in N, accelerations in m/s2, line spectral frequencies in radians.\n",
    );
    // Writing to a string cannot fail.
    let _ = write_surface(&mut out, surface);
    out
}

fn write_surface(out: &mut String, surface: &Surface) -> std::fmt::Result {
    writeln!(out, "Surface(\n    format: {FORMAT},\n    name: {},", quoted(&surface.name))?;
    let provenance = &surface.provenance;
    writeln!(out, "    provenance: (\n        origin: {},", provenance.origin.as_str())?;
    writeln!(out, "        source: {},", quoted(&provenance.source))?;
    writeln!(out, "        made_by: {},", quoted(&provenance.version))?;
    if !provenance.settings.is_empty() {
        writeln!(out, "        settings: {{")?;
        for (name, value) in &provenance.settings {
            writeln!(out, "            {}: {},", quoted(name), quoted(value))?;
        }
        writeln!(out, "        }},")?;
    }
    writeln!(out, "    ),")?;
    if let Some(friction) = surface.friction {
        write!(out, "    friction: (mu: {:?}", friction.mu())?;
        if let Some(peak) = friction.peak() {
            let speed = format_thousandfold(peak.stribeck_m_s());
            write!(out, ", static_ratio: {:?}, stribeck_mm_s: {speed}", peak.ratio())?;
        }
        write_r_squared(out, friction.r_squared())?;
    }
    if let Some(stiffness) = surface.stiffness {
        write!(out, "    stiffness: (n_per_mm: {:?}", stiffness.n_per_mm())?;
        write_r_squared(out, stiffness.r_squared())?;
    }
    if let Some(taps) = &surface.taps {
        write_taps(out, taps)?;
    }
    if let Some(texture) = &surface.texture {
        write_texture(out, texture)?;
    }
    writeln!(out, ")")
}

fn write_r_squared(out: &mut String, r_squared: Option<f64>) -> std::fmt::Result {
    match r_squared {
        Some(r_squared) => writeln!(out, ", r_squared: {r_squared:?}),"),
        None => writeln!(out, "),"),
    }
}

fn write_taps(out: &mut String, taps: &Taps) -> std::fmt::Result {
    writeln!(out, "    taps: (\n        rate_hz: {:?},\n        taps: [", taps.rate_hz())?;
    for tap in taps.taps() {
        writeln!(out, "            (\n                speed_mm_s: {},", format_thousandfold(tap.speed_m_s))?;
        if let Some(peak_force_n) = tap.peak_force_n {
            writeln!(out, "                peak_force_n: {peak_force_n:?},")?;
        }
        write_numbers(out, "                acceleration_m_s2: ", &tap.acceleration_m_s2)?;
        writeln!(out, "            ),")?;
    }
    writeln!(out, "        ],\n    ),")
}

fn write_texture(out: &mut String, texture: &TextureModel) -> std::fmt::Result {
    let (filters, filter_of) = texture.distinct_filters();
    writeln!(out, "    texture: (\n        rate_hz: {:?},", texture.rate_hz())?;
    let is_warped = texture.warping() != 0.0;
    if is_warped {
        writeln!(out, "        warping: {:?},", texture.warping())?;
    }
    if let Some(highpass_hz) = texture.highpass_hz() {
        writeln!(out, "        highpass_hz: {highpass_hz:?},")?;
    }
    if let Some(Recorded { speed_m_s: (slow, fast), force_n }) = texture.recorded {
        let (slow, fast) = (format_thousandfold(slow), format_thousandfold(fast));
        writeln!(out, "        recorded: (speed_mm_s: ({slow}, {fast}), force_n: {force_n:?}),")?;
    }
    for layer in &texture.layers {
        layer.write(out)?;
    }
    writeln!(out, "        filters: [")?;
    for filter in filters {
        writeln!(out, "            (")?;
        if !is_warped {
            write_numbers(out, "                ar: ", filter.ar())?;
        }
        write_numbers(out, "                ar_lsf: ", filter.ar_lsf())?;
        if !filter.ma().is_empty() {
            write_numbers(out, "                ma: ", filter.ma())?;
            write_numbers(out, "                ma_lsf: ", filter.ma_lsf())?;
        }
        if filter.gain() != 1.0 {
            writeln!(out, "                gain: {:?},", filter.gain())?;
        }
        writeln!(out, "            ),")?;
    }
    writeln!(out, "        ],\n        vertices: [")?;
    for (at, filter) in texture.models().iter().zip(filter_of) {
        let kind = match at.kind {
            VertexKind::Measured => "measured",
            VertexKind::Fitted => "fitted",
            VertexKind::Edge => "edge",
        };
        let level = if is_warped {
            format!("power_m2_s4: {:?}", at.model.power())
        } else {
            format!("variance: {:?}", at.model.variance())
        };
        writeln!(
            out,
            "            (speed_mm_s: {}, force_n: {:?}, filter: {filter}, {level}, kind: {kind}),",
            format_thousandfold(at.speed_m_s),
            at.force_n,
        )?;
    }
    writeln!(out, "        ],\n        triangles: [")?;
    for row in texture.triangles().chunks(8) {
        let row: Vec<String> = row.iter().map(|[a, b, c]| format!("({a}, {b}, {c}),")).collect();
        writeln!(out, "            {}", row.join(" "))?;
    }
    writeln!(out, "        ],\n    ),")
}

/// A list of numbers, wrapped.
pub(crate) fn write_numbers(out: &mut String, head: &str, numbers: &[f64]) -> std::fmt::Result {
    const WIDTH: usize = 110;
    let indent = head.len() - head.trim_start().len() + 4;
    out.push_str(head);
    out.push('[');
    let mut column = WIDTH;
    for number in numbers {
        let number = format!("{number:?},");
        if column + 1 + number.len() > WIDTH {
            write!(out, "\n{:indent$}", "")?;
            column = indent;
        } else {
            out.push(' ');
            column += 1;
        }
        out.push_str(&number);
        column += number.len();
    }
    if !numbers.is_empty() {
        write!(out, "\n{:width$}", "", width = indent - 4)?;
    }
    out.push_str("],\n");
    Ok(())
}

/// Quotes text for RON. Escapes quotes, backslashes and control characters only.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\n' => quoted.push_str("\\n"),
            c if c.is_control() => quoted.push_str(&format!("\\u{{{:x}}}", c as u32)),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}
