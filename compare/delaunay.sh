#!/usr/bin/env bash
# Races the Delaunay triangulation against CGAL and, when scipy is there, Qhull, on the same files in one run.
# usage: compare/delaunay.sh [REPEATS]          needs g++, libcgal-dev, libtbb-dev
# Prints a table of medians of wall-clock seconds (processor seconds in brackets) and ratios; a busy machine spoils the
# first and hardly the second.
set -eu
cd "$(dirname "$0")"
repeats=${1:-5}
work=${CARGO_TARGET_DIR:-target}/delaunay-race
mkdir -p "$work"
[ -x "$work/cgal" ] && [ "$work/cgal" -nt delaunay/cgal.cpp ] ||
    g++ -O3 -DNDEBUG -DCGAL_LINKED_WITH_TBB -std=c++17 delaunay/cgal.cpp -o "$work/cgal" -ltbb -ltbbmalloc -lgmp -lmpfr
cargo build --release --quiet
exec python3 delaunay/race.py "${CARGO_TARGET_DIR:-target}/release" "$work" "$repeats"
