//! Starts all of it, stops all of it.
