// SPDX-License-Identifier: Apache-2.0
// Does a footprint reach a block? Exact tests of its ellipse and its disc against a rectangle of pixel centres.
#pragma once
#include "maths.cuh"
#include "raster.cuh"

namespace texgs::cuda {
namespace {

constexpr float kBlockSpan = 3.0f;  // between the outer pixel centres of a block of 4x4 pixels

class BlockTest {
public:
    __device__ explicit BlockTest(const Footprint& f)
        : f_(f), slope_x_(f.xx > 0 ? -f.xy / f.xx : 0), slope_y_(f.yy > 0 ? -f.xy / f.yy : 0) {}

    // Block 0 to 15 of the tile whose first pixel is (left, top).
    __device__ bool reaches(int block, float left, float top) const {
        const float x = left + 4.0f * (block & 3) + 0.5f, y = top + 4.0f * (block >> 2) + 0.5f;
        return ellipse(x - f_.ex, y - f_.ey) || disc(x, y);
    }

private:
    // The smallest value of the ellipse's form over a rectangle is on the edges that face its centre: on each, the
    // unconstrained minimum along the edge, clamped to it.
    __device__ bool ellipse(float x0, float y0) const {
        const float x1 = x0 + kBlockSpan, y1 = y0 + kBlockSpan;
        const float near_x = clamp(0.0f, x0, x1), near_y = clamp(0.0f, y0, y1);
        const float on_x = clamp(slope_y_ * near_x, y0, y1), on_y = clamp(slope_x_ * near_y, x0, x1);
        return fminf(value(near_x, on_x), value(on_y, near_y)) <= 1.0f;
    }
    __device__ float value(float x, float y) const { return fma(x, fma(f_.xx, x, 2.0f * f_.xy * y), f_.yy * y * y); }
    __device__ bool disc(float x, float y) const {
        const float dx = clamp(f_.cx, x, x + kBlockSpan) - f_.cx, dy = clamp(f_.cy, y, y + kBlockSpan) - f_.cy;
        return fma(dx, dx, dy * dy) <= f_.disc;
    }

    const Footprint& f_;
    float slope_x_, slope_y_;
};

// All blocks of tile (x, y) that a footprint reaches.
__device__ inline uint32_t tile_mask(const Footprint& f, int x, int y) {
    if (x < f.x0 || x >= f.x1 || y < f.y0 || y >= f.y1) return 0;
    const BlockTest test(f);
    uint32_t mask = 0;
    for (int block = 0; block < 16; ++block)
        mask |= static_cast<uint32_t>(test.reaches(block, static_cast<float>(x * kTile), static_cast<float>(y * kTile)))
                << block;
    return mask;
}

// The first place in sorted values at which there is no less than `value`.
template <class T>
__device__ inline int64_t lower_bound(const T* sorted, int64_t n, T value) {
    int64_t first = 0;
    while (n > 0) {
        const int64_t half = n / 2;
        if (sorted[first + half] < value)
            first += half + 1, n -= half + 1;
        else
            n = half;
    }
    return first;
}

}  // namespace
}  // namespace texgs::cuda
