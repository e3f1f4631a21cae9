"""Holds our bags against rosbags and mcap-ros2-support, implementations of their own.

1. Both read what the example write_bag wrote: overview, times, values, with the definitions from the bag.
2. Our reader (the example read_bag) reads that bag, the same bag cut off, and bags that rosbags wrote.

3. Both read the bag of a run, in whole, and count what `puffer bag info` counts.

bag_check.py FOLDER_OF_THE_EXAMPLES, after: cargo build --release -p puffer_ros --examples
bag_check.py --run BAG PUFFER, with the bag of a run and the program
Wants: pip install -r requirements-bags.txt
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

START = 1_764_000_000_000_000_000
POINTS = 170_000
TOPICS = {
    "/clock": ("rosgraph_msgs/msg/Clock", 20),
    "/points": ("sensor_msgs/msg/PointCloud2", 4),
    "/registered_scan": ("puffer_msgs/msg/RegisteredScan", 4),
    "/tf": ("tf2_msgs/msg/TFMessage", 20),
    "/tf_static": ("tf2_msgs/msg/TFMessage", 1),
}
failures = []


def check(what: str, truth: bool) -> None:
    print(f"{'ok    ' if truth else 'FAILED'} {what}")
    if not truth:
        failures.append(what)


def plain(value: object) -> object:
    """A message of either library as JSON would hold it."""
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, (bytes, bytearray, memoryview)):
        return list(value)
    if isinstance(value, numpy.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    names = [name.lstrip("_") for name in getattr(value, "__slots__", None) or vars(value)]
    # rosbags keeps constants (upper case) and the type's name with the fields.
    names = [name for name in names if name.islower() and not name.startswith("msgtype")]
    return {name: plain(getattr(value, name)) for name in names}


def expected_points(i: int, count: int) -> numpy.ndarray:
    k = numpy.arange(count, dtype=numpy.float32)
    return numpy.stack([k / numpy.float32(1000), numpy.full_like(k, i), -k], axis=1)


def known_values(topic: str, log_time: int, message: dict) -> bool:
    """What write_bag writes, said a second time."""
    tick = log_time - START
    i = tick // 100_000_000
    if topic == "/clock":
        return message["clock"]["sec"] * 10**9 + message["clock"]["nanosec"] == log_time
    if topic in ("/tf", "/tf_static"):
        one = message["transforms"][1]
        return (
            len(message["transforms"]) == 2
            and one["child_frame_id"] == f"arm_{i}"
            and one["header"]["stamp"]["nanosec"] == i
            and one["transform"]["translation"] == {"x": i * 0.1, "y": 0.0, "z": 0.0}
        )
    scan = topic == "/registered_scan"
    cloud = message["cloud"] if scan else message
    points = numpy.array(cloud["data"], dtype=numpy.uint8).view("<f4").reshape(-1, 3)
    same = numpy.array_equal(points, expected_points(i, 10 if scan else POINTS))
    names = [field["name"] for field in cloud["fields"]]
    if scan:
        same = same and message["id"] == i and message["reason"].endswith("ünsure")
        same = same and message["object_from_sensor"]["covariance"][35] == 1e-4
        same = same and message["free_directions"] == [0, 0, 0, 0, 0, 1] and message["status"] == 1
    return same and names == ["x", "y", "z"] and cloud["header"]["frame_id"] == "sensor"


def with_rosbags(path: Path) -> list[tuple[str, str, int, dict]]:
    with AnyReader([path]) as reader:
        found = {c.topic: (c.msgtype, c.msgcount) for c in reader.connections}
        check(f"rosbags: overview of {path.name}", found == TOPICS)
        qos = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
        check(
            "rosbags: offered profiles",
            qos["/points"].reliability.name == "BEST_EFFORT"
            and qos["/tf"].reliability.name == "RELIABLE"
            and qos["/tf_static"].durability.name == "TRANSIENT_LOCAL"
            and qos["/tf"].durability.name == "VOLATILE",
        )
        return [
            (c.topic, c.msgtype, at, plain(reader.deserialize(data, c.msgtype)))
            for c, at, data in reader.messages()
        ]


def with_mcap(path: Path) -> list[tuple[str, str, int, dict]]:
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        check("mcap: profile ros2", reader.get_header().profile == "ros2")
        counts = reader.get_summary().statistics.channel_message_counts
        check("mcap: statistics", sorted(counts.values()) == sorted(n for _, n in TOPICS.values()))
        notes = {m.name: m.metadata for m in reader.iter_metadata()}
        check("mcap: notes", notes["puffer"] == {"seed": "7"} and "serialized_metadata" in notes["rosbag2"])
        chunks = reader.get_summary().chunk_indexes
        print(
            f"       {path.stat().st_size} bytes, {len(chunks)} chunks of "
            f"{min(c.uncompressed_size for c in chunks)} to {max(c.uncompressed_size for c in chunks)} bytes, "
            f"{set(c.compression for c in chunks)}"
        )
        return [
            (channel.topic, schema.name, message.log_time, plain(decoded))
            for schema, channel, message, decoded in reader.iter_decoded_messages()
        ]


def with_ours(examples: Path, path: Path) -> tuple[dict, list[tuple[str, str, int, dict]]]:
    run = subprocess.run([examples / "read_bag", path], capture_output=True, text=True, check=True)
    overview, *lines = [json.loads(line) for line in run.stdout.splitlines()]
    return overview, [(m["topic"], m["type"], m["log_time"], m["message"]) for m in lines]


def check_ours(examples: Path, folder: Path) -> None:
    path = folder / "ours.mcap"
    subprocess.run([examples / "write_bag", path], check=True)
    theirs, mcap = with_rosbags(path), with_mcap(path)
    overview, ours = with_ours(examples, path)
    for name, messages in {"rosbags": theirs, "mcap-ros2-support": mcap, "our reader": ours}.items():
        right = sum(known_values(topic, at, message) for topic, _, at, message in messages)
        check(f"{name}: {right} of {len(messages)} messages hold what was written", right == 49)
    check("rosbags and our reader agree in all fields", theirs == ours)
    check("mcap-ros2-support and our reader agree in all fields", mcap == ours)
    check("our reader: overview", overview["topics"] == [
        [t, *TOPICS[t], {"/points": "Sensor", "/tf_static": "Latched"}.get(t, "Standard")]
        for t in sorted(TOPICS)
    ] and overview["notes"] == {"seed": "7"} and overview["damage"] == [])

    cut = folder / "cut.mcap"
    data = path.read_bytes()
    for share in (0.3, 0.6, 0.99):
        cut.write_bytes(data[: int(share * len(data))])
        overview, messages = with_ours(examples, cut)
        print(f"       cut at {share:.0%}: {len(messages)} messages; {overview['damage']}")
        check(f"our reader: a bag cut at {share:.0%}", 0 < len(messages) and messages == ours[: len(messages)])


def check_theirs(examples: Path, folder: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](5, 6), "camera")
    fields = [types["sensor_msgs/msg/PointField"]("x", 0, 7, 1)]
    data = (numpy.arange(400_000) % 251).astype(numpy.uint8)
    cloud = types["sensor_msgs/msg/PointCloud2"](header, 1, 100_000, fields, False, 4, 400_000, data, True)
    for version in (8, 9):
        for mode in (CompressionMode.NONE, CompressionMode.STORAGE):
            bag = folder / f"theirs_{version}_{mode.name.lower()}"
            writer = Writer(bag, version=version, storage_plugin=StoragePlugin.MCAP)
            if mode is not CompressionMode.NONE:
                writer.set_compression(mode, CompressionFormat.ZSTD)
            with writer:
                points = writer.add_connection("/points", cloud.__msgtype__, typestore=store)
                clock = writer.add_connection("/clock", "rosgraph_msgs/msg/Clock", typestore=store)
                for i in range(30):
                    now = types["rosgraph_msgs/msg/Clock"](types["builtin_interfaces/msg/Time"](i, 0))
                    writer.write(clock, 1000 * i, store.serialize_cdr(now, now.__msgtype__))
                    if i % 10 == 0:
                        writer.write(points, 1000 * i + 1, store.serialize_cdr(cloud, cloud.__msgtype__))
            for path in (bag, next(bag.glob("*.mcap"))):
                overview, ours = with_ours(examples, path)
                expected = [["/clock", "rosgraph_msgs/msg/Clock", 30], ["/points", cloud.__msgtype__, 3]]
                clouds = [message for topic, _, _, message in ours if topic == "/points"]
                clocks = [message["clock"]["sec"] for topic, _, _, message in ours if topic == "/clock"]
                check(
                    f"our reader: {path.name} of rosbags, version {version}, {mode.name}",
                    [topic[:3] for topic in overview["topics"]] == expected
                    and overview["damage"] == []
                    and clouds == [plain(cloud)] * 3
                    and clocks == list(range(30)),
                )
    bag = folder / "old"
    with Writer(bag, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        clock = writer.add_connection("/clock", "rosgraph_msgs/msg/Clock", typestore=store)
        now = types["rosgraph_msgs/msg/Clock"](types["builtin_interfaces/msg/Time"](1, 0))
        writer.write(clock, 1, store.serialize_cdr(now, now.__msgtype__))
    run = subprocess.run([examples / "read_bag", bag], capture_output=True, text=True, check=False)
    check("our reader: sqlite3 is refused with a command", run.returncode == 1 and "rosbags-convert" in run.stderr)
    command = run.stderr.split("&& ")[1].split("\n")[0].split()
    subprocess.run([Path(sys.executable).parent / command[0], *command[1:]], check=True)
    overview, _ = with_ours(examples, folder / "old_mcap")
    check("our reader: what that command makes", overview["topics"][0][:3] == ["/clock", "rosgraph_msgs/msg/Clock", 1])


def check_run(path: Path, puffer: Path) -> None:
    """The bag of a run, with definitions from the bag alone."""
    run = subprocess.run([puffer, "bag", "info", "--json", path], capture_output=True, text=True, check=True)
    info = json.loads(run.stdout)
    told = {topic["name"]: topic["count"] for topic in info["topics"]}
    check("puffer bag info: no damage", info["damage"] == [])
    with AnyReader([path]) as reader:
        theirs = [
            (c.topic, at, plain(reader.deserialize(data, c.msgtype))) for c, at, data in reader.messages()
        ]
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        mcap = [
            (channel.topic, message.log_time, plain(decoded))
            for _, channel, message, decoded in reader.iter_decoded_messages()
        ]
        notes = {m.name: m.metadata for m in reader.iter_metadata()}
    for name, messages in {"rosbags": theirs, "mcap-ros2-support": mcap}.items():
        counts = dict.fromkeys(told, 0)
        for topic, _, _ in messages:
            counts[topic] += 1
        check(f"{name}: {len(messages)} messages of {sum(map(bool, counts.values()))} topics", counts == told)
    same = [sorted(json.dumps(message, sort_keys=True) for message in messages) for messages in (theirs, mcap)]
    check("rosbags and mcap-ros2-support agree in all fields", same[0] == same[1])
    check("the run's notes", notes["puffer"] == info["notes"] and "ros__parameters" in notes["puffer"]["params"])
    clouds = [m for topic, _, m in theirs if topic == "/points"]
    scans = {m["id"] for topic, _, m in theirs if topic == "/registered_scan"}
    check(f"{len(clouds)} clouds, each with a verdict", len(clouds) == len(scans) > 0)
    poses = {p for topic, _, m in theirs if topic == "/tf" for p in [stamp_of(m["transforms"][0])]}
    check("a transform at the stamp of each cloud", all(stamp_of(m) in poses for m in clouds))


def stamp_of(message: dict) -> tuple[int, int]:
    stamp = message["header"]["stamp"]
    return stamp["sec"], stamp["nanosec"]


def main() -> int:
    if sys.argv[1] == "--run":
        check_run(Path(sys.argv[2]).resolve(), Path(sys.argv[3]).resolve())
    else:
        examples = Path(sys.argv[1]).resolve()
        with tempfile.TemporaryDirectory() as folder:
            check_ours(examples, Path(folder))
            check_theirs(examples, Path(folder))
    print(f"{len(failures)} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
