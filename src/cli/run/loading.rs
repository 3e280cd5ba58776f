//! Loading a graph while another runs: on a thread of its own, which may take its time, hang or panic. Whoever asked
//! looks in on it, and gives it up when there is no more time for it.

use super::super::GraphArguments;
use super::guards::Guards;
use super::watch::{Watch, stamp};
use super::{Arguments, spare_own_files};
use crate::engine::diagnostic::Diagnostics;
use crate::engine::document::{Document, LoadOptions};
use crate::engine::graph::{CheckOptions, Graph, check};
use crate::engine::registry::Registry;
use crate::nodes::soundcard::{Wanted, wanted};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::time::{Duration, Instant, SystemTime};

/// How long a graph may take to load while another runs.
pub const BUDGET: Duration = Duration::from_secs(10);
/// Threads that were given up and hang still, beyond which nothing is loaded any more.
const MOST_HANGING: usize = 4;
/// A file that was written so shortly before it was read may be written again without looking any newer.
const SETTLED: Duration = Duration::from_secs(1);

/// Parameters by name that were typed or told, with the default that the file had for each then.
pub type Typed = Vec<(String, Option<String>)>;

/// What is to be loaded.
#[derive(Clone)]
pub struct Job {
    pub arguments: GraphArguments,
    pub seed: Option<u64>,
    pub record: bool,
    /// After a save: parameters whose defaults are others now are the file's again, or as the command line gave them.
    pub saved: Option<Saved>,
    /// The document as it was read before.
    pub known: Option<Known>,
}

impl Job {
    /// The graph of the command line.
    pub fn first(arguments: &Arguments) -> Self {
        Self {
            arguments: arguments.graph.clone(),
            seed: arguments.seed,
            record: arguments.record,
            saved: None,
            known: None,
        }
    }
}

/// What a save may take back.
#[derive(Clone)]
pub struct Saved {
    pub given: Vec<(String, String)>,
    pub typed: Typed,
}

/// A document, and its files as they were then; only where they would look different if they were others now.
#[derive(Clone)]
pub struct Known {
    document: Arc<Document>,
    stamps: Vec<(PathBuf, (SystemTime, u64))>,
}

/// What came of it.
pub struct Loaded {
    pub result: Result<Ready, Diagnostics>,
    /// The parameters with which it was loaded, and which of them were typed.
    pub set: Vec<(String, String)>,
    pub typed: Option<Typed>,
    /// The parameters that the file has, with their defaults.
    pub parameters: Typed,
    pub known: Option<Known>,
}

/// A sound graph, and what has to be known of it before it takes over.
pub struct Ready {
    pub graph: Graph,
    pub watch: Watch,
    pub guards: Guards,
    pub wanted: Result<Wanted, String>,
    pub own_files: Result<(), String>,
    pub texts: Vec<String>,
}

/// How a graph is loaded.
pub type Work = fn(Job, &Registry) -> Loaded;

/// Loads graphs, one at a time.
pub struct Loader {
    work: Work,
    /// The kinds that graphs can use.
    registry: Arc<Registry>,
    /// Held by every thread that works, too.
    working: Arc<()>,
}

/// A graph that is being loaded.
pub struct Loading {
    began: Instant,
    result: Receiver<std::thread::Result<Loaded>>,
}

impl Loader {
    pub fn new(work: Work, registry: &Registry) -> Self {
        Self {
            work,
            registry: Arc::new(registry.clone()),
            working: Arc::default(),
        }
    }

    /// The kinds that graphs can use.
    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// Begins to load.
    ///
    /// # Errors
    /// Why nothing is loaded any more.
    pub fn begin(&self, job: Job) -> Result<Loading, String> {
        if Arc::strong_count(&self.working) > MOST_HANGING {
            return Err(format!("{MOST_HANGING} graphs before it are loading still"));
        }
        let (told, result) = sync_channel(1);
        let (work, registry) = (self.work, Arc::clone(&self.registry));
        let working = Arc::clone(&self.working);
        std::thread::Builder::new()
            .name("haptograph-loading".to_owned())
            .spawn(move || {
                let loaded = catch_unwind(AssertUnwindSafe(|| work(job, &registry)));
                drop(working);
                // It may have been given up.
                let _ = told.send(loaded);
            })
            .map_err(|error| format!("no thread to load it: {error}"))?;
        let began = Instant::now();
        Ok(Loading { began, result })
    }
}

impl Loading {
    /// What came of it, if it is over. A panic goes on here.
    pub fn look(&self) -> Option<Loaded> {
        match self.result.try_recv() {
            Ok(Ok(loaded)) => Some(loaded),
            Ok(Err(panic)) => resume_unwind(panic),
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => None,
        }
    }

    pub fn took(&self) -> Duration {
        self.began.elapsed()
    }
}

/// Loads a graph, proves it sound, and looks at what it asks for.
pub fn load(mut job: Job, registry: &Registry) -> Loaded {
    let document = read(&job.arguments.graph, job.known.take());
    let (document, known) = match document {
        Ok(read) => read,
        Err(wrong) => {
            return Loaded {
                result: Err(wrong),
                set: job.arguments.set,
                typed: None,
                parameters: Vec::new(),
                known: None,
            };
        }
    };
    let parameters = document.parameters();
    let parameters: Typed = parameters
        .map(|(name, text)| (name.to_owned(), Some(text.to_owned())))
        .collect();
    let typed = job
        .saved
        .take()
        .map(|saved| saved.take_back(&mut job.arguments.set, &parameters));
    let options = CheckOptions {
        set: job.arguments.set.clone(),
        endpoints: job.arguments.endpoints().to_owned(),
        seed: job.seed,
        ..CheckOptions::default()
    };
    let graph = check(&document, registry, &options);
    Loaded {
        result: graph.map(|graph| Ready::of(graph, job.record)),
        set: job.arguments.set,
        typed,
        parameters,
        known,
    }
}

/// The document, read again only where a file of it may have changed, and what is to be known of it the next time.
fn read(path: &Path, known: Option<Known>) -> Result<(Arc<Document>, Option<Known>), Diagnostics> {
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
    let known = stamps.map(|stamps| Known {
        document: Arc::clone(&document),
        stamps,
    });
    Ok((document, known))
}

impl Saved {
    /// Takes back what was typed where the file says something else now; what stays typed.
    fn take_back(self, set: &mut Vec<(String, String)>, parameters: &Typed) -> Typed {
        let default = |name: &str| parameters.iter().find(|(known, _)| known == name);
        let (same, other): (Typed, Typed) = self
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

impl Ready {
    fn of(graph: Graph, record: bool) -> Self {
        Self {
            watch: Watch::of(&graph),
            guards: Guards::of(&graph),
            wanted: wanted(&graph).map_err(|error| error.to_string()),
            own_files: spare_own_files(&graph, record),
            texts: texts(&graph),
            graph,
        }
    }
}

/// The texts of a graph's files; what was given on the command line has no file.
pub fn texts(graph: &Graph) -> Vec<String> {
    let files = graph.sources().iter().filter(|source| source.is_file);
    files.map(|source| source.text.to_string()).collect()
}
