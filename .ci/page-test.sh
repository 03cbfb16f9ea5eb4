#!/usr/bin/env bash
# Opens reports in headless Chromium and checks them (tests/page/page_test.mjs).
#
# .ci/page-test.sh REPORT.html...        PICTURES=folder keeps screenshots
#
# Needs node and npm. Chromium is installed with apt-get when it is missing and that is possible; playwright-core goes into a
# temporary folder, which PAGE_TEST_TOOLS replaces by one that is kept between runs.
set -euo pipefail
here=$(cd "$(dirname "$0")/.." && pwd)
[ $# -gt 0 ] || { echo "usage: $0 REPORT.html..." >&2; exit 2; }

if [ -z "${CHROMIUM:-}" ] && ! command -v chromium chromium-browser google-chrome >/dev/null 2>&1; then
  echo "installing chromium" >&2
  apt-get update -qq >&2
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core >&2
fi

tools=${PAGE_TEST_TOOLS:-}
if [ -z "$tools" ]; then
  tools=$(mktemp -d)
  trap 'rm -rf "$tools"' EXIT
fi
mkdir -p "$tools"
if [ ! -d "$tools/node_modules/playwright-core" ]; then
  # The browser is the system's: nothing else is downloaded.
  (cd "$tools" && PLAYWRIGHT_SKIP_BROWSER_DOWNLOAD=1 npm install --silent --no-audit --no-fund --no-save playwright-core@1.65.1 >&2)
fi
cp "$here/tests/page/page_test.mjs" "$tools/page_test.mjs"
status=0
for report in "$@"; do
  timeout 600 node "$tools/page_test.mjs" "$report" ${PICTURES:+"$PICTURES"} || status=$?
done
exit $status
