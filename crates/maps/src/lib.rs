//! Results of thirdbounce as arrays: [`maps`] of albedo, depth and normals with mask and expected depth error, and
//! their metrics against truth ([`measure`]). `thirdbounce-export` writes them to files.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

pub mod maps;
pub mod measure;
pub mod verdict;

use thirdbounce_base::error;
