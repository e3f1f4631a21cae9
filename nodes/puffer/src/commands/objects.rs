//! `puffer objects`: what can be simulated.

use crate::table::print_rows;
use anyhow::Result;
use clap::Args;
use puffer_core::simulate::objects::{ObjectInfo, object_infos};
use serde_json::{Value, json};

/// Name, size and genus of each built-in object.
#[derive(Args)]
pub struct ObjectsCommand {
    /// Print a JSON list
    #[arg(long)]
    json: bool,
}

impl ObjectsCommand {
    pub(super) fn run(&self) -> Result<()> {
        if self.json {
            println!("{}", Value::from(object_infos().map(|o| as_json(&o)).collect::<Vec<_>>()));
        } else {
            print_rows(&object_infos().map(|object| object_row(&object)).collect::<Vec<_>>());
        }
        Ok(())
    }
}

/// Name and description, as a row of the table.
fn object_row(object: &ObjectInfo) -> (String, String) {
    let [x, y, z] = object.size.map(|edge| edge * 1e3);
    let size = format!("{x:.0} x {y:.0} x {z:.0} mm");
    let text = format!("{size:<20}  genus {}  {}", object.genus, object.description);
    (object.name.to_owned(), text)
}

fn as_json(object: &ObjectInfo) -> Value {
    json!({
        "name": object.name,
        "description": object.description,
        "genus": object.genus,
        "size_m": object.size,
    })
}
