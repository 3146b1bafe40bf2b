//! Result files, and metrics of results.

mod files;
mod measure;
mod mesh;
