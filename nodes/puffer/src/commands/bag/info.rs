//! `puffer bag info`.

use crate::notes::BagNotes;
use crate::table::print_rows;
use anyhow::Result;
use clap::Args;
use puffer_ros::bag::{BagInfo, BagReader};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Of a longer note only the length is printed, characters.
const MAX_NOTE_LENGTH: usize = 60;

/// Topics, types, counts and times of a bag, and what of it is damaged.
#[derive(Args)]
pub struct InfoCommand {
    /// An .mcap file, or a rosbag2 folder of them
    #[arg(value_name = "BAG")]
    path: PathBuf,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl InfoCommand {
    pub(super) fn run(&self) -> Result<()> {
        let bag = BagReader::open(&self.path)?;
        let info = bag.info();
        // The text of a note is printed even if it is damaged.
        let notes = bag.metadata(puffer_ros::scans::RUN_METADATA_NAME).unwrap_or_default();
        if self.json {
            println!("{}", as_json(&info, &notes));
            return Ok(());
        }
        let mut rows = vec![
            ("messages".to_owned(), info.count.to_string()),
            ("from".to_owned(), format!("{} s", info.start)),
            ("to".to_owned(), format!("{} s", info.end)),
            ("duration".to_owned(), format!("{:.3} s", info.duration().as_secs_f64())),
        ];
        for topic in &info.topics {
            let text = format!("{:>8}  {}", topic.count, topic.type_name);
            rows.push((topic.name.to_string(), text));
        }
        for (key, text) in &notes {
            let text = if text.chars().count() > MAX_NOTE_LENGTH || text.contains('\n') {
                format!("{} characters", text.chars().count())
            } else {
                text.clone()
            };
            rows.push((format!("note {key}"), text));
        }
        rows.extend(info.damage.iter().map(|d| ("DAMAGED".to_owned(), d.clone())));
        print_rows(&rows);
        if let Err(error) = BagNotes::from_bag(&bag) {
            eprintln!("puffer: {error:#}");
        }
        Ok(())
    }
}

fn as_json(info: &BagInfo, notes: &std::collections::BTreeMap<String, String>) -> Value {
    let topics: Vec<Value> = info
        .topics
        .iter()
        .map(|t| {
            json!({
                "name": &*t.name,
                "type": &*t.type_name,
                "count": t.count,
                "profile": format!("{:?}", t.profile()).to_lowercase(),
            })
        })
        .collect();
    json!({
        "messages": info.count,
        "start": info.start.seconds(),
        "end": info.end.seconds(),
        "duration": info.duration().as_secs_f64(),
        "topics": topics,
        "damage": info.damage,
        "notes": notes,
    })
}
