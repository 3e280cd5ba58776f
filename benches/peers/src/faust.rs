//! Faust's compiled code, in f64: a C function, built with and without `-ffast-math`, called once a block.

use crate::work::{Contestant, Operation, RATE_HZ, Source, Work};
use libloading::{Library, Symbol};
use std::ffi::{c_int, c_void};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

type Compute = unsafe extern "C" fn(*mut c_void, c_int, *mut *mut f64, *mut *mut f64);

/// How the C of Faust is compiled.
#[derive(Debug, Clone, Copy)]
pub enum Rounding {
    /// As the IEEE says, as ours.
    Strict,
    Fast,
}

pub struct InFaust {
    name: &'static str,
    dsp: *mut c_void,
    compute: Compute,
    block: usize,
    input: Vec<f64>,
    output: Vec<f64>,
    /// Holds the code.
    _library: Library,
}

impl InFaust {
    /// The work, compiled; `None` where there is no Faust or C compiler.
    pub fn new(work: &Work, input: &[f32], rounding: Rounding, without_avx512: bool) -> Option<Self> {
        let folder = tempfile::tempdir().ok()?;
        let object = compile(folder.path(), &source(work), rounding, without_avx512)?;
        let (name, input) = (
            match rounding {
                Rounding::Strict => "Faust",
                Rounding::Fast => "Faust, fast",
            },
            input.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>(),
        );
        // SAFETY: the object is the C that Faust wrote, whose functions have these types.
        unsafe {
            let library = Library::new(object).ok()?;
            let make: Symbol<unsafe extern "C" fn() -> *mut c_void> = library.get(b"newmydsp\0").ok()?;
            let init: Symbol<unsafe extern "C" fn(*mut c_void, c_int)> = library.get(b"initmydsp\0").ok()?;
            let compute = *library.get::<Compute>(b"computemydsp\0").ok()?;
            let dsp = make();
            init(dsp, RATE_HZ as c_int);
            let output = vec![0.0; input.len()];
            Some(Self { name, dsp, compute, block: work.block, input, output, _library: library })
        }
    }
}

impl Contestant for InFaust {
    fn name(&self) -> &'static str {
        self.name
    }

    fn run(&mut self) {
        let Self { dsp, compute, block, input, output, .. } = self;
        for (x, y) in input.chunks_exact_mut(*block).zip(output.chunks_exact_mut(*block)) {
            let (mut x, mut y) = (x.as_mut_ptr(), y.as_mut_ptr());
            // SAFETY: both buffers hold a block; the function has one input and one output.
            unsafe { compute(*dsp, *block as c_int, &raw mut x, &raw mut y) };
        }
    }

    fn output(&self) -> Vec<f64> {
        self.output.clone()
    }
}

/// The work in Faust.
fn source(work: &Work) -> String {
    let mut text = String::from(
        "section(b0, b1, b2, a1, a2) = (+ ~ \\(w).(0 - a1 * w - a2 * w')) : \\(w).(b0 * w + b1 * w' + b2 * w'');\n",
    );
    let name = |source: &Source| match source {
        Source::Input => "x".to_owned(),
        Source::Node(from) => format!("n{from}"),
    };
    let is_chain = work.nodes.iter().all(|node| node.sources.len() == 1);
    let of = |operation: Operation| match operation {
        Operation::Gain(gain) => format!("*({:?})", f64::from(gain)),
        Operation::Offset(offset) => format!("+({:?})", f64::from(offset)),
        Operation::Biquad { b: [b0, b1, b2], a: [a1, a2], .. } => {
            let [b0, b1, b2, a1, a2] = [b0, b1, b2, a1, a2].map(f64::from);
            format!("section({b0:?}, {b1:?}, {b2:?}, {a1:?}, {a2:?})")
        }
    };
    if is_chain {
        let nodes: Vec<String> = work.nodes.iter().map(|node| of(node.operation)).collect();
        let _ = writeln!(text, "process = {};", nodes.join(" : "));
        return text;
    }
    let _ = writeln!(text, "process(x) = n{} with {{", work.nodes.len() - 1);
    for (number, node) in work.nodes.iter().enumerate() {
        let sources: Vec<String> = node.sources.iter().map(name).collect();
        let _ = writeln!(text, "n{number} = ({}) : {};", sources.join(" + "), of(node.operation));
    }
    text + "};\n"
}

/// What the C of Faust needs of its headers.
const GLUE: &str = "#define FAUSTFLOAT double
typedef struct { void* uiInterface; void (*openVerticalBox)(void*, const char*); void (*closeBox)(void*); } UIGlue;
typedef struct { void* metaInterface; void (*declare)(void*, const char*, const char*); } MetaGlue;
#include \"work.faust.c\"
";

fn compile(folder: &Path, text: &str, rounding: Rounding, without_avx512: bool) -> Option<PathBuf> {
    std::fs::write(folder.join("work.dsp"), text).ok()?;
    std::fs::write(folder.join("work.c"), GLUE).ok()?;
    let succeeds =
        |command: &mut Command| command.current_dir(folder).status().is_ok_and(|status| status.success());
    let faust = ["-double", "-lang", "c", "work.dsp", "-o", "work.faust.c"];
    let flags: &[&str] = match rounding {
        Rounding::Strict => &["-ffp-contract=off", "-fno-fast-math"],
        Rounding::Fast => &["-ffast-math"],
    };
    let mut compiler = Command::new("gcc");
    compiler.args(["-O3", "-march=native", "-fPIC", "-c", "work.c", "-o", "work.o"]).args(flags);
    if without_avx512 {
        compiler.arg("-mno-avx512f");
    }
    // Linked with -ffast-math, the library would let the processor round denormals of every contestant to zero.
    let linked = ["-shared", "work.o", "-o", "work.so", "-lm"];
    let is_made = succeeds(Command::new("faust").args(faust))
        && succeeds(&mut compiler)
        && succeeds(Command::new("gcc").args(linked));
    is_made.then(|| folder.join("work.so"))
}
