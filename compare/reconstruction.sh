#!/usr/bin/env bash
# Races the reconstruction of raw clouds against CGAL's advancing front and Open3D's Poisson and ball pivoting, each on the
# raw cloud and on the one this project de-noised.
# usage: compare/reconstruction.sh [N [NOISE,NOISE... [SEEDS]]]          needs g++, libcgal-dev
# Open3D: python -m venv venv && venv/bin/pip install open3d-cpu==0.19.0 (with its dependencies: it imports them all),
# then PYTHON=venv/bin/python compare/reconstruction.sh. Prints one line a noise level, method and input.
set -eu
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
work=$target/reconstruction-race
rm -rf "$work/clouds"
mkdir -p "$work"
[ -x "$work/cgal" ] && [ "$work/cgal" -nt compare/reconstruction/cgal.cpp ] ||
    g++ -O2 -DNDEBUG -std=c++17 compare/reconstruction/cgal.cpp -o "$work/cgal" -lgmp -lmpfr
cargo build --release --quiet --example reconstruction_race
race=$target/release/examples/reconstruction_race
"$race" dump "$work/clouds" "$@"
"${PYTHON:-python3}" compare/reconstruction/peers.py "$work/clouds" "$work/cgal"
"$race" judge "$work/clouds"
