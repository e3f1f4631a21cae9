"""Pairs (result, truth) of meshes for assess_check.py, in metres; each mesh with its vertices' sigma or None."""

import manifold3d
import numpy as np
import open3d as o3d
import trimesh
from trimesh.creation import box, cylinder, icosphere, torus


def as_written(pair_mesh):
    """The mesh as a file with single-precision coordinates holds it, without any merging or cleaning."""
    mesh, sigma = pair_mesh
    vertices = mesh.vertices.astype(np.float32).astype(float)
    sigma = None if sigma is None else sigma.astype(np.float32).astype(float)
    return trimesh.Trimesh(vertices, mesh.faces, process=False), sigma


def solid(mesh):
    return manifold3d.Manifold(manifold3d.Mesh(
        np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)))


def surface(body, edge):
    """A manifold3d body as a mesh with no edge longer than `edge`."""
    made = body.refine_to_length(edge).to_mesh()
    return trimesh.Trimesh(made.vert_properties[:, :3], made.tri_verts, process=False)


def noisy(mesh, sigma, seed, smooth=0):
    """The mesh with normal noise along its vertex normals, averaged `smooth` times over neighbours."""
    noise = np.random.default_rng(seed).normal(size=len(mesh.vertices))
    for _ in range(smooth):
        edges = mesh.edges_unique
        total, count = noise.copy(), np.ones(len(noise))
        for a, b in (edges.T, edges[:, ::-1].T):
            np.add.at(total, a, noise[b])
            np.add.at(count, a, 1)
        noise = total / count
    noise *= sigma / noise.std()
    return trimesh.Trimesh(mesh.vertices + mesh.vertex_normals * noise[:, None], mesh.faces, process=False)


def at(mesh, x=0.0, y=0.0, z=0.0):
    shifted = mesh.copy()
    shifted.apply_translation([x, y, z])
    return shifted


def handle_body():
    """A mug: a cup with a handle, genus 1."""
    cup = solid(cylinder(0.04, 0.1, sections=96)) - solid(at(cylinder(0.036, 0.1, sections=96), z=0.006))
    ring = at(torus(0.025, 0.006, major_sections=64, minor_sections=32), x=0.045)
    ring.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    handle = solid(ring) - solid(cylinder(0.038, 0.2, sections=96))
    return surface(cup + handle, 0.003)


def asymmetric():
    body = solid(box([0.08, 0.05, 0.03])) + solid(at(cylinder(0.012, 0.06, sections=64), x=0.02, z=0.02))
    return surface(body + solid(at(icosphere(4, 0.015), x=-0.03, y=0.02, z=0.015)), 0.003)


def noisy_sphere():
    truth = icosphere(5, 0.05)
    base = icosphere(5, 0.05)
    rng = np.random.default_rng(1)
    sigma = np.where(base.vertices[:, 2] > 0, 2e-4, 5e-4) * rng.uniform(0.8, 1.2, len(base.vertices))
    noise = rng.normal(size=len(sigma)) * sigma
    result = trimesh.Trimesh(base.vertices + base.vertex_normals * noise[:, None], base.faces, process=False)
    return (result, np.where(base.vertices[:, 0] > 0.04, np.nan, sigma)), (truth, None)


def coarse_torus():
    return ((torus(0.06, 0.02, major_sections=48, minor_sections=24), None),
            (torus(0.06, 0.02, major_sections=160, minor_sections=80), None))


def box_with_hole():
    body = solid(box([0.1, 0.07, 0.05])) - solid(cylinder(0.015, 0.2, sections=64))
    truth = surface(body, 0.004)
    return (noisy(truth, 3e-4, 2, smooth=2), None), (truth, None)


def two_components():
    parts = [at(icosphere(4, 0.03), x=-0.05), at(torus(0.025, 0.01), x=0.05)]
    truth = trimesh.util.concatenate(parts)
    return (noisy(truth, 5e-4, 3, smooth=1), None), (truth, None)


def self_intersecting():
    body, ball = asymmetric(), at(icosphere(4, 0.02), x=0.0213, y=0.0071, z=-0.0331)
    union = (solid(body) + solid(ball)).to_mesh()
    truth = trimesh.Trimesh(union.vert_properties[:, :3], union.tri_verts, process=False)
    return (noisy(trimesh.util.concatenate([body, ball]), 1e-4, 9), None), (truth, None)


def shifted():
    truth = asymmetric()
    return (at(noisy(truth, 2e-4, 4), x=0.002, y=-0.001, z=0.0015), None), (truth, None)


def turned():
    truth = asymmetric()
    result = noisy(truth, 2e-4, 5)
    result.apply_transform(trimesh.transformations.rotation_matrix(0.06, [1, 2, 3], [0.03, 0, 0]))
    return (at(result, z=0.001), None), (truth, None)


def decimated():
    base = icosphere(6, 0.05)
    x, y, z = 60 * base.vertices.T
    bumps = 1 + 0.06 * np.sin(2 * x) * np.cos(3 * y) + 0.05 * np.sin(2 * z + x)
    truth = trimesh.Trimesh(base.vertices * bumps[:, None], base.faces, process=False)
    shape = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(truth.vertices), o3d.utility.Vector3iVector(truth.faces))
    fewer = shape.simplify_quadric_decimation(2000)
    result = trimesh.Trimesh(np.asarray(fewer.vertices), np.asarray(fewer.triangles), process=False)
    return (result, None), (truth, None)


def mug():
    truth = handle_body()
    return (noisy(truth, 3e-4, 6, smooth=2), None), (truth, None)


def open_result():
    truth = asymmetric()
    result = noisy(truth, 3e-4, 7, smooth=1)
    result.update_faces(result.triangles_center[:, 0] < 0.0375)
    result.remove_unreferenced_vertices()
    return (result, None), (truth, None)


def open_truth():
    (result, _), (truth, _) = open_result()
    return (noisy(truth, 3e-4, 8, smooth=1), None), (result, None)


def broken():
    """A bow-tie vertex, a flipped triangle, a fin and a missing triangle."""
    body = asymmetric()
    truth = trimesh.util.concatenate([body, at(icosphere(3, 0.03), x=0.071)])
    n = len(body.vertices)
    left = n + np.argmin(truth.vertices[n:, 0])
    # The ball's leftmost vertex becomes one with the body's nearest.
    right = np.argmin(np.linalg.norm(body.vertices - truth.vertices[left], axis=1))
    vertices, faces = truth.vertices.copy(), truth.faces.copy()
    faces[faces == left] = right
    flip, gone, base = len(faces) - 10, len(faces) - 700, faces[len(faces) - 200]
    faces[flip] = faces[flip][::-1]
    tip = vertices[base].mean(axis=0) * 1.01
    faces = np.vstack([np.delete(faces, gone, axis=0), [[base[0], base[1], len(vertices)]]])
    result = trimesh.Trimesh(np.vstack([vertices, [tip]]), faces, process=False)
    result.remove_unreferenced_vertices()
    result = noisy(result, 2e-4, 10)
    return (result, None), (truth, None)


PAIRS = {make.__name__: make for make in (
    noisy_sphere, coarse_torus, box_with_hole, two_components, self_intersecting, shifted, turned, decimated, mug,
    open_result, open_truth, broken)}
