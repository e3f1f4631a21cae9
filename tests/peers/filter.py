"""Compares the time of `puffer filter` with PCL's moving least squares on the same points.

    apt-get install pcl-tools
    puffer simulate --object coffee --noise P1 --views 26 -o DIR
    python filter.py DIR                                      at the poses in DIR, taken as exact
    python filter.py DIR --radius 0.001 --views 8             PCL searches 1 mm; only the first 8 views

Both get the same scans at the same poses, and run one after the other. PCL's tool uses one thread, so puffer is run
with one as well as with all. PCL's search radius is the noise radius that puffer derived, unless one is given; its time
is what its tool prints for the smoothing alone, puffer's what it prints for its stage `filter`. Reading, writing and
the merging of the scans count for neither.
"""

import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile

import numpy as np
import open3d as o3d


def part(folder, count, into):
    """A scan folder with the first `count` views of `folder`."""
    document = json.loads((folder / "poses.json").read_text())
    document["views"] = document["views"][:count]
    for view in document["views"]:
        shutil.copy(folder / view["cloud"], into / view["cloud"])
    (into / "poses.json").write_text(json.dumps(document))


def merge(folder, path):
    """Writes all points of a scan folder in the frame of the object; gives their number."""
    merged = o3d.geometry.PointCloud()
    for view in json.loads((folder / "poses.json").read_text())["views"]:
        cloud = o3d.io.read_point_cloud(str(folder / view["cloud"])).remove_non_finite_points()
        merged += o3d.geometry.PointCloud(cloud.points).transform(np.array(view["object_from_sensor"]))
    o3d.io.write_point_cloud(str(path), merged)
    return len(merged.points)


def with_puffer(puffer, folder, output, threads):
    """Seconds of the stage `filter`, and the report."""
    command = [puffer, "filter", folder, "--poses", "exact", "-o", output, "--json", "--threads", str(threads)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(re.search(r"filter took ([\d.]+) s", done.stderr)[1]), json.loads(done.stdout)


def with_pcl(cloud, output, radius):
    """Seconds of the smoothing, and the points that come out."""
    command = ["pcl_mls_smoothing", cloud, output, "-radius", str(radius), "-sqr_gauss_param", str(radius**2)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=True)
    text = re.sub(r"\x1b\[[\d;]*m", "", done.stdout)
    milliseconds, points = re.search(r"Computing .*?([\d.e+]+) ms : (\d+) points", text, re.DOTALL).groups()
    return float(milliseconds) / 1e3, int(points)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--puffer", default="puffer", help="the program")
    parser.add_argument("--radius", type=float, help="PCL's search radius, metres; puffer's own if not given")
    parser.add_argument("--views", type=int, help="only the first views of the folder")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work, folder = pathlib.Path(temporary), arguments.folder
        if arguments.views:
            folder = work / "scans"
            folder.mkdir()
            part(arguments.folder, arguments.views, folder)
        points = merge(folder, work / "merged.pcd")
        print(f"{points} points", flush=True)
        ours = {}
        for threads in sorted({1, os.cpu_count()}):
            ours[threads], report = with_puffer(arguments.puffer, folder, work / "puffer.ply", threads)
            print(f"puffer, {threads} threads: {ours[threads]:.1f} s, {report['points']} points", flush=True)
        radius = arguments.radius or report["noise_radius_mm"] / 1e3
        seconds, left = with_pcl(work / "merged.pcd", work / "pcl.pcd", radius)
        print(f"PCL, 1 thread, radius {radius * 1e3:.2f} mm: {seconds:.1f} s, {left} points")
        print("ratio: " + ", ".join(f"{seconds / s:.1f} (puffer with {t} threads)" for t, s in ours.items()))


if __name__ == "__main__":
    main()
