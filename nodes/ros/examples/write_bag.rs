//! Writes a small bag of several types: `write_bag OUT.mcap`. tests/independent/bag_check.py reads
//! it with other implementations.

// The lints spare test functions only, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use puffer_msgs::builtin_interfaces::msg::Time;
use puffer_msgs::geometry_msgs::msg::TransformStamped;
use puffer_msgs::msg::RegisteredScan;
use puffer_msgs::rosgraph_msgs::msg::Clock;
use puffer_msgs::sensor_msgs::msg::{PointCloud2, PointField};
use puffer_msgs::tf2_msgs::msg::TFMessage;
use puffer_msgs::{Interface, cdr};
use puffer_ros::bag::BagWriter;
use puffer_ros::{QosProfile, Stamp};
use std::collections::BTreeMap;

/// Number of points of a cloud: 2 MB of data, so that a chunk holds about one cloud.
const CLOUD_POINTS: u32 = 170_000;
/// Log time of the first message, nanoseconds since 1970.
const START_NANOS: i64 = 1_764_000_000_000_000_000;

fn main() -> anyhow::Result<()> {
    let path = std::env::args().nth(1).ok_or_else(|| anyhow::anyhow!("write_bag OUT.mcap"))?;
    let mut bag = BagWriter::create(&path)?;
    bag.add_topic("/points", PointCloud2::TYPE_NAME, QosProfile::Sensor)?;
    bag.write_metadata("puffer", &BTreeMap::from([("seed".to_owned(), "7".to_owned())]))?;
    put(&mut bag, "/tf_static", &transforms(0), 0)?;
    for i in 0..20_u32 {
        let tick = i64::from(i) * 100_000_000;
        put(&mut bag, "/clock", &Clock { clock: time(tick) }, tick)?;
        put(&mut bag, "/tf", &transforms(i), tick + 1)?;
        if i % 5 == 0 {
            put(&mut bag, "/points", &cloud(i, CLOUD_POINTS), tick + 2)?;
            put(&mut bag, "/registered_scan", &scan(i), tick + 3)?;
        }
    }
    bag.finish()?;
    Ok(())
}

fn put<M: Interface>(
    bag: &mut BagWriter,
    topic: &str,
    message: &M,
    tick: i64,
) -> anyhow::Result<()> {
    let at = Stamp::from_nanos(START_NANOS + tick);
    bag.write(topic, M::TYPE_NAME, &cdr::to_bytes(message)?, at, at)?;
    Ok(())
}

fn time(tick: i64) -> Time {
    Stamp::from_nanos(START_NANOS + tick).into()
}

fn transforms(i: u32) -> TFMessage {
    let mut one = TransformStamped::default();
    one.header.frame_id = "base".into();
    one.header.stamp = time(i64::from(i));
    one.child_frame_id = format!("arm_{i}");
    one.transform.translation.x = f64::from(i) * 0.1;
    one.transform.rotation.w = 1.0;
    TFMessage { transforms: vec![one; 2] }
}

/// Point `k` of cloud `i` is (k / 1000, i, -k).
fn cloud(i: u32, points: u32) -> PointCloud2 {
    let mut cloud = PointCloud2 {
        height: 1,
        width: points,
        point_step: 12,
        row_step: 12 * points,
        is_dense: true,
        ..PointCloud2::default()
    };
    cloud.header.frame_id = "sensor".into();
    cloud.header.stamp = time(i64::from(i));
    for (name, offset) in [("x", 0), ("y", 4), ("z", 8)] {
        let field =
            PointField { name: name.into(), offset, datatype: PointField::FLOAT32, count: 1 };
        cloud.fields.push(field);
    }
    for k in 0..points {
        for value in [k as f32 / 1000.0, i as f32, -(k as f32)] {
            cloud.data.extend(value.to_le_bytes());
        }
    }
    cloud
}

fn scan(i: u32) -> RegisteredScan {
    let mut scan = RegisteredScan {
        id: i,
        cloud: cloud(i, 10),
        status: RegisteredScan::DEFERRED,
        reason: "geometry: free about z, ünsure".into(),
        fitness: 0.75,
        free_directions: vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ..RegisteredScan::default()
    };
    scan.header.frame_id = "object".into();
    scan.object_from_sensor.covariance[35] = 1e-4;
    scan
}
