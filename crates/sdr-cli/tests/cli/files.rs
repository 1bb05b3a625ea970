//! Commands that read files.
