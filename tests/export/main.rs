//! Result files, and metrics of results.

mod files;
mod foreign;
mod measure;
mod mesh;
