"""Drives the race: clouds are made once, runs of all contestants alternate, medians and ratios are printed.

Called by compare/delaunay.sh with the folder of our programs, a working folder and the number of repeats.
"""

import subprocess
import sys
import time
from pathlib import Path
from statistics import median

CLOUDS = [("cube", 100_000), ("ellipsoid", 100_000), ("bone", 100_000), ("sphere", 100_000), ("grid", 100_000),
          ("cube", 1_000_000), ("ellipsoid", 1_000_000), ("bone", 1_000_000)]
# Qhull takes minutes or gives up on these.
NOT_FOR_QHULL = {"sphere", "grid"}


def run(command):
    return [float(word) for word in subprocess.check_output([str(c) for c in command], text=True).split()]


def qhull(points):
    """Seconds of scipy.spatial.Delaunay, or None without scipy."""
    try:
        import numpy
        from scipy.spatial import Delaunay
    except ImportError:
        return None
    cloud = numpy.fromfile(points).reshape(-1, 3)
    start = time.perf_counter(), time.process_time()
    cells = len(Delaunay(cloud).simplices)
    return [time.perf_counter() - start[0], time.process_time() - start[1], cells]


def main():
    programs, work, repeats = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    print("cloud points | ours | CGAL | ratio | ours x2 | CGAL x2 | speed-up | full scaffold / ours | bytes a point, peak | Qhull")
    for kind, n in CLOUDS:
        file = work / f"{kind}.{n}"
        if not file.exists():
            subprocess.check_call([programs / "delaunay-clouds", kind, str(n), file])
        times = {"ours": [], "cgal": [], "ours2": [], "cgal2": [], "full": []}
        race = programs / "delaunay-race"
        for _ in range(repeats):
            times["ours"].append(run([race, file, 1, 1]))
            times["cgal"].append(run([work / "cgal", file, 0, 1]))
            times["ours2"].append(run([race, file, 2, 1]))
            times["cgal2"].append(run([work / "cgal", file, 2, 1]))
            times["full"].append(run([race, file, 1, 1, "full"]))
        wall = {k: median(t[0] for t in v) for k, v in times.items()}
        cpu = {k: median(t[1] for t in v) for k, v in times.items()}
        cells = {int(v[0][2]) for k, v in times.items() if k != "full"}
        after, peak = times["ours"][0][3:5]
        other = qhull(file) if n <= 100_000 and kind not in NOT_FOR_QHULL else None
        text = {k: f"{wall[k]:.2f} ({cpu[k]:.2f})" for k in wall}
        print(
            f"{kind} {n} | {text['ours']} | {text['cgal']} | {wall['ours'] / wall['cgal']:.2f} ({cpu['ours'] / cpu['cgal']:.2f})"
            f" | {text['ours2']} | {text['cgal2']} | {wall['ours'] / wall['ours2']:.2f}"
            f" | {wall['full'] / wall['ours']:.2f} ({cpu['full'] / cpu['ours']:.2f}) | {after:.0f}, {peak:.0f}"
            f" | {f'{other[0]:.2f} ({other[1]:.2f})' if other else '-'}",
            flush=True,
        )
        if len(cells) != 1:
            print(f"  numbers of finite tetrahedra differ: {sorted(cells)}")


if __name__ == "__main__":
    main()
