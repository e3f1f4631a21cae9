#!/usr/bin/env python3
"""Holds `puffer evaluate --json` against trimesh and Open3D on mesh pairs with known faults.

Usage: PUFFER_BIN=target/release/puffer python tests/independent/assess_check.py [PAIR ...]

Prints a table of ours, theirs and their ratio. Exit status 1 if any distance, share or angle differs by more than
1 %, or any count or gate at all. Both sides take 400,000 samples, each its own. The Hausdorff distance of samples is
the largest of random numbers: ours must lie between the least that 100,000 of the other side's samples give and what
they give together with the vertices and dense points on the farthest faces. Lengths are metres in the files and mm
in the table.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import open3d as o3d
import trimesh
from scipy.stats import spearmanr

import mesh_pairs

SAMPLES = 400_000
RELATIVE = 0.01
# Floors where a ratio means nothing: 0.5 micrometres (single precision in RaycastingScene), the
# spread of a share of so many samples, a rank correlation's own spread, degrees.
FLOORS = {"mm": 5e-4, "share": 2e-3, "rank": 0.01, "deg": 1e-3}
EXACT = ["closed", "two_manifold", "oriented", "self_intersecting_faces", "genus", "components",
         "vertices", "triangles"]
UNITS = {"f_1mm": "share", "f_half_percent": "share", "normal_consistency": "share", "holes": "share",
         "double_surface": "share", "covered_share": "share", "within_1_sigma": "share",
         "within_2_sigma": "share", "min_angle_above_20": "share", "min_angle_p1": "deg",
         "sigma_rank_correlation": "rank"}


def write_ply(path, pair_mesh):
    """Binary PLY with single-precision vertices, and sigma and observed where the mesh has them."""
    mesh, sigma = pair_mesh
    fields = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
    if sigma is not None:
        fields += [("sigma", "<f4"), ("observed", "u1")]
    rows = np.zeros(len(mesh.vertices), fields)
    for axis, name in enumerate("xyz"):
        rows[name] = mesh.vertices[:, axis]
    if sigma is not None:
        rows["sigma"] = sigma
        rows["observed"] = np.isfinite(sigma)
    faces = np.zeros(len(mesh.faces), [("n", "u1"), ("v", "<i4", 3)])
    faces["n"] = 3
    faces["v"] = mesh.faces
    names = {"<f4": "float", "u1": "uchar"}
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    head += [f"property {names[kind]} {name}" for name, kind in fields]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    path.write_bytes("\n".join(head).encode() + rows.tobytes() + faces.tobytes())


def ours(result, truth):
    """What `puffer evaluate` says of the pair."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, name) for name in ("result.ply", "truth.ply")]
        write_ply(paths[0], result)
        write_ply(paths[1], truth)
        command = [os.environ["PUFFER_BIN"], "evaluate", str(paths[0]), "--truth", str(paths[1]), "--json",
                   "--samples", str(SAMPLES), "--seed", "1"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}\nexit status {done.returncode}: {done.stderr}")
        return json.loads(done.stdout)


def legacy(mesh):
    return o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(mesh.vertices), o3d.utility.Vector3iVector(mesh.faces))


class Target:
    """A mesh to measure against, in an Open3D RaycastingScene (Embree)."""

    def __init__(self, mesh):
        self.mesh = mesh
        self.scene = o3d.t.geometry.RaycastingScene()
        self.scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(legacy(mesh)))
        edges = mesh.edges_sorted.reshape(-1, 3, 2)
        _, inverse, count = np.unique(
            mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True)
        self.side_open = (count[inverse.ravel()] == 1).reshape(-1, 3)
        self.corner_open = np.isin(mesh.faces, np.unique(edges[self.side_open]))

    def nearest(self, points):
        found = self.scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))
        closest = found["points"].numpy().astype(float)
        face = found["primitive_ids"].numpy()
        # Face normals in double precision rather than Embree's.
        return closest, self.mesh.face_normals[face], self.on_boundary(closest, face)

    def on_boundary(self, closest, face):
        corners = self.mesh.triangles[face]
        weights = trimesh.triangles.points_to_barycentric(corners, closest)
        near_zero = np.abs(weights) < 1e-4
        # Side k of a face runs from corner k to k + 1: the weight of corner k + 2 is zero on it.
        on_side = near_zero[:, [2, 0, 1]] & self.side_open[face]
        on_corner = (weights > 1 - 2e-4) & self.corner_open[face]
        return on_side.any(axis=1) | on_corner.any(axis=1)


def moved(transform, points):
    return points @ transform[:3, :3].T + transform[:3, 3]


def icp(points, truth, rng):
    """Open3D's point-to-plane ICP from the identity without a radius; first coarse, then fine."""
    def cloud(positions, normals=None):
        made = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(positions))
        if normals is not None:
            made.normals = o3d.utility.Vector3dVector(normals)
        return made

    target_points, target_faces = trimesh.sample.sample_surface(truth.mesh, 600_000, seed=7)
    target = cloud(target_points, truth.mesh.face_normals[target_faces])
    # Points that are nearest to the rim of an open truth have no counterpart.
    keep = ~truth.nearest(points)[2]
    transform = np.eye(4)
    for count, iterations in ((3_000, 60), (100_000, 8), (100_000, 8), (100_000, 8)):
        chosen = rng.choice(np.flatnonzero(keep), min(count, keep.sum()), replace=False)
        transform = o3d.pipelines.registration.registration_icp(
            cloud(points[chosen]), target, 1e3, transform,
            o3d.pipelines.registration.TransformationEstimationPointToPlane(),
            o3d.pipelines.registration.ICPConvergenceCriteria(1e-9, 1e-9, iterations)).transformation
        keep = ~truth.nearest(moved(transform, points))[2]
    return transform


def f_score(there, back, threshold):
    precision, recall = np.mean(there < threshold), np.mean(back < threshold)
    return 2 * precision * recall / max(precision + recall, 1e-300)


def farthest(mesh, target, transform, rng):
    """The largest distance of the vertices, and of many points on the ten faces whose centres are farthest."""
    def apart(points):
        points = moved(transform, points)
        return np.linalg.norm(points - target.nearest(points)[0], axis=1)

    faces = np.argsort(apart(mesh.triangles_center))[-10:]
    weights = rng.dirichlet(np.ones(3), 2000)
    return max(apart(mesh.vertices).max(),
               apart(np.einsum("wk,fkx->fwx", weights, mesh.triangles[faces]).reshape(-1, 3)).max())


def distances(samples, transform, result, truth, diagonal):
    """The figures that depend on the alignment, mm; the Hausdorff distance with its bounds."""
    rng = np.random.default_rng(12)
    (result_points, result_normals), (truth_points, truth_normals) = samples
    here = moved(transform, result_points)
    closest, normals, boundary = truth.nearest(here)
    there = np.linalg.norm(here - closest, axis=1)
    cosine_there = np.abs(np.sum(result_normals @ transform[:3, :3].T * normals, axis=1))
    inverse = np.linalg.inv(transform)
    back_points = moved(inverse, truth_points)
    closest, normals, _ = result.nearest(back_points)
    back = np.linalg.norm(back_points - closest, axis=1)
    cosine_back = np.abs(np.sum(truth_normals @ inverse[:3, :3].T * normals, axis=1))
    figures = {}
    for name, values in (("accuracy", there), ("completeness", back)):
        figures[f"{name}_mean"] = 1e3 * values.mean()
        figures[f"{name}_rms"] = 1e3 * np.sqrt(np.mean(values**2))
        figures[f"{name}_90"] = 1e3 * np.percentile(values, 90)
    figures["chamfer"] = 500 * (there.mean() + back.mean())
    draws = zip(np.array_split(rng.permutation(there), 4), np.array_split(rng.permutation(back), 4))
    least = min(max(a.max(), b.max()) for a, b in draws)
    most = max(there.max(), back.max(), farthest(result.mesh, truth, transform, rng),
               farthest(truth.mesh, result, inverse, rng))
    figures["hausdorff"] = 1e3 * np.array([least, max(there.max(), back.max()), most])
    figures["f_1mm"] = f_score(there, back, 1e-3)
    figures["f_half_percent"] = f_score(there, back, 5e-3 * diagonal)
    figures["normal_consistency"] = (cosine_there.mean() + cosine_back.mean()) / 2
    return figures, there, back, boundary


def segments_pierce(starts, ends, triangles):
    """Whether each segment passes through its triangle (Moeller and Trumbore 1997), none of them coplanar."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    direction = ends - starts
    across = np.cross(direction, c - a)
    volume = np.einsum("ij,ij->i", b - a, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", starts - a, across) / volume
        turned = np.cross(starts - a, b - a)
        v = np.einsum("ij,ij->i", direction, turned) / volume
        t = np.einsum("ij,ij->i", c - a, turned) / volume
        return (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)


def cut_at_corners(mesh):
    """Faces that pierce one with which they share a single vertex; Open3D passes over those pairs."""
    order = np.argsort(mesh.faces, axis=None, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(mesh.faces.ravel()[order])) + 1)
    pairs = np.array([(i, j) for group in groups for i in group for j in group if i < j])
    faces, corners = pairs // 3, pairs % 3
    common = (mesh.faces[faces[:, 0]][:, :, None] == mesh.faces[faces[:, 1]][:, None, :]).sum((1, 2))
    faces, corners = faces[common == 1], corners[common == 1]
    found = np.zeros(len(faces), bool)
    for own, other in ((0, 1), (1, 0)):
        rows = np.arange(len(faces))
        mine = mesh.triangles[faces[:, own]]
        found |= segments_pierce(mine[rows, (corners[:, own] + 1) % 3], mine[rows, (corners[:, own] + 2) % 3],
                                 mesh.triangles[faces[:, other]])
    return faces[found]


def topology(mesh):
    shape = legacy(mesh)
    _, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    closed = bool(count.min() > 1)
    manifold = shape.is_edge_manifold(allow_boundary_edges=True) and shape.is_vertex_manifold()
    oriented = bool(mesh.is_winding_consistent)
    cut = np.concatenate([np.asarray(shape.get_self_intersecting_triangles()).ravel(),
                          cut_at_corners(mesh).ravel()])
    angles = np.degrees(mesh.face_angles.min(axis=1))
    genus = mesh.body_count - mesh.euler_number // 2
    return {
        "vertices": len(mesh.vertices), "triangles": len(mesh.faces), "closed": closed,
        "two_manifold": manifold, "oriented": oriented, "self_intersecting_faces": len(np.unique(cut)),
        "genus": int(genus) if closed and manifold and oriented else None,
        "components": int(mesh.body_count), "min_angle_p1": np.percentile(angles, 1),
        "min_angle_above_20": np.mean(angles > 20),
    }


def calibration(mesh, sigma, truth, rng):
    chosen = np.isfinite(sigma)
    points = mesh.vertices[chosen]
    here = moved(icp(points, truth, rng), points).astype(np.float32)
    error = truth.scene.compute_signed_distance(o3d.core.Tensor(here)).numpy()
    return {
        "within_1_sigma": np.mean(np.abs(error) <= sigma[chosen]),
        "within_2_sigma": np.mean(np.abs(error) <= 2 * sigma[chosen]),
        "sigma_rank_correlation": spearmanr(sigma[chosen], np.abs(error)).statistic,
        "error_bias": 1e3 * error.mean(), "sigma_mean": 1e3 * sigma[chosen].mean(),
    }


def theirs(result_pair, truth_pair):
    """The same figures by trimesh and Open3D."""
    rng = np.random.default_rng(11)
    (mesh, sigma), (truth_mesh, _) = result_pair, truth_pair
    result, truth = Target(mesh), Target(truth_mesh)
    diagonal = np.linalg.norm(truth_mesh.extents)
    samples = []
    for seed, each in ((21, mesh), (22, truth_mesh)):
        points, faces = trimesh.sample.sample_surface(each, SAMPLES, seed=seed)
        samples.append((np.asarray(points), each.face_normals[faces]))
    figures = topology(mesh)
    raw = distances(samples, np.eye(4), result, truth, diagonal)[0]
    figures |= {f"raw_{key}": value for key, value in raw.items()}
    transform = icp(samples[0][0], truth, rng)
    aligned, there, back, boundary = distances(samples, transform, result, truth, diagonal)
    figures |= aligned
    figures["crms_mean"], figures["crms_rms"] = aligned["accuracy_mean"], aligned["accuracy_rms"]
    figures["double_surface_sigma"] = 1e3 * max(1.4826 * np.median(there), 1e-6 * diagonal)
    if figures["double_surface_sigma"] > FLOORS["mm"]:
        figures["double_surface"] = np.mean(there > 3e-3 * figures["double_surface_sigma"])
    figures["holes"] = np.mean(back > 2e-3)
    if truth.side_open.any():
        covered = there[~boundary]
        figures["covered_share"] = len(covered) / len(there)
        figures["accuracy_covered_mean"] = 1e3 * covered.mean()
        figures["accuracy_covered_rms"] = 1e3 * np.sqrt(np.mean(covered**2))
        figures["accuracy_covered_90"] = 1e3 * np.percentile(covered, 90)
    if sigma is not None:
        figures |= calibration(mesh, sigma, truth, rng)
    return figures


def agree(key, a, b):
    if key in EXACT or a is None or b is None:
        return a == b
    if key.endswith("hausdorff"):
        return (1 - RELATIVE) * b[0] - FLOORS["mm"] <= a <= (1 + RELATIVE) * b[2] + FLOORS["mm"]
    floor = FLOORS[UNITS.get(key.removeprefix("raw_"), "mm")]
    return abs(a - b) <= max(RELATIVE * abs(b), floor)


def text(value):
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def main():
    wanted = sys.argv[1:]
    failed = 0
    print(f"{'pair':<20}{'figure':<28}{'ours':>12}{'theirs':>12}{'ratio':>9}")
    for name, make in mesh_pairs.PAIRS.items():
        if wanted and name not in wanted:
            continue
        pair = [mesh_pairs.as_written(each) for each in make()]
        mine, other = ours(*pair), theirs(*pair)
        for key, value in other.items():
            own = mine.get(key)
            good = key in mine and agree(key, own, value)
            value = float(value[1]) if isinstance(value, np.ndarray) else value
            value = float(value) if isinstance(value, np.floating) else value
            failed += not good
            numeric = isinstance(own, float) and isinstance(value, float) and value != 0
            ratio = f"{own / value:.4f}" if numeric else ""
            mark = "" if good else "  DIFFERS"
            print(f"{name:<20}{key:<28}{text(own):>12}{text(value):>12}{ratio:>9}{mark}", flush=True)
    print(f"{failed} figures differ" if failed else "all figures agree")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
