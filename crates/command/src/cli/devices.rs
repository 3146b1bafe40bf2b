//! `thirdbounce devices`.

use thirdbounce::{Result, gpu};

use super::tables;
use super::terminal::{json, print};

#[derive(clap::Args)]
pub struct DevicesArgs {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &DevicesArgs) -> Result<()> {
    let all = gpu::devices();
    if args.json {
        print(&json(&all)?);
        return Ok(());
    }
    for d in all {
        let (kind, memory) = (d.kind.to_string(), tables::bytes(d.memory));
        let details = match d.api.as_str() {
            "" => format!("{kind}, {memory} free, {}", d.driver),
            api => format!("{kind}, Vulkan {api}, {memory}, driver {}", d.driver),
        };
        print(&format!("{}: {}\n   {details}", d.index, d.name));
    }
    Ok(())
}
