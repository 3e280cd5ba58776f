//! Options of a check.

/// The set of endpoints that nodes are bound to by default.
pub(super) const SIMULATED: &str = "simulated";

/// Options of a check.
///
/// ```
/// use haptograph_engine::graph::CheckOptions;
///
/// let options = CheckOptions::default().set("stiffness", "0.25").endpoints("live").seed(7);
/// assert_eq!((options.set.len(), options.seed), (1, Some(7)));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct CheckOptions {
    /// Parameter values by name: RON, or plain text if the default is a string.
    pub set: Vec<(String, String)>,
    /// The caller's term for such a value, which errors name in place of a file.
    pub set_as: &'static str,
    /// The set of endpoints to which nodes are bound, by default `simulated`. A set that the graph does not have is an error,
    /// but for the default where a graph without sets needs no device, or the calling program has all endpoints.
    pub endpoints: String,
    /// The endpoints that belong to the calling program, whatever the set declares.
    pub hosted: Hosted,
    /// Endpoints whose values the calling program may replace while the graph runs; their devices go on meanwhile.
    pub lent: Vec<String>,
    /// Seed that replaces the graph's.
    pub seed: Option<u64>,
}

/// The endpoints of a calling program.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Hosted {
    /// Endpoints of kind `Host` in the graph.
    #[default]
    AsWritten,
    /// Those of kind `Host`, and these by name.
    Also(Vec<String>),
    /// All endpoints.
    All,
}

impl Hosted {
    pub(super) fn has(&self, name: &str) -> bool {
        match self {
            Self::AsWritten => false,
            Self::Also(names) => names.iter().any(|known| known == name),
            Self::All => true,
        }
    }
}

impl CheckOptions {
    /// Gives a parameter a value, as RON or, if its default is a string, as plain text.
    #[must_use]
    pub fn set(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.set.push((name.into(), value.into()));
        self
    }

    /// Binds the graph to this set of endpoints.
    #[must_use]
    pub fn endpoints(mut self, set: impl Into<String>) -> Self {
        self.endpoints = set.into();
        self
    }

    /// Gives the graph another seed.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = Some(seed);
        self
    }

    /// Options that give all endpoints to the calling program.
    pub fn hosted() -> Self {
        Self { hosted: Hosted::All, ..Self::default() }
    }
}

impl Default for CheckOptions {
    /// Options that bind the graph to its simulated endpoints.
    fn default() -> Self {
        Self {
            set: Vec::new(),
            set_as: "parameter",
            endpoints: SIMULATED.into(),
            hosted: Hosted::AsWritten,
            lent: Vec::new(),
            seed: None,
        }
    }
}
