#!/usr/bin/env bash
# What Linux on x86-64 can show of aarch64: the native library compiles there without warnings, by GCC and by clang
# (the compiler of macOS), and tests of the rasterizer pass under emulation. `make cross`, by hand and in CI.
# Debian 12: apt-get install g++-aarch64-linux-gnu clang qemu-user-static. What is absent is said and skipped.
set -euo pipefail
cd "$(dirname "$0")/.."
BIN=$(realpath "${BIN:-.venv/bin}")
OUT=$PWD/build/cross
TORCH=2.9.1 # the last whose wheel for aarch64 on PyPI needs no CUDA
# Images and gradients against the reference in float64: five minutes of a processor.
TESTS=${TESTS:-tests/raster/test_reference.py tests/raster/test_images_and_gradients.py}

there() { command -v "$1" > /dev/null || { echo "Skipped: no $1 on the PATH"; return 1; }; }

compile() { # NAME COMPILER [OPTION...]
    "$BIN/cmake" -S . -B "$OUT/$1" -G Ninja -DCMAKE_MAKE_PROGRAM="$BIN/ninja" -DCMAKE_CXX_COMPILER="$2" "${@:3}" \
        -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 -DPython_EXECUTABLE="$BIN/python" \
        -DTEXGS_CUDA=OFF -DTEXGS_IN_PLACE=OFF -DTEXGS_WERROR=ON > /dev/null
    "$BIN/cmake" --build "$OUT/$1"
    echo "Compiled for aarch64 without warnings by $("$2" --version | head -1)"
}

there aarch64-linux-gnu-g++ || exit 0 # brings the headers and libraries for clang, too
compile gcc aarch64-linux-gnu-g++
if there clang++; then
    compile clang clang++ -DCMAKE_CXX_COMPILER_TARGET=aarch64-linux-gnu
fi
there qemu-aarch64-static || exit 0
grep -qs bookworm /etc/os-release || { echo "Skipped: tests; they take the Python for aarch64 of Debian 12"; exit 0; }

if [ ! -e "$OUT/site/torch" ]; then
    # Debian's Python for aarch64, unpacked beside this system, and wheels of PyPI.
    mkdir -p "$OUT"/apt/{lists,cache/archives}/partial "$OUT/root"
    touch "$OUT/apt/status"
    options=(-qq -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o Dir::State::status="$OUT/apt/status"
        -o Dir::State::Lists="$OUT/apt/lists" -o Dir::Cache="$OUT/apt/cache")
    apt-get "${options[@]}" update
    apt-get "${options[@]}" install --yes --no-install-recommends --download-only python3.11 libstdc++6 libgomp1
    for package in "$OUT"/apt/cache/archives/*.deb; do dpkg -x "$package" "$OUT/root"; done
    platforms=(--platform manylinux2014_aarch64)
    for version in 17 26 27 28; do platforms+=(--platform "manylinux_2_${version}_aarch64"); done
    "$BIN/python" -m pip install --quiet --no-deps --only-binary :all: --python-version 3.11 "${platforms[@]}" \
        --target "$OUT/site" "torch==$TORCH" numpy pillow pyyaml kornia kornia_rs pytest pluggy iniconfig packaging pygments hypothesis \
        sortedcontainers filelock typing_extensions sympy mpmath networkx jinja2 markupsafe fsspec psutil
fi
rm -rf "$OUT/tree"
mkdir -p "$OUT/tree"
cp -r texgs tests benchmarks pyproject.toml "$OUT/tree"
rm -f "$OUT"/tree/texgs/raster/_native/*
cp "$OUT/gcc/libtexgs.so" "$OUT/tree/texgs/raster/_native"
cd "$OUT/tree"
echo "Testing under $(qemu-aarch64-static --version | head -1)"
# shellcheck disable=SC2086
QEMU_LD_PREFIX="$OUT/root" PYTHONPATH="$OUT/site" OMP_NUM_THREADS=1 \
    qemu-aarch64-static "$OUT/root/usr/bin/python3.11" -m pytest -p no:cacheprovider -m "not emulated and not subprocess" $TESTS
