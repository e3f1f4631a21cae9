#!/usr/bin/env python3
"""Tries puffer's ROS glue against another DDS implementation: Eclipse Cyclone DDS (PyPI cyclonedds 11.0.1).

Usage: cargo build --release -p puffer_ros --example peer
       python -m venv VENV && VENV/bin/pip install -r tests/independent/requirements-dds.txt
       VENV/bin/python tests/independent/dds_check.py [--peer target/release/examples/peer] [--domain 77]

Topics both ways (also latched, also 100 at once), a service call both ways by rmw_cyclonedds's convention, the
parameter services and the discovery of the node's endpoints. Exit status 1 if anything fails.
"""

import argparse
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from cyclonedds.builtin import (
    BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription)
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, int32, int64, sequence, uint8, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

PATIENCE = 30.0
CLIENT = 0x1122334455667788


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


# rmw_cyclonedds puts the client's number and that of the call in front of each request and response.
@dataclass
class SwitchRequest(IdlStruct, typename="std_srvs::srv::dds_::SetBool_Request_"):
    client: uint64
    number: int64
    data: bool


@dataclass
class SwitchResponse(IdlStruct, typename="std_srvs::srv::dds_::SetBool_Response_"):
    client: uint64
    number: int64
    success: bool
    message: str


@dataclass
class GetTypesRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::GetParameterTypes_Request_"):
    client: uint64
    number: int64
    names: sequence[str]


@dataclass
class GetTypesResponse(IdlStruct, typename="rcl_interfaces::srv::dds_::GetParameterTypes_Response_"):
    client: uint64
    number: int64
    types: sequence[uint8]


@dataclass
class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: array[uint8, 16]


@dataclass
class NodeEntities(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    node_namespace: str
    node_name: str
    reader_gids: sequence[Gid]
    writer_gids: sequence[Gid]


@dataclass
class ParticipantEntities(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid
    nodes: sequence[NodeEntities]


def quality(durability=Policy.Durability.Volatile, depth=10):
    return Qos(
        Policy.Reliability.Reliable(duration(seconds=1)),
        durability,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


class Wire:
    """Endpoints of this script."""

    def __init__(self, domain):
        self.participant = DomainParticipant(domain)

    def writer(self, name, kind, qos=None):
        return DataWriter(self.participant, Topic(self.participant, name, kind, qos=qos or quality()),
                          qos=qos or quality())

    def reader(self, name, kind, qos=None):
        return DataReader(self.participant, Topic(self.participant, name, kind, qos=qos or quality()),
                          qos=qos or quality())


def wait(what, holds):
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        found = holds()
        if found:
            return found
        time.sleep(0.01)
    raise AssertionError(f"never: {what}")


def take(reader, count, what):
    found = []

    def enough():
        found.extend(sample for sample in reader.take(N=100) if sample.sample_info.valid_data)
        return len(found) >= count

    wait(f"{count} of {what}", enough)
    return found


def matched(writer, reader):
    wait("the peer is matched", lambda: writer.get_matched_subscriptions() and reader.get_matched_publications())


def check_topics(wire):
    out, back = wire.writer("rt/peer/in", Header, quality(depth=200)), wire.reader("rt/peer/out", Header, quality(depth=200))
    matched(out, back)
    for number in range(100):
        out.write(Header(Time(number, 5), f"frame {number}"))
        time.sleep(0.002)
    got = [(m.stamp.sec, m.stamp.nanosec, m.frame_id) for m in take(back, 100, "echoes")]
    assert got == [(n, 5, f"echo frame {n}") for n in range(100)], got[:3]


def check_latched(wire):
    word = wire.reader("rt/peer/word", Header, quality(Policy.Durability.TransientLocal, 1))
    assert take(word, 1, "latched words")[0].frame_id == "latched"


def check_server(wire):
    ask = wire.writer("rq/peer/switchRequest", SwitchRequest)
    answers = wire.reader("rr/peer/switchReply", SwitchResponse)
    matched(ask, answers)
    for number, data in enumerate([True, False, True], start=1):
        ask.write(SwitchRequest(CLIENT, number, data))
        answer = take(answers, 1, "answers")[0]
        assert (answer.client, answer.number) == (CLIENT, number), answer
        assert (answer.success, answer.message) == (data, "switched"), answer


def check_parameters(wire):
    ask = wire.writer("rq/peer/get_parameter_typesRequest", GetTypesRequest)
    answers = wire.reader("rr/peer/get_parameter_typesReply", GetTypesResponse)
    matched(ask, answers)
    ask.write(GetTypesRequest(CLIENT, 7, ["peer.ask", "peer.patience", "nothing"]))
    assert list(take(answers, 1, "types")[0].types) == [1, 3, 0]


def check_graph(wire):
    """What the node announces is what Cyclone DDS discovers: `ros2 node info` puts the two together."""
    told = wire.reader("ros_discovery_info", ParticipantEntities, quality(Policy.Durability.TransientLocal, 100))
    found = {kind: BuiltinDataReader(wire.participant, topic) for kind, topic in
             [("reader", BuiltinTopicDcpsSubscription), ("writer", BuiltinTopicDcpsPublication)]}
    names = {kind: {} for kind in found}
    announced = []

    def agree():
        announced.extend(sample for sample in told.take(N=100) if sample.sample_info.valid_data)
        for kind, reader in found.items():
            for sample in reader.take(N=1000):
                names[kind][sample.key.bytes] = (sample.participant_key.bytes, sample.topic_name)
        nodes = [(bytes(a.gid.data), a.nodes[0]) for a in announced if a.nodes and a.nodes[0].node_name == "peer"]
        if not nodes:
            return False
        participant, node = nodes[-1]
        assert node.node_namespace == "/", node
        for kind, gids in [("reader", node.reader_gids), ("writer", node.writer_gids)]:
            ros = {key for key, (owner, topic) in names[kind].items()
                   if owner == participant and topic != "ros_discovery_info"}
            if not ros or ros != {bytes(gid.data) for gid in gids}:
                return False
        return True

    wait("the node announces the endpoints that it has", agree)


def check_client(wire, start):
    asked = wire.reader("rq/switchRequest", SwitchRequest)
    answers = wire.writer("rr/switchReply", SwitchResponse)
    peer = start("-r", "__node:=asker", "-p", "peer.ask:=true")
    request = take(asked, 1, "questions")[0]
    assert request.data is True
    # Meant for somebody else: it must not be taken.
    answers.write(SwitchResponse(request.client ^ 1, request.number, False, "wrong"))
    answers.write(SwitchResponse(request.client, request.number, True, "from afar"))
    line = peer.stdout.readline().strip()
    assert line == "answer: true from afar", line


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--peer", type=Path, default=Path("target/release/examples/peer"))
    options.add_argument("--domain", type=int, default=77)
    options = options.parse_args()
    environment = dict(os.environ, ROS_DOMAIN_ID=str(options.domain), RMW_IMPLEMENTATION="rmw_cyclonedds_cpp")
    peers = []

    def start(*args):
        command = [options.peer, "--ros-args", *args]
        peers.append(subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True))
        return peers[-1]

    wire, failed = Wire(options.domain), 0
    start()
    try:
        for name, check in [
            ("100 messages to the node and back", lambda: check_topics(wire)),
            ("a latched message for a late joiner", lambda: check_latched(wire)),
            ("a call of the node's service", lambda: check_server(wire)),
            ("the node's parameter services", lambda: check_parameters(wire)),
            ("the node's endpoints in the graph", lambda: check_graph(wire)),
            ("a call that the node makes", lambda: check_client(wire, start)),
        ]:
            since = time.monotonic()
            try:
                check()
                print(f"ok      {name} ({time.monotonic() - since:.2f} s)")
            except AssertionError as error:
                failed += 1
                print(f"FAILED  {name}: {error}")
    finally:
        for peer in peers:
            peer.terminate()
        for peer in peers:
            status = peer.wait(timeout=10)
            if status != 130:
                failed += 1
                print(f"FAILED  a peer ended with status {status} on SIGTERM, not 130")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
