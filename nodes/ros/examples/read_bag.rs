//! Prints a bag as lines of JSON, first its overview, then each message: `read_bag BAG`.
//! tests/independent/bag_check.py holds them against other implementations.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use puffer_msgs::{Interface, TypeVisitor, visit_types};
use puffer_ros::bag::{BagError, BagMessage, BagReader, BagTopic};
use serde_json::{Value, json};
use std::io::Write;

fn main() -> anyhow::Result<()> {
    let path = std::env::args().nth(1).ok_or_else(|| anyhow::anyhow!("read_bag BAG"))?;
    let bag = BagReader::open(&path)?;
    let info = bag.info();
    let mut out = std::io::stdout().lock();
    let overview = json!({
        "topics": info.topics.iter().map(topic_json).collect::<Vec<_>>(),
        "start": info.start.nanos(), "end": info.end.nanos(), "damage": info.damage,
        "notes": bag.metadata("puffer"),
    });
    writeln!(out, "{overview}")?;
    for message in bag.messages(&[])? {
        let message = message?;
        let mut decode = Decode { message: &message, value: None };
        visit_types(&mut decode);
        let line = json!({
            "topic": &*message.topic, "type": &*message.type_name,
            "log_time": message.log_time.nanos(), "publish_time": message.publish_time.nanos(),
            "message": decode.value.transpose()?,
        });
        writeln!(out, "{line}")?;
    }
    Ok(())
}

/// Name, type, number of messages and QoS profile of a topic.
fn topic_json(topic: &BagTopic) -> Value {
    let profile = format!("{:?}", topic.profile());
    json!([&*topic.name, &*topic.type_name, topic.count, profile])
}

/// Decodes a message by visiting all types until its own comes.
struct Decode<'a> {
    message: &'a BagMessage,
    value: Option<Result<Value, BagError>>,
}

impl TypeVisitor for Decode<'_> {
    fn visit<T: Interface>(&mut self) {
        if *self.message.type_name == *T::TYPE_NAME {
            let message = self.message.decode::<T>();
            self.value = Some(message.map(|m| serde_json::to_value(m).unwrap_or_default()));
        }
    }
}
