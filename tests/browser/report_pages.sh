#!/usr/bin/env bash
# Makes a page of each kind with PROGRAM and tests it in a browser: report_pages.sh PROGRAM SOURCES FOLDER
# Ends with 77, which CTest takes for "skipped", where the browser, Node or its libraries are missing. The libraries are
# installed into FOLDER by npm once, which needs a network; NODE_LIBRARIES names a folder that has them already.
set -euo pipefail
program="$1"
sources="$2"
folder="$3"

skip() {
    echo "skipped: $1"
    exit 77
}

browser=""
for name in chromium chromium-browser google-chrome chromium-headless-shell; do
    if browser="$(command -v "$name")"; then break; fi
done
[[ -n $browser ]] || skip "no Chromium; on Debian: apt-get install chromium"
command -v node >/dev/null || skip "no Node; on Debian: apt-get install nodejs npm"
mkdir -p "$folder"
libraries="${NODE_LIBRARIES:-$folder}"
if [[ ! -d $libraries/node_modules/puppeteer-core || ! -d $libraries/node_modules/axe-core ]]; then
    command -v npm >/dev/null || skip "no npm, which installs puppeteer-core and axe-core"
    cp "$sources/tests/browser/package.json" "$folder/"
    libraries="$folder"
    (cd "$folder" && timeout 180 npm install --ignore-scripts --no-audit --no-fund --loglevel=error) ||
        skip "npm could not install puppeteer-core and axe-core"
fi

pages="$folder/pages"
rm -rf "$pages"
mkdir -p "$pages"
cd "$pages"
ringlock() { "$program" "$@" >>log.txt 2>&1; }

# A study, and a name that a page must not take for markup.
cp "$sources/scenarios/gao-deng-2007.toml" 'study <img src=x onerror=alert(1)>.toml'
ringlock run 'study <img src=x onerror=alert(1)>.toml' --set ensemble.gyros=16 -o study.h5
ringlock report study.h5

# A lot with a specification, a sweep and a design.
cat >lot.toml <<'SCENARIO'
# Question: which cure lets most of a lot pass?
[ensemble]
gyros = 24
duration_s = 60.0
[arms]
names = ["ideal", "uncompensated", "noise_injected", "noise_injected+compensated"]
[specification]
arw_deg_rt_h = 0.0023
rate_error_deg_h = 0.2
SCENARIO
ringlock run lot.toml -o lot.h5
ringlock report lot.h5
ringlock run "$sources/scenarios/dead-band.toml" --set input.sweep_points=9 -o sweep.h5
ringlock report sweep.h5
cat >design.toml <<'SCENARIO'
[ensemble]
gyros = 4
duration_s = 100.0
[output]
angle_record = false
[arms]
names = ["noise_injected", "noise_injected+compensated"]
[design]
kind = "grid"
[[design.vary]]
key = "gyro.lockin_threshold_deg_h"
from = 150
to = 450
points = 5
SCENARIO
ringlock run design.toml -o design.h5
ringlock report design.h5

# A batch, and an Allan analysis of one of its records.
mkdir batch
ringlock run lot.toml design.toml -o batch
ringlock report batch
awk 'BEGIN { srand(3); for (i = 0; i < 4096; ++i) print rand() - 0.5 + (i == 1000 ? 40 : 0) }' >log.csv
"$program" allan log.csv --rate 100 --kind rate --unit deg/h --json >allan.json
ringlock report allan.json

# The closed loop of a short record.
cat >record.toml <<'SCENARIO'
[ensemble]
gyros = 1
duration_s = 30.0
[effects.bias_step]
step_deg_h = 40.0
time_s = 15.0
SCENARIO
if ringlock record record.toml -o record.h5 && ringlock closure record.h5 -o closed -q; then
    ringlock report closed
fi

node "$sources/tests/browser/report_pages.mjs" "$libraries" "$browser" "$pages"/*.report.html
