"""Race of graph matchers on the same random scaffold-like graphs and the same affinities.

    cargo run --release -p matchers --example write_graphs -- 20 15 > graphs20.json
    python -m venv venv && venv/bin/pip install pygmtools numpy scipy
    venv/bin/python compare/graph_matching.py graphs20.json [more.json ...] [--sweep]

Prints, for every file: accuracy on the surviving nodes, mean gain (the common objective) and median milliseconds of
RRWM, IPFP and SM (pygmtools, numpy backend, Hungarian discretisation) and of this project's matcher, whose answers and
times the example wrote into the file. --sweep also tries RRWM's alpha and beta, so that the peer is tuned.
"""

import json
import os
import sys
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
import pygmtools as pygm

pygm.set_backend("numpy")


def lawler(case):
    """Lawler's affinity matrix in pygmtools' order: row (i * n1 + a) for target a and source i."""
    n = case["nodes"]
    node = np.array(case["node_affinity"]).reshape(n, n)
    te, se = np.array(case["target_edges"]), np.array(case["source_edges"])
    edge = np.array(case["edge_affinity"]).reshape(len(te), len(se))
    k = np.zeros((n * n, n * n))
    for target, source in ((te, se), (te[:, ::-1], se), (te, se[:, ::-1]), (te[:, ::-1], se[:, ::-1])):
        rows = source[None, :, 0] * n + target[:, None, 0]
        cols = source[None, :, 1] * n + target[:, None, 1]
        k[rows, cols] = edge
    np.fill_diagonal(k, node.T.reshape(-1))
    return k


def score(case, match):
    truth = case["truth"]
    pairs = [(a, t) for a, t in enumerate(truth) if t is not None]
    return sum(match[a] == t for a, t in pairs) / len(pairs)


def gain(case, k, match):
    """The example's objective: node affinities plus edge affinities, every pair of edges counted once."""
    n = case["nodes"]
    z = np.zeros(n * n)
    for a, i in enumerate(match):
        if i is not None:
            z[i * n + a] = 1.0
    diagonal = np.diag(k)
    return float(0.5 * (z @ k @ z + diagonal @ z))


def run(cases, matrices, solver):
    accuracy, gains, times = [], [], []
    for case, k in zip(cases, matrices):
        n = case["nodes"]
        start = time.perf_counter()
        soft = solver(k, n)
        hard = pygm.hungarian(soft)
        times.append((time.perf_counter() - start) * 1e3)
        match = [int(np.argmax(row)) if row.max() > 0 else None for row in hard]
        accuracy.append(score(case, match))
        gains.append(gain(case, k, match))
    return np.mean(accuracy), np.mean(gains), np.median(times)


def line(name, result):
    print(f"{name:34s} accuracy {result[0]:.4f}   gain {result[1]:8.3f}   {result[2]:8.2f} ms", flush=True)


def main():
    sweep = "--sweep" in sys.argv
    for path in [a for a in sys.argv[1:] if not a.startswith("--")]:
        with open(path) as file:
            cases = json.load(file)
        matrices = [lawler(case) for case in cases]
        print(f"== {path}: {len(cases)} graphs of {cases[0]['nodes']} nodes")
        ours = [case["ours"] for case in cases]
        line("ours, most probable", (
            np.mean([score(c, o["most_probable"]) for c, o in zip(cases, ours)]),
            np.mean([gain(c, k, o["most_probable"]) for c, k, o in zip(cases, matrices, ours)]),
            np.median([o["ms"] for o in ours]),
        ))
        matches = [o["source_of_target"] for o in ours]
        line("ours, greatest gain", (
            np.mean([score(c, m) for c, m in zip(cases, matches)]),
            np.mean([gain(c, k, m) for c, k, m in zip(cases, matrices, matches)]),
            np.median([o["ms"] for o in ours]),
        ))
        for case, o, k in zip(cases, ours, matrices):
            assert abs(gain(case, k, o["source_of_target"]) - o["gain"]) < 1e-6 * o["gain"]
        line("RRWM (defaults)", run(cases, matrices, lambda k, n: pygm.rrwm(k, n, n)))
        line("IPFP", run(cases, matrices, lambda k, n: pygm.ipfp(k, n, n)))
        line("SM", run(cases, matrices, lambda k, n: pygm.sm(k, n, n)))
        line("Hungarian, nodes alone", run(
            cases, matrices, lambda k, n: np.diag(k).reshape(n, n).T.copy()))
        if sweep:
            for alpha in (0.05, 0.2, 0.5):
                for beta in (10, 30, 100, 300):
                    name = f"RRWM alpha {alpha} beta {beta} 100 it"
                    line(name, run(cases, matrices,
                                   lambda k, n: pygm.rrwm(k, n, n, alpha=alpha, beta=beta, max_iter=100)))


if __name__ == "__main__":
    main()
