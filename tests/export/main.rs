//! What is written, and what is measured on it.

mod files;
mod measure;
mod mesh;
