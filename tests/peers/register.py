"""Registers scan folders with Open3D and small_gicp, for `puffer-bench registration --judge`.

    puffer-bench registration --keep DIR ...                  writes scan folders, measures puffer
    python register.py DIR                                    writes DIR/CASE.open3d.json, DIR/CASE.small_gicp.json
    puffer-bench registration --keep DIR --judge open3d ...   measures those poses in the same way

Both peers do the same, in the two rounds of Open3D's own reconstruction system, register and refine: pairwise alignment
of all scans that overlap at the robot's poses, Open3D's pose graph over these pairs, then all pairs that overlap at its
poses once more, and the graph over these. Open3D aligns by point-to-plane ICP, small_gicp by GICP. Neither takes the
robot's pose as anything but the start. For times in one thread, set OMP_NUM_THREADS=1, and give puffer-bench --threads 1.

Why it is set so: scans are not taken in sequence, so no edge is certain, and the graph's line process may give up any
of them (one that is certain and slid drags the rest along). Alignments with few correspondences are left out. No search
is wider than about what the starts are wrong by, or else more scans slip by a flute of the filter. Scans that overlap
are found with a tolerance as wide as that, for Open3D leaves the poses as they are where the graph falls into parts.
"""

import argparse
import json
import pathlib
import time

import numpy as np
import open3d as o3d
import small_gicp

# Voxel, radius of a normal's neighbourhood, distance within which scans overlap at the robot's poses (about what these
# are wrong by for two scans), and search radii of the stages of an alignment, of which the last is two voxels; metres.
SETTINGS = {"laser": (0.001, 0.003, 0.006, (0.006, 0.002)), "stereo": (0.003, 0.009, 0.010, (0.006,))}
# Pairs that share less than this of their points are not aligned.
OVERLAP = 0.3
# A smaller share of points with a correspondence in the last stage is taken for a failure.
LEAST_FITNESS = 0.3


def load(folder):
    """Clouds in the sensor frame, their poses object_from_sensor, and the kind of sensor."""
    document = json.loads((folder / "poses.json").read_text())
    clouds, poses = [], []
    for view in document["views"]:
        cloud = o3d.io.read_point_cloud(str(folder / view["cloud"]))
        clouds.append(cloud.remove_non_finite_points())
        poses.append(np.array(view["object_from_sensor"]))
    return clouds, poses, document["sensor"]


def prepare(cloud, voxel, radius):
    thin = cloud.voxel_down_sample(voxel)
    thin, _ = thin.remove_statistical_outlier(20, 2.5)
    thin.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius, 30))
    thin.orient_normals_towards_camera_location(np.zeros(3))
    return thin


def with_open3d(source, target, start, radii):
    # Fitness: the share of points with a correspondence.
    for radius in radii:
        loss = o3d.pipelines.registration.TukeyLoss(radius)
        method = o3d.pipelines.registration.TransformationEstimationPointToPlane(loss)
        found = o3d.pipelines.registration.registration_icp(source, target, radius, start, method)
        start = found.transformation
    return start, found.fitness >= LEAST_FITNESS


def with_small_gicp(source, target, start, radii):
    for radius in radii:
        found = small_gicp.align(target["cloud"], source["cloud"], target["tree"], start, "GICP", radius, 1)
        start = found.T_target_source
    return start, bool(found.converged) and found.num_inliers >= LEAST_FITNESS * source["cloud"].size()


def overlapping(clouds, poses, radius):
    """Pairs (i, j), i < j, that overlap at these poses."""
    placed = [o3d.geometry.PointCloud(c).transform(p) for c, p in zip(clouds, poses)]
    pairs = []
    for i, a in enumerate(placed):
        for j in range(i + 1, len(placed)):
            near = np.asarray(a.compute_point_cloud_distance(placed[j])) < radius
            if near.mean() >= OVERLAP:
                pairs.append((i, j))
    return pairs


def optimise(clouds, poses, edges, radius):
    """Open3D's pose graph; node poses are object_from_sensor."""
    registration = o3d.pipelines.registration
    graph = registration.PoseGraph()
    for pose in poses:
        graph.nodes.append(registration.PoseGraphNode(pose))
    for i, j, j_from_i in edges:
        information = registration.get_information_matrix_from_point_clouds(clouds[i], clouds[j], radius, j_from_i)
        graph.edges.append(registration.PoseGraphEdge(i, j, j_from_i, information, uncertain=True))
    registration.global_optimization(
        graph,
        registration.GlobalOptimizationLevenbergMarquardt(),
        registration.GlobalOptimizationConvergenceCriteria(),
        registration.GlobalOptimizationOption(
            max_correspondence_distance=radius, edge_prune_threshold=0.25, reference_node=0
        ),
    )
    return [node.pose for node in graph.nodes]


def whole(clouds, inputs, poses, align, reach, radii):
    """The poses of all scans, in two rounds."""
    for near, stages in ((reach, radii), (radii[-1], radii[-1:])):
        edges = []
        for i, j in overlapping(clouds, poses, near):
            relative, accepted = align(inputs[i], inputs[j], np.linalg.inv(poses[j]) @ poses[i], stages)
            if accepted:
                edges.append((i, j, relative))
        poses = optimise(clouds, poses, edges, radii[-1])
    return poses


def pairs(inputs, poses, align, radii):
    """Each scan onto the one that was taken nearest to it."""
    places = np.array([p[:3, 3] for p in poses])
    found = []
    for moving, pose in enumerate(poses):
        distances = np.linalg.norm(places - places[moving], axis=1)
        distances[moving] = np.inf
        fixed = int(distances.argmin())
        start = np.linalg.inv(poses[fixed]) @ pose
        started = time.perf_counter()
        relative, accepted = align(inputs[moving], inputs[fixed], start, radii)
        milliseconds = (time.perf_counter() - started) * 1e3
        found.append({
            "moving": moving, "fixed": fixed, "fixed_from_moving": relative.tolist(),
            "milliseconds": milliseconds, "accepted": accepted,
        })
    return found


def register(folder, peer):
    clouds, poses, sensor = load(folder)
    voxel, normals, reach, radii = SETTINGS[sensor]
    prepared = [prepare(c, voxel, normals) for c in clouds]
    inputs = prepared
    if peer == "small_gicp":
        inputs = []
        for cloud in prepared:
            points, tree = small_gicp.preprocess_points(np.asarray(cloud.points), voxel, num_threads=1)
            inputs.append({"cloud": points, "tree": tree})
    align = with_open3d if peer == "open3d" else with_small_gicp
    # Preparation is not counted: all programs need it.
    alone = pairs(inputs, poses, align, radii)
    started = time.perf_counter()
    found = whole(prepared, inputs, poses, align, reach, radii)
    return found, time.perf_counter() - started, alone


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--peers", default="open3d,small_gicp")
    arguments = parser.parse_args()
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    for poses in sorted(arguments.folder.glob("*/poses.json")):
        case = poses.parent
        if case.suffix == ".truth":
            continue
        for peer in arguments.peers.split(","):
            found, seconds, alone = register(case, peer)
            document = {"seconds": seconds, "pairs": alone, "views": [{"object_from_sensor": p.tolist()} for p in found]}
            (arguments.folder / f"{case.name}.{peer}.json").write_text(json.dumps(document))
            print(f"{case.name} {peer} {seconds:.1f} s", flush=True)


if __name__ == "__main__":
    main()
