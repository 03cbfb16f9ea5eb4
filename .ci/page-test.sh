#!/usr/bin/env bash
# Opens reports in headless Chromium and checks them (tests/page/page_test.mjs).
#
# .ci/page-test.sh [--made-by MEDIAL] [REPORT.html...]        PICTURES=folder keeps screenshots
#
# With --made-by the program makes small shapes first and the pages of scaffold, match and change (two dates, and segmentations of
# one date) are opened as well.
# Needs node and npm. Chromium is installed with apt-get when it is missing and that is possible; playwright-core goes into a
# temporary folder, which PAGE_TEST_TOOLS replaces by one that is kept between runs.
set -euo pipefail
here=$(cd "$(dirname "$0")/.." && pwd)
usage() { echo "usage: $0 [--made-by MEDIAL] [REPORT.html...]" >&2; exit 2; }
[ $# -gt 0 ] || usage
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

reports=()
if [ "$1" = --made-by ]; then
  [ $# -gt 1 ] || usage
  medial=$2
  shift 2
  "$medial" synth growth -q -o "$work/growth"
  lesion=$work/growth/lesion_002_new_lobe
  # A bone and itself turned would tell nothing of a lesion: the scaffold is of a tumour, the match of it at two dates.
  "$medial" scaffold "${lesion}_baseline.nii.gz" -q -o "$work/scaffold"
  # Exit 1 says that the pose is ambiguous, which a lesion may be.
  "$medial" match "${lesion}_baseline.ply" "${lesion}_followup.ply" -q -o "$work/match" || [ $? = 1 ]
  "$medial" change "${lesion}_baseline.nii.gz" "${lesion}_followup_thick.nii.gz" -q -o "$work/change"
  "$medial" change --segmentation "thin=${lesion}_followup.nii.gz" --segmentation "thick=${lesion}_followup_thick.nii.gz" \
    --segmentation "mesh=${lesion}_followup.ply" --truth mesh -q -o "$work/segmentations"
  for page in scaffold match change segmentations; do
    [ -n "$(ls "$work/$page/tables" 2>/dev/null)" ] || { echo "$page wrote no tables" >&2; exit 1; }
    cp "$work/$page/report.html" "$work/$page.html"
    reports+=("$work/$page.html")
  done
fi
reports+=("$@")

if [ -z "${CHROMIUM:-}" ] && ! command -v chromium chromium-browser google-chrome >/dev/null 2>&1; then
  echo "installing chromium" >&2
  apt-get update -qq >&2
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core >&2
fi

tools=${PAGE_TEST_TOOLS:-$work/tools}
mkdir -p "$tools"
if [ ! -d "$tools/node_modules/playwright-core" ]; then
  # The browser is the system's: nothing else is downloaded.
  (cd "$tools" && PLAYWRIGHT_SKIP_BROWSER_DOWNLOAD=1 npm install --silent --no-audit --no-fund --no-save playwright-core@1.65.1 >&2)
fi
cp "$here/tests/page/page_test.mjs" "$tools/page_test.mjs"
status=0
for report in "${reports[@]}"; do
  timeout 600 node "$tools/page_test.mjs" "$report" ${PICTURES:+"$PICTURES"} || status=$?
done
exit $status
