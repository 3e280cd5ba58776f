//! haptograph: a dataflow signal-processing graph engine that renders the feel of real surfaces.
