"""Race of rigid registration methods on the same clouds: one bone sampled twice, cut, made noisy and turned.

    cargo run --release --example registration_table -- 50 dump FOLDER CASE...
    python -m venv venv && venv/bin/pip install numpy scipy kiss-matcher addict plotly dash \
        scikit-learn pandas pyyaml tqdm matplotlib configargparse
    venv/bin/pip install --no-deps open3d-cpu==0.19.0          # 0.20.0 dies on import
    venv/bin/python compare/registration.py FOLDER [--voxel 0.02 0.03 0.04] [--methods fgr ransac pca kiss]

FOLDER holds, for every trial, CASE_TRIAL.json: {target: [[x, y, z]...], source: [...], T_target_source: 3x4 rows, diagonal},
and the same clouds de-noised by this project with normals (target_clean, target_normals, source_clean, source_normals).
Every method runs on the raw clouds and on the de-noised ones; the voxel size (share of the diagonal) is swept and the best one
printed, so that the peer is tuned. Success: rotation within 5 degrees.
"""

import argparse
import glob
import json
import os
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np


def cloud(points, normals=None, voxel=None):
    import open3d as o3d

    c = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.asarray(points)))
    if normals is not None:
        c.normals = o3d.utility.Vector3dVector(np.asarray(normals))
    down = c.voxel_down_sample(voxel) if voxel else c
    if normals is None:
        down.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(2 * voxel, 30))
        down.orient_normals_consistent_tangent_plane(15)
    return down


def features(c, voxel):
    import open3d as o3d

    return o3d.pipelines.registration.compute_fpfh_feature(c, o3d.geometry.KDTreeSearchParamHybrid(5 * voxel, 100))


def finish(source, target, start, voxel):
    import open3d as o3d

    reg = o3d.pipelines.registration
    pose = start
    for reach in (2.0, 1.0, 0.5):
        pose = reg.registration_icp(
            source, target, reach * voxel, pose, reg.TransformationEstimationPointToPlane()
        ).transformation
    return pose


def fgr(source, target, voxel):
    import open3d as o3d

    reg = o3d.pipelines.registration
    option = reg.FastGlobalRegistrationOption(maximum_correspondence_distance=0.5 * voxel)
    found = reg.registration_fgr_based_on_feature_matching(
        source, target, features(source, voxel), features(target, voxel), option
    )
    return finish(source, target, found.transformation, voxel)


def ransac(source, target, voxel):
    import open3d as o3d

    reg = o3d.pipelines.registration
    found = reg.registration_ransac_based_on_feature_matching(
        source,
        target,
        features(source, voxel),
        features(target, voxel),
        True,
        1.5 * voxel,
        reg.TransformationEstimationPointToPoint(False),
        3,
        [
            reg.CorrespondenceCheckerBasedOnEdgeLength(0.9),
            reg.CorrespondenceCheckerBasedOnDistance(1.5 * voxel),
        ],
        reg.RANSACConvergenceCriteria(100000, 0.999),
    )
    return finish(source, target, found.transformation, voxel)


def pca(source, target, voxel):
    from scipy.spatial import cKDTree

    s, t = np.asarray(source.points), np.asarray(target.points)
    tree = cKDTree(t)
    us = np.linalg.svd(s - s.mean(0), full_matrices=False)[2]
    ut = np.linalg.svd(t - t.mean(0), full_matrices=False)[2]
    best = (np.inf, np.eye(4))
    for flip in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        d = np.diag([flip[0], flip[1], 1.0])
        r = ut.T @ d @ us
        if np.linalg.det(r) < 0:
            r = ut.T @ np.diag([flip[0], flip[1], -1.0]) @ us
        start = np.eye(4)
        start[:3, :3], start[:3, 3] = r, t.mean(0) - r @ s.mean(0)
        pose = finish(source, target, finish(source, target, start, 3 * voxel), voxel)
        gaps = tree.query(s @ pose[:3, :3].T + pose[:3, 3])[0]
        score = np.sort(gaps)[: len(gaps) // 2].mean()  # trimmed: half may have no partner
        if score < best[0]:
            best = (score, pose)
    return best[1]


def kiss(source, target, voxel):
    import kiss_matcher

    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(voxel))
    found = matcher.estimate(np.asarray(source.points, np.float32), np.asarray(target.points, np.float32))
    start = np.eye(4)
    start[:3, :3], start[:3, 3] = np.asarray(found.rotation), np.asarray(found.translation).ravel()
    return finish(source, target, start, voxel)


METHODS = {"fgr": fgr, "ransac": ransac, "pca": pca, "kiss": kiss}


def error_deg(found, truth):
    gap = found[:3, :3] @ truth[:3, :3].T
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(gap - np.eye(3)) / np.sqrt(8), 0, 1)))


def race(files, method, voxel_share, clean):
    errors, seconds = [], []
    for file in files:
        with open(file) as stream:
            case = json.load(stream)
        voxel = voxel_share * case["diagonal"]
        truth = np.asarray(case["T_target_source"])
        clock = time.perf_counter()
        try:
            suffix = "_clean" if clean else ""
            normals = [case[k + "_normals"] if clean else None for k in ("source", "target")]
            source = cloud(case["source" + suffix], normals[0], voxel)
            target = cloud(case["target" + suffix], normals[1], voxel)
            errors.append(error_deg(METHODS[method](source, target, voxel), truth))
        except RuntimeError:
            errors.append(180.0)
        seconds.append(time.perf_counter() - clock)
    return np.asarray(errors), float(np.median(seconds))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--voxel", type=float, nargs="+", default=[0.02, 0.03, 0.04])
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=list(METHODS))
    options = parser.parse_args()
    files = sorted(glob.glob(os.path.join(options.folder, "*.json")))
    cases = sorted({os.path.basename(f).rsplit("_", 1)[0] for f in files})
    print("| case | method | clouds | voxel % | success | median deg | median s |\n|---|---|---|---|---|---|---|")
    for case in cases:
        mine = [f for f in files if os.path.basename(f).rsplit("_", 1)[0] == case]
        for method in options.methods:
            for clean in (False, True):
                runs = [(v, *race(mine, method, v, clean)) for v in options.voxel]
                voxel, errors, seconds = max(runs, key=lambda r: ((r[1] < 5).sum(), -np.median(r[1])))
                good = int((errors < 5).sum())
                kind = "de-noised" if clean else "raw"
                print(
                    f"| {case} | {method} | {kind} | {100 * voxel:g} | {good}/{len(errors)} "
                    f"| {np.median(errors):.2f} | {seconds:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
