// SPDX-License-Identifier: Apache-2.0
// Bilinear lookup in the texture of one surfel.
#pragma once
#include "maths.cuh"
#include "raster.cuh"

namespace texgs::cuda {
namespace {

// One that reaches beyond the atlas, which the host cannot see without waiting, is NaN all over instead.
struct TextureTable {
    const float* texels;  // [rows, columns, 3]
    int columns, rows;
    float gain;

    TextureTable() = default;
    __device__ TextureTable(const texgs_surfels& s, int64_t surfel)
        : columns(s.sizes[2 * surfel]), rows(s.sizes[2 * surfel + 1]), gain(s.gain[surfel]) {
        int64_t first = s.offsets[surfel];
        if (columns < 1 || rows < 1 || first < 0 || first > s.n_texels - count())
            first = 0, columns = rows = 1, gain = __uint_as_float(0x7fc00000u);
        texels = s.texels + 3 * first;
    }
    __device__ int64_t count() const { return int64_t(columns) * rows; }
};

// Where a fragment falls in a texture: among the texels of the cell (i, j) to (i + 1, j + 1), as far as there are any.
struct TexelCoordinates {
    float x, y;  // in [0, columns - 1], [0, rows - 1]
    int i, j;
    float fx, fy;         // place in the cell
    bool free_x, free_y;  // not clamped at the border: coordinates still move with u and v

    __device__ TexelCoordinates(const TextureTable& t, float u, float v) {
        place(t.columns, u, x, i, fx, free_x);
        place(t.rows, v, y, j, fy, free_y);
    }

private:
    // The texture spans 6 standard deviations.
    __device__ static void place(int size, float u, float& x, int& i, float& f, bool& free) {
        const float last = size - 1.0f, raw = fma(u, size * (1.0f / 6.0f), 0.5f * last);
        x = clamp(raw, 0.0f, last);
        free = raw > 0.0f && raw < last;
        i = static_cast<int>(fminf(floorf(x), fmaxf(last - 1.0f, 0.0f)));
        f = x - i;
    }
};

__device__ inline float mix(float a, float b, float f) { return fma(f, b - a, a); }

// The four texels of a cell, one channel each.
struct Taps {
    float t00, t10, t01, t11;

    __device__ Taps(const TextureTable& t, const TexelCoordinates& at, int channel) {
        const float* p = t.texels + 3 * (int64_t(at.j) * t.columns + at.i) + channel;
        const int right = t.columns > 1 ? 3 : 0, down = t.rows > 1 ? 3 * t.columns : 0;
        t00 = __ldg(p), t10 = __ldg(p + right), t01 = __ldg(p + down), t11 = __ldg(p + down + right);
    }
    __device__ float value(const TexelCoordinates& at) const {
        return mix(mix(t00, t10, at.fx), mix(t01, t11, at.fx), at.fy);
    }
    __device__ float by_x(const TexelCoordinates& at) const { return mix(t10 - t00, t11 - t01, at.fy); }
    __device__ float by_y(const TexelCoordinates& at) const { return mix(t01 - t00, t11 - t10, at.fx); }
};

}  // namespace
}  // namespace texgs::cuda
