"""Runs other reconstructors on the clouds of a folder; see compare/reconstruction.sh.

usage: peers.py FOLDER CGAL_PROGRAM
Writes CASE.METHOD.INPUT.off and its seconds in .txt. Open3D (Poisson depth 8; ball pivoting with radii 1.5, 2, 3, 4 times the
mean distance of nearest neighbours; normals of 20 neighbours oriented along tangent planes) is left out, with a word, when it
cannot be imported.
"""

import glob
import os
import subprocess
import sys
import time

folder, cgal = sys.argv[1:]
try:
    import numpy as np
    import open3d as o3d

    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
except ImportError as e:
    print(f"skipped: Open3D ({e})")
    o3d = None


def write(path, mesh, seconds):
    points, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    with open(path + ".off", "w") as f:
        f.write(f"OFF\n{len(points)} {len(triangles)} 0\n")
        f.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
        f.writelines(f"3 {a} {b} {c}\n" for a, b, c in triangles.tolist())
    with open(path + ".txt", "w") as f:
        f.write(str(seconds))


for cloud in sorted(glob.glob(os.path.join(folder, "*.xyz"))):
    case, given = cloud[: -len(".xyz")].rsplit(".", 1)
    out = f"{case}.advancing-front.{given}"
    if not os.path.exists(out + ".txt"):
        done = subprocess.run([cgal, cloud, out + ".off"], capture_output=True, text=True, check=True)
        with open(out + ".txt", "w") as f:
            f.write(done.stdout)
    if o3d is None or os.path.exists(f"{case}.poisson.{given}.txt"):
        continue
    start = time.time()
    points = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.loadtxt(cloud)))
    points.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(20))
    points.orient_normals_consistent_tangent_plane(20)
    normals = time.time() - start
    start = time.time()
    radius = float(np.mean(points.compute_nearest_neighbor_distance()))
    radii = o3d.utility.DoubleVector([k * radius for k in (1.5, 2.0, 3.0, 4.0)])
    mesh = o3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(points, radii)
    write(f"{case}.ball-pivoting.{given}", mesh, normals + time.time() - start)
    start = time.time()
    mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(points, depth=8, n_threads=1)
    write(f"{case}.poisson.{given}", mesh, normals + time.time() - start)
