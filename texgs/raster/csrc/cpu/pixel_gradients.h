// SPDX-License-Identifier: Apache-2.0
// What the backward pass keeps for each pixel of a tile, and how it follows from the images and their gradients.
#pragma once
#include "fragment.h"

namespace texgs::TEXGS_ISA {
namespace {

// What the loops keep per pixel, in planes one after the other so that one pointer reaches all of them.
enum Plane {
    kTransmittance,
    kRemaining,  // sum of w_j q_j over the fragments not yet visited
    kConstant,   // part of q common to all fragments
    kGradient    // by channel, to the end
};
struct alignas(64) PixelPlanes {
    float data[(kGradient + kMaxChannels) * kTilePixels];

    TEXGS_INLINE float* operator[](int plane) { return data + plane * kTilePixels; }
};

// The same of the depths.
struct alignas(64) DepthGradients {
    float depth[kTilePixels], median[kTilePixels], median_stop[kTilePixels];
    float origin[kTilePixels], m[kTilePixels], m2[kTilePixels];  // q += m m' + m2 m'^2, m' = 0 at the depth origin
    float alpha[kTilePixels];                                    // blended so far
};

inline void load_channels(const Raster& r, int tile, PixelPlanes& p) {
    const int64_t plane = int64_t(r.camera.width) * r.camera.height;
    const int own = r.surfels.channels;
    std::memset(p[kGradient], 0, r.channels * sizeof(float) * kTilePixels);
    float value[kTilePixels] = {};
    for (int c = 0; c < r.channels; ++c) {
        const float* grad = c < own ? r.grad.color : r.grad.normal;
        if (!grad) continue;
        const int64_t offset = (c < own ? c : c - own) * plane;
        load_plane(r, tile, grad + offset, p[kGradient + c]);
        load_plane(r, tile, (c < own ? r.image.color : r.image.normal) + offset, value);
        const float background = c < own && r.options.background ? r.options.background[c] : 0.0f;
        for (int i = 0; i < kTilePixels; i += kLanes) {
            const vf gradient = load(p[kGradient + c] + i);
            store(p[kRemaining] + i, fma(gradient, load(value + i) - vf(background), load(p[kRemaining] + i)));
            store(p[kConstant] + i, fnma(gradient, background, load(p[kConstant] + i)));
        }
    }
}

// Expected depth is sum(w z) / alpha: its gradient splits into one by sum(w z), and one by alpha.
inline void load_expected_depth(const Raster& r, int tile, PixelPlanes& p, DepthGradients& d, const float* alpha) {
    float depth[kTilePixels] = {}, grad[kTilePixels] = {};
    load_plane(r, tile, r.image.depth, depth);
    load_plane(r, tile, r.grad.depth, grad);
    for (int i = 0; i < kTilePixels; i += kLanes) {
        const vf a = load(alpha + i);
        const vf by_sum = zero_unless(a > vf(0.0f), load(grad + i) / max(a, 1e-30f));
        store(d.depth + i, by_sum);
        store(p[kConstant] + i, fnma(by_sum, load(depth + i), load(p[kConstant] + i)));
    }
}

// The distortion is A M2 - M1^2 with A = sum w, M1 = sum w m', M2 = sum w m'^2.
inline void load_distortion(const Raster& r, int tile, PixelPlanes& p, DepthGradients& d, const float* alpha) {
    const float* moments = r.distortion_moments + int64_t(tile) * 3 * kTilePixels;
    float grad[kTilePixels] = {};
    load_plane(r, tile, r.grad.distortion, grad);
    for (int i = 0; i < kTilePixels; i += kLanes) {
        const vf gradient = load(grad + i), a = load(alpha + i), m1 = load(moments + i);
        const vf m2 = load(moments + kTilePixels + i);
        store(d.m + i, gradient * vf(-2.0f) * m1);
        store(d.m2 + i, gradient * a);
        store(d.origin + i, load(moments + 2 * kTilePixels + i));
        store(p[kConstant] + i, fma(gradient, m2, load(p[kConstant] + i)));
        store(p[kRemaining] + i, fma(vf(2.0f) * gradient, fnma(m1, m1, a * m2), load(p[kRemaining] + i)));
    }
}

inline void load_gradients(const Raster& r, int tile, PixelPlanes& p, DepthGradients* d) {
    std::memset(p[kRemaining], 0, sizeof(float) * kTilePixels);
    std::memset(p[kConstant], 0, sizeof(float) * kTilePixels);
    load_channels(r, tile, p);
    float alpha[kTilePixels] = {};
    if (r.grad.alpha || d) load_plane(r, tile, r.image.alpha, alpha);
    if (r.grad.alpha) {
        float grad[kTilePixels] = {};
        load_plane(r, tile, r.grad.alpha, grad);
        for (int i = 0; i < kTilePixels; i += kLanes) {
            store(p[kRemaining] + i, fma(load(grad + i), load(alpha + i), load(p[kRemaining] + i)));
            store(p[kConstant] + i, load(p[kConstant] + i) + load(grad + i));
        }
    }
    if (!d) return;
    std::memset(d, 0, sizeof *d);
    if (r.grad.depth) load_expected_depth(r, tile, p, *d, alpha);
    if (r.grad.distortion) load_distortion(r, tile, p, *d, alpha);
    if (r.grad.median) {
        load_plane(r, tile, r.grad.median, d->median);
        std::memcpy(d->median_stop, r.median_stop + int64_t(tile) * kTilePixels, sizeof d->median_stop);
    }
}

inline void prefetch_gradients(const Raster& r, int tile) {
    const int own = r.surfels.channels;
    prefetch_planes(r, tile, r.grad.color, own);
    if (r.grad.color) prefetch_planes(r, tile, r.image.color, own);
    prefetch_planes(r, tile, r.grad.normal, 3);
    if (r.grad.normal) prefetch_planes(r, tile, r.image.normal, 3);
    if (r.grad.alpha) prefetch_planes(r, tile, r.image.alpha, 1);
    prefetch_planes(r, tile, r.grad.alpha, 1);
    prefetch_planes(r, tile, r.grad.depth, 1);
    if (r.grad.depth) prefetch_planes(r, tile, r.image.depth, 1);
}

// dL/dz of fragments, from distortion, median and expected depth.
TEXGS_INLINE vf depth_gradient(const Raster& r, DepthGradients& d, int pixel, vf z, vf w) {
    vf by_w = load(d.depth + pixel);
    if (r.grad.distortion) {
        const vf m = centred_ndc(r, z, load(d.origin + pixel));
        const vf by_m = fma(vf(2.0f) * load(d.m2 + pixel), m, load(d.m + pixel));
        by_w = fma(by_m, vf(ndc_scale(r)) / (z * z), by_w);
    }
    vf gz = w * by_w;
    if (r.grad.median) {
        // replayed bit for bit, the median is the fragment that brings alpha to where the forward pass took it
        const vf before = load(d.alpha + pixel), after = before + w, stop = load(d.median_stop + pixel);
        store(d.alpha + pixel, after);
        gz = add_where((before < vf(0.5f)) & (after <= stop) & (after >= stop), gz, load(d.median + pixel));
    }
    return zero_unless(w > vf(0.0f), gz);
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
