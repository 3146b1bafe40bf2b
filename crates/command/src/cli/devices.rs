//! `thirdbounce devices`.

use thirdbounce::{Error, Result, gpu};

use super::tables;
use super::terminal::{json, print};

#[derive(clap::Args)]
pub struct DevicesArgs {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &DevicesArgs) -> Result<()> {
    let all = gpu::devices()?;
    if args.json {
        print(&json(&all)?);
        return Ok(());
    }
    if all.is_empty() {
        return Err(Error::device(
            "no Vulkan device on this machine",
            "install a driver: on Debian `apt-get install mesa-vulkan-drivers` (it runs on any CPU), or the vendor's",
        ));
    }
    for d in all {
        let (kind, memory) = (d.kind.to_string(), tables::bytes(d.memory));
        print(&format!(
            "{}: {}\n   {kind}, Vulkan {}, {memory}, driver {}",
            d.index, d.name, d.api, d.driver
        ));
    }
    Ok(())
}
