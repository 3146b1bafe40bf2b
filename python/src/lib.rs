//! The native part of the Python package: arrays in, arrays out. `package/thirdbounce` gives it its Python face.
//!
//! Functions take dictionaries of flat arrays and plain values, which the Python part has checked and shaped. Solves run
//! without the interpreter's lock. No panic crosses: it becomes a `DefectError`.

#![warn(clippy::too_many_lines)]

mod capture;
mod devices;
mod error;
mod maps;
mod reconstruct;
mod session;
mod settings;
mod simulate;
mod tell;

use pyo3::prelude::*;

#[pymodule(gil_used = true)]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    error::add(module)?;
    module.add_function(wrap_pyfunction!(capture::read, module)?)?;
    module.add_function(wrap_pyfunction!(capture::write, module)?)?;
    module.add_function(wrap_pyfunction!(devices::devices, module)?)?;
    module.add_function(wrap_pyfunction!(devices::close_devices, module)?)?;
    module.add_function(wrap_pyfunction!(maps::write_maps, module)?)?;
    module.add_function(wrap_pyfunction!(maps::read_maps, module)?)?;
    module.add_function(wrap_pyfunction!(maps::read_truth, module)?)?;
    module.add_function(wrap_pyfunction!(maps::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(maps::picture, module)?)?;
    module.add_function(wrap_pyfunction!(reconstruct::metres, module)?)?;
    module.add_function(wrap_pyfunction!(reconstruct::reconstruct, module)?)?;
    module.add_function(wrap_pyfunction!(settings::options, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::scenes, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_class::<maps::PageContent>()?;
    module.add_class::<session::Session>()
}
