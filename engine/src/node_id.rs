//! Identifiers of nodes, which graphs give and everything after them uses.

/// Identifier of a node: its index in file order, templates expanded. Valid in its graph only.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(u32);

impl NodeId {
    /// The node with this index, of which a graph has fewer than 2^32.
    pub(crate) fn new(index: usize) -> Self {
        Self(index as u32)
    }

    /// The index, from 0.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}
