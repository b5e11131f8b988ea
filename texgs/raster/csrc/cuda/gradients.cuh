// SPDX-License-Identifier: Apache-2.0
// The gradient of a pixel, as its fragments need it.
#pragma once
#include "fragment.cuh"

namespace texgs::cuda {
namespace {

template <int C, bool Depth>
struct PixelGradient {
    float channels[C] = {};
    float constant = 0.0f;   // part of q = dL/dw common to all fragments
    float remaining = 0.0f;  // sum of w_j q_j over the fragments not yet visited
    struct {
        float depth = 0.0f, median = 0.0f;
        float m = 0.0f, m2 = 0.0f, origin = 1.0f;  // q += m m' + m2 m'^2, m' = 0 at the depth origin
        int32_t median_surfel = -1;
    } z;

    template <bool Geometry>
    __device__ void load(const Raster& r, int64_t at) {
        load_channels<Geometry>(r, at);
        if constexpr (Geometry) {
            if (r.grad.alpha) {
                const float grad = r.grad.alpha[at];
                constant += grad;
                remaining = fma(grad, r.image.alpha[at], remaining);
            }
            if constexpr (Depth) load_depth(r, at);
        }
    }

    // Adds to q what depends on a fragment's depth; returns dL/d(depth).
    __device__ float weigh_depth(const texgs_options& o, float depth, float w, int32_t surfel, float& q) const {
        const NormalizedDepth normalized(o, depth, z.origin);
        const float m = normalized.m;
        q = fma(z.depth, depth, q);
        q = fma(m, fma(z.m2, m, z.m), q);
        const float by_m = fma(2.0f * z.m2, m, z.m);
        return fma(w, fma(by_m, normalized.slope, z.depth), surfel == z.median_surfel ? z.median : 0.0f);
    }

private:
    template <bool Geometry>
    __device__ void load_channels(const Raster& r, int64_t at) {
        const int own = r.surfels.channels;
#pragma unroll
        for (int c = 0; c < C; ++c) {
            const bool is_color = c < own, is_normal = Geometry && !is_color && c < own + 3 && r.grad.normal;
            const float* grad = is_color ? r.grad.color : is_normal ? r.grad.normal : nullptr;
            if (!grad) continue;
            const int64_t place = (is_color ? c : c - own) * r.plane + at;
            channels[c] = grad[place];
            if constexpr (Geometry) {
                const float background = is_color && r.options.background ? r.options.background[c] : 0.0f;
                const float value = (is_color ? r.image.color : r.image.normal)[place];
                remaining = fma(channels[c], value - background, remaining);
                constant = fma(-channels[c], background, constant);
            }
        }
    }

    __device__ void load_depth(const Raster& r, int64_t at) {
        const float alpha = r.image.alpha[at];
        if (r.grad.depth && alpha > 0.0f) {  // sum(w z) / alpha: one gradient by the sum, one by alpha
            z.depth = r.grad.depth[at] / alpha;
            constant = fma(-z.depth, r.image.depth[at], constant);
        }
        if (r.grad.median) z.median = r.grad.median[at], z.median_surfel = r.median_surfel[at];
        if (r.grad.distortion) {  // alpha M2 - M1^2 with M1 = sum w m', M2 = sum w m'^2
            const float* moments = r.distortion_moments + at;
            const float grad = r.grad.distortion[at], m1 = moments[0], m2 = moments[r.plane];
            z.m = -2.0f * grad * m1, z.m2 = grad * alpha, z.origin = moments[2 * r.plane];
            constant = fma(grad, m2, constant);
            remaining = fma(2.0f * grad, fma(-m1, m1, alpha * m2), remaining);
        }
    }
};

}  // namespace
}  // namespace texgs::cuda
