//! `puffer objects`: what can be simulated.

use crate::table::print_rows;
use anyhow::Result;
use clap::Args;
use puffer_core::simulate::objects::{ObjectInfo, infos};
use serde_json::{Value, json};

/// Name, size and genus of each built-in object.
#[derive(Args)]
pub struct Objects {
    /// Print a JSON list
    #[arg(long)]
    json: bool,
}

impl Objects {
    pub(super) fn run(&self) -> Result<()> {
        if self.json {
            println!("{}", Value::from(infos().map(|o| as_json(&o)).collect::<Vec<_>>()));
        } else {
            let row = |o: ObjectInfo| {
                let [x, y, z] = o.size.map(|s| s * 1e3);
                let size = format!("{x:.0} x {y:.0} x {z:.0} mm");
                (o.name.to_owned(), format!("{size:<20}  genus {}  {}", o.genus, o.description))
            };
            print_rows(&infos().map(row).collect::<Vec<_>>());
        }
        Ok(())
    }
}

fn as_json(object: &ObjectInfo) -> Value {
    json!({
        "name": object.name,
        "description": object.description,
        "genus": object.genus,
        "size_m": object.size,
    })
}
