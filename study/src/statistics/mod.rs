//! Tests, intervals and fits of what participants answered.
