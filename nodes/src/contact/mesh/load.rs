//! Meshes from files.

use super::{MeshError, TriangleMesh};
use crate::vector::Vec3;
use haptograph_signal::files::MAX_TRIANGLES;
use std::fmt;
use std::io::{Cursor, ErrorKind};

/// File formats of meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    /// Stereolithography, binary or text.
    Stl,
    /// Wavefront object.
    Obj,
}

impl MeshFormat {
    /// The format of a file name's extension, in any case.
    pub fn of(path: &std::path::Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "stl" => Some(Self::Stl),
            "obj" => Some(Self::Obj),
            _ => None,
        }
    }
}

impl fmt::Display for MeshFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stl => "STL",
            Self::Obj => "OBJ",
        })
    }
}

impl TriangleMesh {
    /// A mesh from a file's bytes. Neither format knows units: `unit_m` is the metres of one unit, 0.001 for mm.
    pub fn from_bytes(bytes: &[u8], format: MeshFormat, unit_m: f64) -> Result<Self, MeshError> {
        if !(unit_m > 0.0 && unit_m.is_finite()) {
            return Err(MeshError::BadUnit { unit_m });
        }
        let (corners, triangles) = match format {
            MeshFormat::Stl => stl(bytes)?,
            MeshFormat::Obj => obj(bytes)?,
        };
        let corners: Vec<Vec3> = corners.into_iter().map(|c| c.map(|x| x * unit_m)).collect();
        Self::new(&corners, &triangles)
    }
}

type Soup = (Vec<Vec3>, Vec<[u32; 3]>);

fn stl(bytes: &[u8]) -> Result<Soup, MeshError> {
    let format = MeshFormat::Stl;
    let problem = |error: std::io::Error| match error.kind() {
        ErrorKind::UnexpectedEof => MeshError::Incomplete { format },
        _ => MeshError::Unreadable { format, problem: error.to_string() },
    };
    let mut source = Cursor::new(bytes);
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for triangle in stl_io::create_stl_reader(&mut source).map_err(problem)? {
        let first =
            u32::try_from(corners.len()).ok().filter(|n| *n < u32::MAX - 3).ok_or(MeshError::TooLarge)?;
        for vertex in triangle.map_err(problem)?.vertices {
            corners.push([0, 1, 2].map(|i| f64::from(vertex[i])));
        }
        triangles.push([first, first + 1, first + 2]);
    }
    Ok((corners, triangles))
}

fn obj(bytes: &[u8]) -> Result<Soup, MeshError> {
    // Normals and places in pictures are ignored, and the reader's sums of their numbers overflow.
    let is_ignored = |line: &[u8]| {
        let first = std::str::from_utf8(line).ok().and_then(|line| line.split_whitespace().next());
        matches!(first, Some("vn" | "vt"))
    };
    let lines = || bytes.split_inclusive(|byte| *byte == b'\n');
    // A face is three bytes a corner, and much more in memory.
    let triangles = |line: &[u8]| {
        let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match line.trim_ascii_start() {
            [b'f', b' ' | b'\t', ..] => words.count().saturating_sub(3),
            _ => 0,
        }
    };
    if lines().map(triangles).sum::<usize>() > MAX_TRIANGLES {
        return Err(MeshError::TooLarge);
    }
    let mut read = Vec::with_capacity(bytes.len());
    lines().filter(|line| !is_ignored(line)).for_each(|line| read.extend_from_slice(line));
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    // Materials are ignored: every material file is taken as empty.
    let (models, _) = tobj::load_obj_buf(&mut &read[..], &options, |_| Ok((Vec::new(), Default::default())))
        .map_err(|error| MeshError::Unreadable { format: MeshFormat::Obj, problem: error.to_string() })?;
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for model in models {
        let first = u32::try_from(corners.len()).map_err(|_| MeshError::TooLarge)?;
        corners.extend(model.mesh.positions.chunks_exact(3).map(|c| [0, 1, 2].map(|i| f64::from(c[i]))));
        for t in model.mesh.indices.chunks_exact(3) {
            let named = |i: u32| first.checked_add(i).ok_or(MeshError::TooLarge);
            triangles.push([named(t[0])?, named(t[1])?, named(t[2])?]);
        }
    }
    Ok((corners, triangles))
}
