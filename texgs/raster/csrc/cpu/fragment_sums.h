// SPDX-License-Identifier: Apache-2.0
// How the fragments of a surfel or a Gaussian add up to its moments (surfel.h, gaussian.h) in the backward pass.
#pragma once
#include "pixel_gradients.h"
#include "replay.h"
#include "texture.h"

namespace texgs::TEXGS_ISA {
namespace {

struct alignas(64) BackwardScratch {
    Chunk chunk;
    TextureTables textures;
    Group group;
    PixelPlanes p;
    DepthGradients d;
    // Per vector of pixels of an entry: alpha, later e = alpha dL/dalpha; the derivatives of log(alpha) by U, V, W.
    float alpha[kVectors][kLanes], by_U[kVectors][kLanes], by_V[kVectors][kLanes], by_W[kVectors][kLanes];
    float filtered[kVectors][kLanes];  // 1 where the low-pass filter rules, else 0; only of kFiltered surfels
    float q[kVectors][kLanes], weight[kVectors][kLanes];
    float inverse_w[kVectors][kLanes], z[kVectors][kLanes];          // with depths or a texture
    float u[kVectors][kLanes], v[kVectors][kLanes];                  // with a texture, and of Gaussians
    float texture_u[kVectors][kLanes], texture_v[kVectors][kLanes];  // dL/du, dL/dv per weight through the texture
};

template <class P, bool Depth, bool Textured>
TEXGS_INLINE void evaluate_entries(BackwardScratch& s, const TilePixels& pixels, const Limits& limits) {
    for (int i = 0; i < s.group.entries * kParts; ++i) {
        const int place = s.group.surfel[i / kParts];
        const Record& record = s.chunk.records[place];
        const unsigned flags = s.chunk.flags[place];
        const Fragments f = evaluate<P>(record, flags, pixels.of(s.group.block[i / kParts], i % kParts), limits);
        store(s.alpha[i], f.log2_alpha);
        if constexpr (Depth) store(s.z[i], depth_of<P>(record, f));
        if constexpr (Textured || P::kAffine) store(s.u[i], f.u), store(s.v[i], f.v);
        if constexpr (P::kAffine) continue;
        const vf minus_inverse = -f.inverse_w;
        vf by_U = f.u * minus_inverse, by_V = f.v * minus_inverse, by_W = f.rho * f.inverse_w;
        if (flags & kFiltered) {
            const vm by_surfel = f.rho_surfel <= f.rho;
            by_U = zero_unless(by_surfel, by_U);
            by_V = zero_unless(by_surfel, by_V);
            by_W = zero_unless(by_surfel, by_W);
            store(s.filtered[i], zero_unless(~by_surfel, 1.0f));
        }
        store(s.by_U[i], by_U), store(s.by_V[i], by_V), store(s.by_W[i], by_W);
        if constexpr (Depth || Textured) store(s.inverse_w[i], f.inverse_w);
    }
    take_alphas(s.alpha, s.group.entries * kParts, limits);
}

// Sums over the fragments of one P. add() takes those of one vector of pixels, (dx, dy) from the centre, of weights w;
// put() lays the sums out as a slot begins.
template <class P>
struct FragmentSums;

template <>
struct FragmentSums<Surfel<vf>> {
    vf u_dx = 0.0f, u_dy = 0.0f, u = 0.0f, v_dx = 0.0f, v_dy = 0.0f, v = 0.0f, w_dx = 0.0f, w_dy = 0.0f;
    vf disc_dx = 0.0f, disc_dy = 0.0f, e = 0.0f, zc = 0.0f, zp = 0.0f;

    template <bool Depth, bool Textured>
    TEXGS_INLINE void add(const Raster& r, BackwardScratch& s, unsigned flags, int i, int pixel, vf dx, vf dy, vf w) {
        const vf by_e = load(s.alpha[i]);
        e += by_e;
        const vm live = abs(by_e) > vf(0.0f);  // elsewhere U / W may not be finite
        vf gU = zero_unless(live, by_e * load(s.by_U[i]));
        vf gV = zero_unless(live, by_e * load(s.by_V[i]));
        vf gW = zero_unless(live, by_e * load(s.by_W[i]));
        if (flags & kFiltered) {
            const vf filtered = by_e * load(s.filtered[i]);
            disc_dx = fma(filtered, dx, disc_dx);
            disc_dy = fma(filtered, dy, disc_dy);
        }
        if constexpr (Depth) {
            const vf z = load(s.z[i]);
            vf gz = depth_gradient(r, s.d, pixel, z, w);
            if (flags & kFiltered) {
                const vf of_mean = gz * load(s.filtered[i]);
                zp += of_mean;
                gz = gz - of_mean;
            }
            const vf by_zc = zero_unless(w > vf(0.0f), gz * load(s.inverse_w[i]));
            gW = gW - zero_unless(w > vf(0.0f), by_zc * z);
            zc += by_zc;
        }
        if constexpr (Textured) {  // where a coordinate is clamped its gradient is 0, and u or v may not be finite
            const vf gu = load(s.texture_u[i]), gv = load(s.texture_v[i]), scaled = w * load(s.inverse_w[i]);
            const vm by_u = abs(gu * w) > vf(0.0f), by_v = abs(gv * w) > vf(0.0f);
            gU = add_where(by_u, gU, scaled * gu);
            gV = add_where(by_v, gV, scaled * gv);
            gW = gW - zero_unless(by_u, scaled * gu * load(s.u[i])) - zero_unless(by_v, scaled * gv * load(s.v[i]));
        }
        u_dx = fma(gU, dx, u_dx), u_dy = fma(gU, dy, u_dy), u += gU;
        v_dx = fma(gV, dx, v_dx), v_dy = fma(gV, dy, v_dy), v += gV;
        w_dx = fma(gW, dx, w_dx), w_dy = fma(gW, dy, w_dy);
    }

    template <bool Depth>
    TEXGS_INLINE void put(vf* line) const {
        using K = SurfelSums;
        line[K::kUdx] = u_dx, line[K::kUdy] = u_dy, line[K::kU] = u;
        line[K::kVdx] = v_dx, line[K::kVdy] = v_dy, line[K::kV] = v;
        line[K::kWdx] = w_dx, line[K::kWdy] = w_dy;
        line[K::kDiscDx] = disc_dx, line[K::kDiscDy] = disc_dy, line[K::kE] = e;
        if constexpr (Depth) line[K::kZc] = zc, line[K::kZp] = zp;
    }
};

template <>
struct FragmentSums<Gaussian<vf>> {
    vf e = 0.0f, u = 0.0f, v = 0.0f, uu = 0.0f, uv = 0.0f, vv = 0.0f, z = 0.0f;

    template <bool Depth, bool Textured>
    TEXGS_INLINE void add(const Raster& r, BackwardScratch& s, unsigned, int i, int pixel, vf, vf, vf w) {
        const vf by_e = load(s.alpha[i]), at_u = load(s.u[i]), at_v = load(s.v[i]);
        const vf by_u = by_e * at_u, by_v = by_e * at_v;
        e += by_e, u += by_u, v += by_v;
        uu = fma(by_u, at_u, uu), uv = fma(by_u, at_v, uv), vv = fma(by_v, at_v, vv);
        if constexpr (Depth) z += depth_gradient(r, s.d, pixel, load(s.z[i]), w);
    }

    template <bool Depth>
    TEXGS_INLINE void put(vf* line) const {
        using K = GaussianSums;
        line[K::kE] = e, line[K::kU] = u, line[K::kV] = v;
        line[K::kUU] = uu, line[K::kUV] = uv, line[K::kVV] = vv;
        if constexpr (Depth) line[K::kZ] = z;
    }
};

}  // namespace
}  // namespace texgs::TEXGS_ISA
