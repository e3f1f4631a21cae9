#!/usr/bin/env python3
"""Calls mesh_reconstructor's `reconstruct` from another DDS implementation (Eclipse Cyclone DDS, PyPI cyclonedds
11.0.1), by rmw_cyclonedds's convention, and reads the mesh from `model_mesh`.

Usage: cargo build --release -p puffer
       python -m venv VENV && VENV/bin/pip install -r tests/independent/requirements-dds.txt
       VENV/bin/python tests/independent/reconstruct_check.py SCANS [--puffer target/release/puffer] [--domain 78]

SCANS is a scan folder, such as `scans` in a run folder. Exit status 1 if anything fails.
"""

import argparse
import os
import pathlib
import subprocess
import sys
import tempfile
from dataclasses import dataclass

from cyclonedds.core import Policy
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32, int32, int64, sequence, uint8, uint16, uint32, uint64

from dds_check import CLIENT, Header, Wire, matched, quality, take


@dataclass
class Request(IdlStruct, typename="puffer_msgs::srv::dds_::Reconstruct_Request_"):
    client: uint64
    number: int64
    input: str
    output_path: str
    edge_length: float32


@dataclass
class Response(IdlStruct, typename="puffer_msgs::srv::dds_::Reconstruct_Response_"):
    client: uint64
    number: int64
    success: bool
    error_code: uint16
    message: str
    mesh_path: str
    vertices: uint32
    triangles: uint32
    genus: int32
    closed: bool
    mean_sigma: float32
    unobserved_share: float32
    seconds: float32


@dataclass
class ModelMesh(IdlStruct, typename="puffer_msgs::msg::dds_::ModelMesh_"):
    header: Header
    vertices: sequence[float32]
    triangles: sequence[uint32]
    normals: sequence[float32]
    sigma: sequence[float32]
    observed: sequence[uint8]


def check(wire, scans, folder):
    requests = wire.writer("rq/mesh_reconstructor/reconstructRequest", Request)
    replies = wire.reader("rr/mesh_reconstructor/reconstructReply", Response)
    latched = quality(Policy.Durability.TransientLocal, depth=1)
    meshes = wire.reader("rt/model_mesh", ModelMesh, latched)
    matched(requests, replies)
    requests.write(Request(CLIENT, 1, str(scans), "", 0.0))
    (reply,) = take(replies, 1, "the answer of reconstruct")
    assert (reply.client, reply.number) == (CLIENT, 1), reply
    assert reply.success and reply.closed and reply.error_code == 0, reply
    assert pathlib.Path(reply.mesh_path).is_file(), reply.mesh_path
    print(f"reconstruct: {reply.vertices} vertices, {reply.triangles} triangles, genus {reply.genus}, closed, "
          f"{reply.seconds:.1f} s")
    (mesh,) = take(meshes, 1, "model_mesh")
    assert len(mesh.vertices) == 3 * reply.vertices and len(mesh.triangles) == 3 * reply.triangles
    print(f"model_mesh: {len(mesh.vertices) // 3} vertices in frame {mesh.header.frame_id}")
    requests.write(Request(CLIENT, 2, str(folder / "nothing"), "", 0.0))
    (reply,) = take(replies, 1, "the second answer")
    assert not reply.success and "nothing" in reply.message, reply
    print(f"a wrong path: code {reply.error_code}, {reply.message}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scans", type=pathlib.Path)
    parser.add_argument("--puffer", default="target/release/puffer")
    parser.add_argument("--domain", type=int, default=78)
    arguments = parser.parse_args()
    environment = dict(os.environ, ROS_DOMAIN_ID=str(arguments.domain), RMW_IMPLEMENTATION="rmw_cyclonedds_cpp")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        node = subprocess.Popen(
            [arguments.puffer, "node", "mesh_reconstructor", "--ros-args", "-p", f"mesh.output_folder:={folder}"],
            env=environment)
        try:
            check(Wire(arguments.domain), arguments.scans.resolve(), folder)
        finally:
            node.terminate()
            node.wait(10)
    return 0


if __name__ == "__main__":
    sys.exit(main())
