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
    parts = [icosphere(4, 0.03), at(icosphere(4, 0.03), x=0.0213, y=0.0071, z=0.0031)]
    union = (solid(parts[0]) + solid(parts[1])).to_mesh()
    truth = trimesh.Trimesh(union.vert_properties[:, :3], union.tri_verts, process=False)
    return (trimesh.util.concatenate(parts), None), (truth, None)


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
    truth = icosphere(5, 0.05)
    result = noisy(truth, 3e-4, 7, smooth=1)
    result.update_faces(result.triangles_center[:, 2] < 0.035)
    result.remove_unreferenced_vertices()
    return (result, None), (truth, None)


def open_truth():
    (result, _), (truth, _) = open_result()
    return (noisy(truth, 3e-4, 8, smooth=1), None), (result, None)


def broken():
    """A bow-tie vertex, a flipped triangle, a fin and a missing triangle."""
    truth = trimesh.util.concatenate([icosphere(3, 0.03), at(icosphere(3, 0.03), x=0.08)])
    faces = truth.faces.copy()
    n = len(truth.vertices) // 2
    right, left = np.argmax(truth.vertices[:n, 0]), n + np.argmin(truth.vertices[n:, 0])
    vertices = truth.vertices.copy()
    vertices[right] = vertices[left] = [0.04, 0, 0]
    faces[faces == left] = right
    used = np.delete(np.arange(len(vertices)), left)
    renumber = np.zeros(len(vertices), int)
    renumber[used] = np.arange(len(used))
    faces = renumber[faces]
    faces[10] = faces[10][::-1]
    vertices = np.vstack([vertices[used], [0.0, 0.0, 0.06]])
    fin = [faces[200][0], faces[200][1], len(vertices) - 1]
    faces = np.vstack([np.delete(faces, 700, axis=0), [fin]])
    return (trimesh.Trimesh(vertices, faces, process=False), None), (truth, None)


PAIRS = {make.__name__: make for make in (
    noisy_sphere, coarse_torus, box_with_hole, two_components, self_intersecting, shifted, turned, decimated, mug,
    open_result, open_truth, broken)}
