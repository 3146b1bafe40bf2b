//! `thirdbounce view RESULT`.

use std::path::PathBuf;

use super::terminal::print;
use thirdbounce::{Error, Result};

#[derive(clap::Args)]
pub struct Args {
    /// Folder of a result
    #[arg(value_name = "RESULT")]
    result: PathBuf,
}

pub fn run(args: &Args) -> Result<()> {
    let page = args.result.join("report.html");
    if !page.is_file() {
        return Err(Error::input(
            format!("{}: there is no report.html", args.result.display()),
            "give the folder of a result that `thirdbounce reconstruct` wrote",
        ));
    }
    let shown = page.canonicalize().unwrap_or(page);
    open::that_detached(&shown).map_err(|e| {
        Error::output(
            format!("no program opens {} ({e})", shown.display()),
            "open it in a browser: it needs no network",
        )
    })?;
    print(&format!("opened {}", shown.display()));
    Ok(())
}
