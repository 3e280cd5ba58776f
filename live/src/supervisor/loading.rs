//! Loading of a graph while another one runs, on a thread of its own that may be slow, hang or panic. The
//! caller polls the result and abandons it after a time limit.

use crate::protected::Protected;
use crate::watch::{FileWatch, stamp};
use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::registry::Registry;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::time::{Duration, Instant, SystemTime};

/// Time limit of a load.
pub(super) const BUDGET: Duration = Duration::from_secs(10);
/// Maximum number of abandoned threads that still hang; beyond it nothing is loaded.
const MAX_HANGING: usize = 4;
/// A file written this shortly before it was read may change again without a newer time stamp.
const SETTLED: Duration = Duration::from_secs(1);

/// Parameters set by name, each with the default that the file had at that time.
pub(super) type ParameterDefaults = Vec<(String, Option<String>)>;

/// A graph file, and the values that override its defaults.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct GraphSource {
    /// The file.
    pub path: PathBuf,
    /// Values of its parameters, by name.
    pub set: Vec<(String, String)>,
    /// The set of endpoints to bind the devices to, for the whole run; none: `live` if the graph has it when it is first
    /// loaded, else `simulated`.
    pub endpoints: Option<String>,
    /// The seed of all random streams, in place of the graph's own.
    pub seed: Option<u64>,
}

impl GraphSource {
    /// A graph with the defaults of its file.
    pub fn of(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), set: Vec::new(), endpoints: None, seed: None }
    }
}

/// A graph to load, with its parameters. A [`LoadFn`] passes it to [`load`].
#[derive(Clone)]
pub struct Job {
    pub(super) source: GraphSource,
    /// Set after a save: parameters whose defaults have changed in the file are no longer overridden by typed
    /// values.
    pub(super) saved: Option<SavedOverrides>,
    /// The document from the previous load.
    pub(super) known: Option<KnownDocument>,
}

impl Job {
    /// The first job for a graph.
    pub(super) fn first(source: &GraphSource) -> Self {
        Self { source: source.clone(), saved: None, known: None }
    }
}

/// Parameters that a save may reset.
#[derive(Clone)]
pub(super) struct SavedOverrides {
    pub given: Vec<(String, String)>,
    pub typed: ParameterDefaults,
}

/// A document with the time stamps of its files, kept only if a later change would alter them.
#[derive(Clone)]
pub(super) struct KnownDocument {
    document: Arc<Document>,
    stamps: Vec<(PathBuf, (SystemTime, u64))>,
}

/// Result of a [`load`].
pub struct LoadOutcome {
    pub(super) result: Result<LoadedGraph, Diagnostics>,
    /// The set of endpoints that it is bound to.
    pub(super) endpoints: Option<String>,
    /// The parameters used for the load, and those of them that were typed.
    pub(super) set: Vec<(String, String)>,
    pub(super) typed: Option<ParameterDefaults>,
    /// The parameters of the file, with their defaults.
    pub(super) parameters: ParameterDefaults,
    pub(super) known: Option<KnownDocument>,
}

/// A checked graph with the data that a swap needs.
pub(super) struct LoadedGraph {
    pub graph: Graph,
    pub watch: FileWatch,
    pub protected: Protected,
    pub texts: Vec<String>,
}

/// Function that loads a changed graph, on a thread of its own: [`load`], or a function that wraps it.
///
/// ```
/// use haptograph_engine::registry::Registry;
/// use haptograph_live::supervisor::{Job, LoadOutcome, RunOptions, load};
/// use std::sync::atomic::{AtomicU32, Ordering};
///
/// static LOADS: AtomicU32 = AtomicU32::new(0);
///
/// fn load_and_count(job: Job, registry: &Registry) -> LoadOutcome {
///     LOADS.fetch_add(1, Ordering::Relaxed);
///     load(job, registry)
/// }
///
/// let mut options = RunOptions::of("graph.ron");
/// options.load = load_and_count;
/// ```
pub type LoadFn = fn(Job, &Registry) -> LoadOutcome;

/// Loads graphs, one at a time.
pub(super) struct Loader {
    load: LoadFn,
    /// The node and device kinds that graphs can use.
    registry: Arc<Registry>,
    /// Counts the running threads; each holds a clone.
    working: Arc<()>,
}

/// A load in progress.
pub(super) struct Loading {
    began: Instant,
    result: Receiver<std::thread::Result<LoadOutcome>>,
}

impl Loader {
    /// Loads by a function.
    pub(super) fn new(load: LoadFn, registry: &Registry) -> Self {
        Self { load, registry: Arc::new(registry.clone()), working: Arc::default() }
    }

    /// Starts a load.
    ///
    /// # Errors
    /// A message if too many earlier loads hang, or if no thread can be started.
    pub(super) fn begin(&self, job: Job) -> Result<Loading, String> {
        if Arc::strong_count(&self.working) > MAX_HANGING {
            return Err(format!("{MAX_HANGING} earlier loads have not finished"));
        }
        let (sender, result) = sync_channel(1);
        let (load, registry) = (self.load, Arc::clone(&self.registry));
        let working = Arc::clone(&self.working);
        std::thread::Builder::new()
            .name("haptograph-loading".to_owned())
            .spawn(move || {
                let loaded = catch_unwind(AssertUnwindSafe(|| load(job, &registry)));
                drop(working);
                // The load may have been abandoned.
                let _ = sender.send(loaded);
            })
            .map_err(|error| format!("cannot start a thread to load it: {error}"))?;
        let began = Instant::now();
        Ok(Loading { began, result })
    }
}

impl Loading {
    /// The result if the load has finished. Resumes a panic of the loading thread.
    pub(super) fn poll(&self) -> Option<LoadOutcome> {
        match self.result.try_recv() {
            Ok(Ok(loaded)) => Some(loaded),
            Ok(Err(panic)) => resume_unwind(panic),
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => None,
        }
    }

    /// Time since the load began.
    pub(super) fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }
}

/// Loads and checks a graph and derives the data that a swap needs.
///
/// Slow: it reads files.
pub fn load(mut job: Job, registry: &Registry) -> LoadOutcome {
    let document = read(&job.source.path, job.known.take());
    let (document, known) = match document {
        Ok(read) => read,
        Err(wrong) => {
            return LoadOutcome {
                result: Err(wrong),
                endpoints: job.source.endpoints,
                set: job.source.set,
                typed: None,
                parameters: Vec::new(),
                known: None,
            };
        }
    };
    let parameters = document.parameters();
    let parameters: ParameterDefaults =
        parameters.map(|(name, text)| (name.to_owned(), Some(text.to_owned()))).collect();
    let typed = job.saved.take().map(|saved| saved.reset(&mut job.source.set, &parameters));
    let endpoints = endpoints(&job.source, &document);
    let mut options = CheckOptions::default().endpoints(&endpoints);
    options.set.clone_from(&job.source.set);
    options.seed = job.source.seed;
    let graph = check(&document, registry, &options);
    LoadOutcome {
        result: graph.map(LoadedGraph::of),
        endpoints: Some(endpoints),
        set: job.source.set,
        typed,
        parameters,
        known,
    }
}

/// The set of endpoints of a graph.
fn endpoints(source: &GraphSource, document: &Document) -> String {
    let live = || document.endpoints().find(|set| *set == "live");
    let set = source.endpoints.as_deref().or_else(live);
    set.unwrap_or("simulated").to_owned()
}

/// Reads the document, or reuses the known one if its files are unchanged; also returns what the next load
/// may reuse.
fn read(
    path: &Path,
    known: Option<KnownDocument>,
) -> Result<(Arc<Document>, Option<KnownDocument>), Diagnostics> {
    if let Some(known) = known
        && known.stamps.iter().all(|(path, then)| stamp(path) == Some(*then))
    {
        return Ok((Arc::clone(&known.document), Some(known)));
    }
    let began = SystemTime::now();
    let document = Arc::new(Document::load(path, &LoadOptions::default())?);
    let files = document.sources().iter().map(|source| source.path.clone());
    let stamps: Option<Vec<_>> = files.map(|path| Some((path.clone(), stamp(&path)?))).collect();
    let settled = |(time, _): (SystemTime, u64)| began.duration_since(time).is_ok_and(|age| age > SETTLED);
    let stamps = stamps.filter(|stamps| stamps.iter().all(|(_, stamp)| settled(*stamp)));
    let known = stamps.map(|stamps| KnownDocument { document: Arc::clone(&document), stamps });
    Ok((document, known))
}

impl SavedOverrides {
    /// Resets typed parameters whose defaults the file has changed; returns the remaining typed ones.
    fn reset(self, set: &mut Vec<(String, String)>, parameters: &ParameterDefaults) -> ParameterDefaults {
        let default = |name: &str| parameters.iter().find(|(known, _)| known == name);
        let (same, other): (ParameterDefaults, ParameterDefaults) = self
            .typed
            .into_iter()
            .partition(|(name, then)| default(name).and_then(|(_, now)| now.clone()) == *then);
        for (name, _) in &other {
            set.retain(|(known, _)| known != name);
            set.extend(self.given.iter().find(|(known, _)| known == name).cloned());
        }
        same
    }
}

impl LoadedGraph {
    fn of(graph: Graph) -> Self {
        Self { watch: FileWatch::of(&graph), protected: Protected::of(&graph), texts: texts(&graph), graph }
    }
}

/// The texts of a graph's files, without those given on the command line.
pub(super) fn texts(graph: &Graph) -> Vec<String> {
    let files = graph.sources().iter().filter(|source| source.is_file);
    files.map(|source| source.text.to_string()).collect()
}
