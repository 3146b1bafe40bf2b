#!/bin/sh
# Makes the plots and the tables of docs/error-vs-time.md anew: error against run time of both solvers and of closed forms.
#
#   benches/curves.sh [BINARY]      BINARY: target/release/thirdbounce
#
# Scenes that the program simulates; with THIRDBOUNCE_DATA=FOLDER also two that another renderer path-traced
# (docs/data.md). Each scene is one `benchmark`, all methods in turns. Two CPU cores take some three minutes a scene, two of
# them for the paper's 300 iterations. What is between the marks of the page is replaced when all scenes are done.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
binary=${1:-$here/../target/release/thirdbounce}
page=$here/../docs/error-vs-time.md
plots=$here/../docs/error-vs-time
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# NAME TITLE CAPTURE TRUTH
curve() {
    table=$("$binary" benchmark "$3" --truth "$4" --out "$work/$1" --repeats 1 --trace-every 5 --quiet \
        --method paper:iterations=300,preset=synthetic,name=paper --method vector:name=default \
        --method vector:model=lambertian,no-preview,name=Lambertian --method dlct --method lct --method fk \
        --method phasor --method fbp)
    cp "$work/$1"/*/error_vs_time.png "$work/$1.png"
    {
        printf '\n### %s\n\n![%s](error-vs-time/%s.png)\n\n' "$2" "$2" "$1"
        echo "$table" | sed -n '/^|/p'
    } >> "$work/tables.md"
}

# NAME TITLE SCENE
simulated() {
    "$binary" simulate "$3" --scan 32 --model lambertian --noise 0.02 --quiet --out "$work/$1.npz" --truth "$work/$1-truth.npz"
    curve "$1" "$2, simulated, matt, 32 × 32" "$work/$1.npz" "$work/$1-truth.npz"
}

if [ -n "${THIRDBOUNCE_DATA:-}" ]; then
    data=$THIRDBOUNCE_DATA
    curve z_confocal_32 "Letter, path-traced by another renderer, 32 × 32" \
        "$data/z_confocal_32.npz" "$data/truth_z_confocal_32.npz"
    curve spheres "Two spheres, path-traced by another renderer, 32 × 32" \
        "$data/spheres_confocal_32.npz" "$data/truth_spheres_confocal_32.npz"
fi
simulated figure Figure figure
simulated letters-su "Two letters at two depths" letters-su
simulated torus Torus torus

cp "$work"/*.png "$plots"
awk -v tables="$work/tables.md" '
    /^<!-- curves -->$/ { print; while ((getline line < tables) > 0) print line; print ""; inside = 1 }
    /^<!-- end of curves -->$/ { inside = 0 }
    !inside' "$page" > "$work/page.md"
cp "$work/page.md" "$page"
