//! Results of thirdbounce as arrays: [`maps`] of albedo, depth and normals with mask and confidence, and what they
//! [`measure`] against truth. Files of them are written by `thirdbounce-export`.

#![deny(missing_docs)]
#![warn(clippy::too_many_lines)]

pub mod maps;
pub mod measure;

use thirdbounce_base::error;
