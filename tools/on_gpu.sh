#!/usr/bin/env bash
# What only a machine with a GPU can show, each step with its time in build/gpu/steps.txt: tests, benchmarks
# beside gsplat where that is installed, fits by three recipes, an edit of each kind, exports, a picture and a film.
# `make install CUDA=1` before. DEVICE=cpu tries the script without a GPU, QUICK=1 by short steps.
set -uo pipefail
cd "$(dirname "$0")/.."
BIN=$(realpath "${BIN:-.venv/bin}")
DEVICE=${DEVICE:-cuda}
OUT=${OUT:-build/gpu}
RECIPES=${QUICK:+demo}
RECIPES=${RECIPES:-quick,default,paper}
FIRST=${RECIPES%%,*}
failed=0
SCENE=$OUT/results/orbital/scene/$FIRST/compose/scene.yaml
mkdir -p "$OUT/exports"

step() { # NAME COMMAND...: its output in a file; a failure does not stop the others
    local start=$SECONDS result=passed
    "${@:2}" > "$OUT/$1.log" 2>&1 || { result=FAILED; failed=1; tail -n 5 "$OUT/$1.log"; }
    printf '%-20s %s %5d s\n' "$1" "$result" $((SECONDS - start)) | tee -a "$OUT/steps.txt"
}

step doctor "$BIN/texgs" doctor
if [ "$DEVICE" = cuda ]; then export TEXGS_REQUIRE_CUDA=1; fi
step tests make test VENV="$(dirname "$BIN")" ${QUICK:+ARGS=tests/raster/test_reference.py}
step benchmarks "$BIN/python" -m benchmarks --device "$DEVICE" ${QUICK:+--quick} --json "$OUT/benchmarks.json"
run=("$BIN/texgs" run dataset=orbital device="$DEVICE" "results=$OUT/results")
step fits "${run[@]}" "fits=[$RECIPES]"
# By a picture, by words, of a segment, without texture; then the methods of others, on Gaussians.
for pair in {glass,text_quick,crimson,painted_untextured}/"$FIRST" {stylesplat,igs2gs,dge}_quick/gaussians_quick; do
    step "edit-${pair%/*}" "${run[@]}" "fits=[${pair#*/}]" "edits=[${pair%/*}]"
done
for kind in 3dgs 2dgs points mesh textured html gltf spz vtp; do
    step "export-$kind" "$BIN/texgs" export "$SCENE" --kind "$kind" --to "$OUT/exports/$kind" --device "$DEVICE"
done
step picture "$BIN/texgs" render "$SCENE" shadows=0.7 occlusion=0.5 --output "$OUT/picture.png" --device "$DEVICE"
step film "$BIN/texgs" render "$SCENE" --path orbit --output "$OUT/film.mp4" --device "$DEVICE"
exit "$failed"
