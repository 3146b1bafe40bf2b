//! A struct, a group or a folder that holds all arrays of a capture.

/// Names that say what a capture is.
const KEYS: [&str; 13] = [
    "H",
    "rect_data",
    "total_rect_data",
    "meas",
    "measlr",
    "data_t",
    "sig_in",
    "sub_Sig",
    "laserpoints",
    "cameraGridPositions",
    "laser_grid_xyz",
    "sensor_grid_xyz",
    "trans_data",
];

/// The struct or group, with its slash, that holds the arrays of the only capture of a file; `None` if the file itself holds one, or
/// several do.
pub(super) fn container(names: &[String]) -> Option<String> {
    let keys = names.iter().filter(|name| KEYS.contains(&name.rsplit('/').next().unwrap_or(name)));
    let mut folders: Vec<&str> = keys.map(|name| name.rfind('/').map_or("", |at| &name[..=at])).collect();
    folders.dedup();
    match folders[..] {
        [folder] if !folder.is_empty() && folder != "#refs#/" => Some(folder.into()),
        _ => None,
    }
}
