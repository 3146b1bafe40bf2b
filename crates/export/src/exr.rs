//! Maps as an OpenEXR picture.
//!
//! One part with named layers in the convention of viewers and compositing programs (`layer.channel`): `albedo.Y`,
//! `depth.Z`, `normal.X`, `normal.Y`, `normal.Z`, `mask.Y` (1 = surface, else 0), and the albedo again as the plain channel
//! `Y` for viewers without layers. The expected depth error, if known, is `depth_error.Z`, the probability of surface `probability.Y`. A second layer, if any, is
//! `behind.albedo.Y`, `behind.depth.Z`, `behind.normal.X` to `Z`, `behind.mask.Y` and `behind.depth_error.Z`. 32-bit floats,
//! NaN = no depth. The top row
//! is the largest y, the left column the largest x, as seen from the wall. The attribute `extent` (box2f) is the
//! extent in metres.

use std::io::Cursor;
use std::path::Path;

use exr::meta::attribute::FloatRect;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec,
    Text, Vec2, WritableImage,
};

use super::picture;
use crate::error::{Error, Result};
use crate::maps::Maps;

/// Writes the maps.
///
/// # Errors
/// `Kind::Input` if the sizes do not agree, `Kind::Output` if the file cannot be written.
pub fn write(path: &Path, maps: &Maps) -> Result<()> {
    super::put(path, maps, bytes)
}

/// The file of [`write`].
pub(super) fn bytes(maps: &Maps) -> Result<Vec<u8>> {
    let rows = picture::rows(maps);
    let channel = |name: &str, value: &dyn Fn(usize) -> f32| {
        AnyChannel::new(name, FlatSamples::F32(rows.iter().map(|&p| value(p)).collect()))
    };
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = [
        channel("Y", &|p| maps.albedo[p]),
        channel("albedo.Y", &|p| maps.albedo[p]),
        channel("depth.Z", &|p| maps.depth[p]),
        channel("normal.X", &|p| maps.normal[p][0]),
        channel("normal.Y", &|p| maps.normal[p][1]),
        channel("normal.Z", &|p| maps.normal[p][2]),
        channel("mask.Y", &|p| f32::from(maps.mask[p])),
    ]
    .into_iter()
    .collect();
    channels.extend(maps.depth_error.iter().map(|values| channel("depth_error.Z", &|p| values[p])));
    channels.extend(maps.probability.iter().map(|values| channel("probability.Y", &|p| values[p])));
    if let Some(behind) = &maps.behind {
        channels
            .extend(behind.depth_error.iter().map(|values| channel("behind.depth_error.Z", &|p| values[p])));
        channels.extend([
            channel("behind.albedo.Y", &|p| behind.albedo[p]),
            channel("behind.depth.Z", &|p| behind.depth[p]),
            channel("behind.normal.X", &|p| behind.normal[p][0]),
            channel("behind.normal.Y", &|p| behind.normal[p][1]),
            channel("behind.normal.Z", &|p| behind.normal[p][2]),
            channel("behind.mask.Y", &|p| f32::from(behind.mask[p])),
        ]);
    }
    let mut attributes = LayerAttributes::named("maps");
    attributes.software_name = Some(Text::from("thirdbounce"));
    // Only one attribute: the library stores these in a hash map of random order.
    let [x0, x1, y0, y1] = maps.extent.map(|v| v as f32);
    let extent = FloatRect { min: Vec2(x0, y0), max: Vec2(x1, y1) };
    attributes.other.insert(Text::from("extent"), AttributeValue::FloatRect(extent));
    let layer =
        Layer::new((maps.nx, maps.ny), attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels));
    let mut bytes = Cursor::new(Vec::new());
    // One thread: the order of blocks, and hence the bytes, must not depend on timing.
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|e| Error::output(format!("cannot be packed as EXR: {e}"), "free some memory"))?;
    Ok(bytes.into_inner())
}
