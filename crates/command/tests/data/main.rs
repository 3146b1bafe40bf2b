//! Tests with real captures, and with other programs.
//!
//! A test whose captures or Python packages are missing is shown as ignored. THIRDBOUNCE_DATA names the folder of captures,
//! THIRDBOUNCE_PYTHON a Python (else `python3`).

mod batch;
mod learn;
mod native;
mod opened;
mod others;
mod positions;
mod real;
mod recipes;
mod scipy;
mod tags;
mod ytal;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use libtest_mimic::{Arguments, Failed, Trial};

/// Trials of functions that take a path; ignored where there is none.
macro_rules! trials {
    ($what:literal, $path:expr, $($name:path),* $(,)?) => {
        [$(trial(stringify!($name), $what, $path.clone(), $name)),*]
    };
}

fn main() -> ExitCode {
    let data = std::env::var_os("THIRDBOUNCE_DATA").map(PathBuf::from).filter(|folder| folder.is_dir());
    let python = std::env::var_os("THIRDBOUNCE_PYTHON").map_or("python3".into(), PathBuf::from);
    let with = |packages: &str| Some(python.clone()).filter(|python| has(python, packages));
    let mut all = vec![];
    all.extend(trials![
        "needs THIRDBOUNCE_DATA",
        data,
        native::stanford_statue,
        native::lct_letters,
        native::one_array_of_v73,
        native::ccsocr_statue,
        native::ytal_files_equal_their_twins,
        native::a_folder_of_many_captures_is_no_capture,
        real::real_captures_are_read_and_gated,
        real::npz_and_ytal_twins_agree,
        real::real_truth_is_read,
        real::normals_of_a_captured_wall_agree_with_its_own,
        real::real_captures_go_from_any_form_to_any,
        real::real_captures_raise_no_false_warning,
        real::trials_tell_how_captured_things_reflect,
        real::the_exit_sign_is_whole,
    ]);
    all.extend(trials![
        "needs THIRDBOUNCE_DATA, and Python with numpy and scipy",
        data.clone().filter(|_| has(&python, "numpy, scipy.io")),
        positions::calibrated_zones_have_the_errors_that_they_say,
        positions::upright_facets_behind_an_edge_are_where_they_stand,
    ]);
    let scientific = with("h5py, matplotlib, numpy, OpenEXR, scipy");
    all.extend(trials!["needs Python packages", scientific, opened::python_opens_everything]);
    let viewers = with("cv2, imageio, meshio, numpy, plyfile, pyexr, trimesh, vtk");
    all.extend(trials!["needs Python with the programs of docs/results.md", viewers, opened::viewers_agree]);
    all.extend(trials![
        "needs Python with h5py and scipy",
        with("h5py, numpy, scipy.io"),
        others::what_h5py_and_scipy_write_is_read
    ]);
    all.extend(trials![
        "needs the test files of scipy (THIRDBOUNCE_SCIPY, or those of the Python)",
        files_of_scipy(&python),
        scipy::files_of_scipy_are_read_or_named
    ]);
    all.extend(trials![
        "needs Python with numpy",
        with("numpy"),
        recipes::printed_recipes_make_captures,
        recipes::the_recipe_of_the_page_finds_time_zero
    ]);
    all.extend(trials!["needs Python with Ray", with("ray"), batch::ray_shares_a_list]);
    all.extend(trials![
        "needs Python with the packages of learn/requirements.txt",
        with("torch, numpy, safetensors"),
        learn::two_steps_train_what_the_engine_reads
    ]);
    all.extend(trials!["needs Python", with("json"), learn::weights_are_ranked_by_the_light_that_they_leave]);
    all.extend(trials!["needs Python with y-tal", with("tal"), ytal::ytal_opens_ours_and_we_open_its]);
    all.extend(trials![
        "needs Python with ptufile",
        with("ptufile, numpy"),
        tags::ptufile_reads_the_same_records
    ]);
    libtest_mimic::run(&Arguments::from_args(), all).exit_code()
}

fn trial(name: &str, needs: &'static str, path: Option<PathBuf>, test: fn(&Path)) -> Trial {
    let is_missing = path.is_none();
    let run = move || match path {
        Some(path) => {
            test(&path);
            Ok(())
        }
        None => Err(Failed::from(needs)),
    };
    Trial::test(name.replace(' ', ""), run).with_kind(needs).with_ignored_flag(is_missing)
}

/// The folder of scipy's test files: named, or beside the scipy of this Python.
fn files_of_scipy(python: &Path) -> Option<PathBuf> {
    let installed = || {
        let find = "import os, scipy.io.matlab as m; print(os.path.join(os.path.dirname(m.__file__), 'tests', 'data'))";
        let found = Command::new(python).args(["-c", find]).output().ok()?;
        Some(PathBuf::from(String::from_utf8(found.stdout).ok()?.trim_end()))
    };
    let named = std::env::var_os("THIRDBOUNCE_SCIPY").map(PathBuf::from);
    named.or_else(installed).filter(|folder| folder.is_dir())
}

/// Whether this Python runs and has all of these packages.
fn has(python: &Path, packages: &str) -> bool {
    let mut import = Command::new(python);
    import.args(["-c", &format!("import {packages}")]).stdout(Stdio::null()).stderr(Stdio::null());
    import.status().is_ok_and(|status| status.success())
}
