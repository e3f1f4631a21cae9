use super::*;
use crate::{QosProfile, Stamp};
use puffer_msgs::rosgraph_msgs::msg::Clock;
use puffer_msgs::sensor_msgs::msg::PointCloud2;
use puffer_msgs::{Interface, cdr};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const CLOCK: &str = Clock::TYPE_NAME;

fn at(millis: i64) -> Stamp {
    Stamp::from_nanos(millis * 1_000_000)
}

fn clock(millis: i64) -> Clock {
    Clock { clock: at(millis).into() }
}

/// Bytes that zstd cannot make smaller.
fn cloud(size: usize, seed: u32) -> PointCloud2 {
    let mut state = seed;
    let mut data = Vec::with_capacity(size);
    for _ in 0..size {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        data.push((state >> 24) as u8);
    }
    PointCloud2 { data, ..PointCloud2::default() }
}

fn put<M: Interface>(bag: &mut BagWriter, topic: &str, message: &M, millis: i64) {
    let bytes = cdr::to_bytes(message).unwrap();
    bag.write(topic, M::TYPE_NAME, &bytes, at(millis), at(millis - 5)).unwrap();
}

/// Five clouds of 1 MB each second from 10 s on, and a clock every 100 ms from 9 s on.
fn fill(bag: &mut BagWriter) {
    for i in 0..60 {
        put(bag, "/clock", &clock(9_000 + 100 * i), 9_000 + 100 * i);
        if i % 10 == 0 && i > 0 {
            put(bag, "/points", &cloud(1 << 20, i as u32), 9_000 + 100 * i);
        }
    }
}

fn written(path: &Path) {
    let mut bag = BagWriter::create(path).unwrap();
    bag.add_topic("/points", PointCloud2::TYPE_NAME, QosProfile::Sensor).unwrap();
    fill(&mut bag);
    let notes = BTreeMap::from([("seed".to_owned(), "7".to_owned())]);
    bag.write_metadata("puffer", &notes).unwrap();
    bag.finish().unwrap();
}

fn times(messages: Messages) -> Vec<i64> {
    messages.map(|message| message.unwrap().log_time.nanos() / 1_000_000).collect()
}

#[test]
fn what_is_written_comes_back_in_the_order_of_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deep/run.mcap");
    written(&path);
    let bag = BagReader::open(&path).unwrap();
    let info = bag.info();
    let topics: Vec<_> =
        info.topics.iter().map(|t| (&*t.name, &*t.type_name, t.count, t.profile())).collect();
    let clouds = ("/points", PointCloud2::TYPE_NAME, 5, QosProfile::Sensor);
    assert_eq!(topics, [("/clock", CLOCK, 60, QosProfile::Standard), clouds]);
    assert_eq!((info.count, info.start, info.end), (65, at(9_000), at(14_900)));
    assert_eq!(info.duration().as_millis(), 5_900);
    assert!(info.damage.is_empty(), "{:?}", info.damage);
    assert_eq!(bag.metadata("puffer").unwrap()["seed"], "7");
    assert_eq!(bag.metadata("none"), None);
    assert!(bag.metadata("rosbag2").unwrap()["serialized_metadata"].contains("message_count: 65"));

    let all: Vec<BagMessage> = bag.messages(&[]).unwrap().map(|m| m.unwrap()).collect();
    assert_eq!(all.len(), 65);
    assert!(all.is_sorted_by_key(|m| m.log_time));
    let found = all.iter().find(|m| &*m.topic == "/points" && m.log_time == at(12_000)).unwrap();
    assert_eq!(found.decode::<PointCloud2>().unwrap(), cloud(1 << 20, 30));
    assert_eq!(found.publish_time, at(11_995));
    let error = found.decode::<Clock>().unwrap_err().to_string();
    assert!(error.contains("it holds sensor_msgs/msg/PointCloud2, not rosgraph"), "{error}");
    assert_eq!(
        times(bag.messages(&["/points", "/none"]).unwrap()),
        [10_000, 11_000, 12_000, 13_000, 14_000]
    );
}

#[test]
fn messages_that_were_written_out_of_order_are_sorted_across_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut bag = BagWriter::create(&path).unwrap();
    for (i, millis) in [500, 100, 300, 100, 200, 400, 50].into_iter().enumerate() {
        put(&mut bag, &format!("/{i}"), &clock(millis), millis);
        bag.flush().unwrap();
    }
    bag.finish().unwrap();
    let messages = BagReader::open(&path).unwrap().messages(&[]).unwrap();
    let order: Vec<String> = messages.map(|m| m.unwrap().topic.to_string()).collect();
    assert_eq!(order, ["/6", "/1", "/3", "/4", "/2", "/5", "/0"]);
}

#[test]
fn the_same_messages_make_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a", "b"].map(|name| folder.path().join(name).join("run.mcap"));
    paths.iter().for_each(|path| written(path));
    assert!(fs::read(&paths[0]).unwrap() == fs::read(&paths[1]).unwrap());
}

#[test]
fn a_recording_that_was_cut_off_is_read_up_to_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, cut) = (folder.path().join("whole.mcap"), folder.path().join("cut.mcap"));
    written(&whole);
    let bytes = fs::read(&whole).unwrap();
    let order = times(BagReader::open(&whole).unwrap().messages(&[]).unwrap());
    let mut counts = Vec::new();
    for length in (8..bytes.len()).step_by(bytes.len() / 97) {
        fs::write(&cut, &bytes[..length]).unwrap();
        let bag = BagReader::open(&cut).unwrap();
        let info = bag.info();
        // A file that lacks only its index lacks no message.
        if info.damage.is_empty() {
            assert_eq!(info.count, 65, "cut at {length}");
        } else {
            let count = format!("{} messages before it can be read", info.count);
            assert!(info.damage[0].contains(&count), "{:?}", info.damage);
        }
        let found = times(bag.messages(&[]).unwrap());
        assert_eq!(found, order[..found.len()], "cut at {length}");
        assert_eq!(found.len() as u64, info.count);
        counts.push(found.len());
    }
    assert!(counts.is_sorted() && counts[0] == 0);
    // No more than a chunk is missing at any place.
    assert!(counts[counts.len() / 2] >= 20 && counts[counts.len() - 1] >= 40, "{counts:?}");
}

#[test]
fn a_writer_that_never_ended_leaves_what_it_flushed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut bag = BagWriter::create(&path).unwrap();
    fill(&mut bag);
    bag.flush().unwrap();
    put(&mut bag, "/clock", &clock(1), 99_000);
    // As after a kill: nothing is dropped, nothing is closed.
    std::mem::forget(bag);
    let info = BagReader::open(&path).unwrap().info();
    assert_eq!((info.count, info.end, info.damage.len()), (65, at(14_900), 1));
}

#[test]
fn a_broken_chunk_is_left_out_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut bag = BagWriter::create(&path).unwrap();
    fill(&mut bag);
    bag.flush().unwrap();
    std::mem::forget(bag);
    let mut bytes = fs::read(&path).unwrap();
    // Within the first chunk, which holds two clouds of 1 MB.
    bytes[1_000_000] ^= 0x55;
    fs::write(&path, &bytes).unwrap();
    let bag = BagReader::open(&path).unwrap();
    let info = bag.info();
    assert_eq!(info.damage.len(), 2, "{:?}", info.damage);
    assert!(info.damage[0].contains("this piece is left out"), "{:?}", info.damage);
    assert!(info.count > 30 && info.count < 65);
    assert_eq!(times(bag.messages(&[]).unwrap()).len() as u64, info.count);
}

#[test]
fn a_broken_chunk_of_a_finished_bag_is_an_error_when_it_is_reached() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    written(&path);
    let mut bytes = fs::read(&path).unwrap();
    bytes[1_000_000] ^= 0x55;
    fs::write(&path, &bytes).unwrap();
    let mut messages = BagReader::open(&path).unwrap().messages(&[]).unwrap();
    let error = messages.find_map(Result::err).unwrap().to_string();
    assert!(error.contains("damaged at byte"), "{error}");
    assert!(messages.next().is_none());
}

#[test]
fn a_file_without_chunks_and_index_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let options = mcap::WriteOptions::new().use_chunks(false).emit_summary_records(false);
    let mut writer = options.create(fs::File::create(&path).unwrap()).unwrap();
    let schema = writer.add_schema(CLOCK, "ros2msg", Clock::DEFINITION.as_bytes()).unwrap();
    let channel_id = writer.add_channel(schema, "/clock", "cdr", &BTreeMap::new()).unwrap();
    for (sequence, millis) in [300, 100, 200].into_iter().enumerate() {
        let log_time = millis * 1_000_000;
        let sequence = sequence as u32;
        let header =
            mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time: 0 };
        let bytes = cdr::to_bytes(&clock(millis as i64)).unwrap();
        writer.write_to_known_channel(&header, &bytes).unwrap();
    }
    writer.finish().unwrap();
    let bag = BagReader::open(&path).unwrap();
    assert!(bag.info().damage.is_empty(), "{:?}", bag.info());
    assert_eq!((bag.info().count, bag.info().start), (3, at(100)));
    assert_eq!(times(bag.messages(&[]).unwrap()), [100, 200, 300]);
    assert_eq!(bag.info().topics[0].profile(), QosProfile::Standard);
}

fn refusal(bag: &mut BagWriter, type_name: &str, bytes: &[u8], time: Stamp) -> String {
    bag.write("/clock", type_name, bytes, time, time).unwrap_err().to_string()
}

#[test]
fn what_cannot_be_written_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut bag = BagWriter::create(&path).unwrap();
    let error = BagWriter::create(&path).err().unwrap().to_string();
    assert!(error.contains("cannot create the file"), "{error}");
    let bytes = cdr::to_bytes(&clock(1)).unwrap();
    let error = refusal(&mut bag, "no_msgs/msg/None", &bytes, at(1));
    assert!(error.contains("none of the interfaces of puffer"), "{error}");
    assert!(refusal(&mut bag, CLOCK, &bytes, at(-1)).contains("before 1970"));
    assert!(
        refusal(&mut bag, CLOCK, &[9, 9, 0, 0], at(1)).contains("it begins with [09, 09, 00, 00]")
    );
    assert!(refusal(&mut bag, CLOCK, &[], at(1)).contains("it begins with []"));
    let error = refusal(&mut bag, PointCloud2::TYPE_NAME, &bytes, at(1));
    assert!(error.contains("it is a rosgraph_msgs/msg/Clock already"), "{error}");
}

fn open_error(path: &Path) -> String {
    BagReader::open(path).unwrap_err().to_string()
}

/// The error of a file with these bytes.
fn file_error(folder: &Path, name: &str, bytes: &[u8]) -> String {
    fs::write(folder.join(name), bytes).unwrap();
    open_error(&folder.join(name))
}

/// The error of a folder with such metadata.
fn metadata_error(folder: &Path, storage: &str, mode: &str) -> String {
    let text = format!(
        "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: {storage}\n  \
         relative_file_paths: [one.mcap, two.mcap]\n  compression_mode: '{mode}'\n"
    );
    fs::write(folder.join("metadata.yaml"), text).unwrap();
    open_error(folder)
}

#[test]
fn what_is_no_bag_is_told_with_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    assert!(file_error(path, "a.mcap", b"").contains("the file is empty"));
    assert!(
        file_error(path, "b.mcap", b"ply\nformat ascii").contains("does not begin as one does")
    );
    assert!(
        file_error(path, "c.bag", b"#ROSBAG V2.0\n").contains("it is a bag of ROS 1; convert it")
    );
    assert!(open_error(&path.join("missing.mcap")).contains("cannot open"));

    let old = path.join("old");
    fs::create_dir(&old).unwrap();
    assert!(open_error(&old).contains("holds no .mcap file"));
    fs::write(old.join("old_0.db3"), b"SQLite format 3\0").unwrap();
    let way = format!("rosbags-convert --src {0} --dst {0}_mcap --dst-storage mcap", old.display());
    assert!(open_error(&old).contains(&way), "{}", open_error(&old));
    assert!(
        open_error(&old.join("old_0.db3")).contains(&way),
        "{}",
        open_error(&old.join("old_0.db3"))
    );
    assert!(metadata_error(&old, "sqlite3", "").contains(&way));
    assert!(metadata_error(&old, "mcap", "FILE").contains("rosbag2 compressed it (FILE)"));
    assert!(metadata_error(&old, "mcap", "").contains("one.mcap: cannot open"));
    fs::write(old.join("metadata.yaml"), "a: 1").unwrap();
    assert!(open_error(&old).contains("it is not rosbag2's"));
}

fn check_merged(path: &Path) {
    let bag = BagReader::open(path).unwrap();
    assert_eq!((bag.info().topics.len(), bag.info().count), (1, 4));
    assert_eq!(times(bag.messages(&[]).unwrap()), [100, 200, 300, 400]);
}

#[test]
fn the_files_of_a_folder_are_one_bag() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    for (name, moments) in [("b_0.mcap", [100, 300]), ("b_1.mcap", [200, 400])] {
        let mut bag = BagWriter::create(path.join(name)).unwrap();
        for millis in moments {
            put(&mut bag, "/clock", &clock(millis), millis);
        }
        bag.finish().unwrap();
    }
    check_merged(path);
    let text = "rosbag2_bagfile_information:\n  storage_identifier: mcap\n  \
                relative_file_paths: [old_name/b_0.mcap, b_1.mcap]\n";
    fs::write(path.join("metadata.yaml"), text).unwrap();
    check_merged(path);
}

#[test]
fn an_empty_bag_is_a_bag() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut bag = BagWriter::create(&path).unwrap();
    bag.add_topic("/tf_static", "tf2_msgs/msg/TFMessage", QosProfile::Latched).unwrap();
    bag.flush().unwrap();
    bag.finish().unwrap();
    let info = BagReader::open(&path).unwrap().info();
    assert_eq!((info.count, info.start, info.damage.len()), (0, Stamp::ZERO, 0));
    assert_eq!(info.topics[0].profile(), QosProfile::Latched);
}
