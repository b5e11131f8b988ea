// SPDX-License-Identifier: Apache-2.0
// What all passes over tiles share: where a thread's pixels are, and a surfel's fragment in one of them.
//
// Every product that an addition follows is a written fma or __fmul_rn: the compiler has no choice to make, and a
// fragment is the same number in every kernel. The backward pass relies on it.
#pragma once
#include "maths.cuh"
#include "raster.cuh"
#include "warp.cuh"

namespace texgs::cuda {
namespace {

// The pixels of a thread: (x, y) and the one four rows below.
struct Place {
    int column, row;           // of the first pixel
    uint32_t blocks[kPixels];  // the two blocks that the warp's first or second pixels lie in, as bits of a mask

    __device__ Place(const Raster& r, int tile) {
        const int warp = threadIdx.x / kWarp, lane = lane_index();
        const int quadrant_x = warp & 1, quadrant_y = warp >> 1;
        column = tile % r.tiles_x * kTile + 8 * quadrant_x + (lane & 7);
        row = tile / r.tiles_x * kTile + 8 * quadrant_y + (lane >> 3);
        for (int p = 0; p < kPixels; ++p) blocks[p] = 3u << (4 * (2 * quadrant_y + p) + 2 * quadrant_x);
    }
    __device__ uint32_t quadrant() const { return blocks[0] | blocks[1]; }
    __device__ float x() const { return column + 0.5f; }
    __device__ float y(int p) const { return row + 4 * p + 0.5f; }
    __device__ bool inside(const Raster& r, int p) const {
        return column < r.camera.width && row + 4 * p < r.camera.height;
    }
    __device__ int64_t pixel(const Raster& r, int p) const { return int64_t(row + 4 * p) * r.camera.width + column; }
};

// 1 / a to two units in the last place, one instruction instead of eight; fragments have no use for the exact quotient.
__device__ inline float reciprocal(float a) { return __fdividef(1.0f, a); }

struct Fragment {
    float alpha;                 // 0 where below alpha_min
    float dx, dy, u, v, r, rho;  // r = 1 / W
    bool filtered;               // the low-pass filter rules
};

// Opacity that falls with rho: 0 where below alpha_min.
__device__ inline float alpha_of(const Record& s, float rho, const texgs_options& o) {
    const float alpha = fminf(exp2f(fma(rho, -0.5f * kLog2E, s.log2_opacity)), kLargestAlpha);
    return alpha >= o.alpha_min ? alpha : 0.0f;
}

template <class P>
__device__ Fragment evaluate(const Record& s, float x, float y, const texgs_options& o) {
    Fragment f;
    f.dx = x - s.cx, f.dy = y - s.cy;
    if constexpr (P::kAffine) {
        f.r = 1.0f, f.filtered = false;
        f.u = fma(s.ux, f.dx, __fmul_rn(s.uy, f.dy)), f.v = __fmul_rn(s.vy, f.dy);
        f.rho = fma(f.u, f.u, __fmul_rn(f.v, f.v));
        f.alpha = alpha_of(s, f.rho, o);
        return f;
    }
    const float W = fma(s.wx, f.dx, fma(s.wy, f.dy, 1.0f));
    f.r = reciprocal(W);
    f.u = __fmul_rn(fma(s.ux, f.dx, fma(s.uy, f.dy, s.u)), f.r);
    f.v = __fmul_rn(fma(s.vx, f.dx, fma(s.vy, f.dy, s.v)), f.r);
    float rho_surfel = fma(f.u, f.u, __fmul_rn(f.v, f.v));
    if (s.clip != 0.0f && !(W > 0.0f && __fmul_rn(W, o.near_plane) < s.zc)) rho_surfel = 1e30f;
    f.rho = fminf(rho_surfel, __fmul_rn(o.low_pass, fma(f.dx, f.dx, __fmul_rn(f.dy, f.dy))));
    f.filtered = !(rho_surfel <= f.rho);
    f.alpha = alpha_of(s, f.rho, o);
    return f;
}

// Camera depth of a fragment: of the ray-splat intersection, or of the mean where the low-pass filter rules, and of
// Gaussians.
template <class P>
__device__ float depth_of(const Record& s, const Fragment& f) {
    if constexpr (P::kAffine) return s.zp;
    return f.filtered ? s.zp : __fmul_rn(s.zc, f.r);
}

// In a thread's pixel `p`: without alpha where it is outside of the pixel's depth range.
template <class P>
__device__ Fragment evaluate(const Raster& r, const Record& s, const Place& place, int p) {
    Fragment f = evaluate<P>(s, place.x(), place.y(p), r.options);
    if (r.camera.depth_range && f.alpha > 0.0f && place.inside(r, p)) {
        const float z = depth_of<P>(s, f), *range = r.camera.depth_range + place.pixel(r, p);
        if (!(range[0] <= z && z < range[r.plane])) f.alpha = 0.0f;
    }
    return f;
}

// Depth mapped to 0 at the near plane and 1 at the far plane, less that of a depth `origin`, and its derivative.
struct NormalizedDepth {
    float m, slope;
    __device__ NormalizedDepth(const texgs_options& o, float z, float origin) {
        const float inverse = reciprocal(z), scale = o.far_plane / (o.far_plane - o.near_plane);
        const float c = __fmul_rn(__fmul_rn(scale, o.near_plane), inverse);
        m = __fmul_rn(__fmul_rn(c, z - origin), reciprocal(origin)), slope = __fmul_rn(c, inverse);
    }
};

// Weight of a fragment; moves the transmittance past it. A pixel that has ended keeps multiplying: its transmittance
// only falls, so that `remaining >= transmittance_min` alone tells whether a fragment counts.
__device__ inline float blend(float alpha, float limit, float& transmittance) {
    const float before = transmittance;
    transmittance = fma(-alpha, before, before);
    return transmittance >= limit ? __fmul_rn(alpha, before) : 0.0f;
}

}  // namespace
}  // namespace texgs::cuda
