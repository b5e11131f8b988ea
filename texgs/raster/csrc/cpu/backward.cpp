// SPDX-License-Identifier: Apache-2.0
// Backward pass over one tile: gradient sums of each of its surfels into the pair's slot.
//
// A fragment adds w_i c_i to its pixel, so with q_i = dL/dw_i
//     dL/dalpha_i = T_i q_i - (sum over j behind i of w_j q_j) / (1 - alpha_i).
// The sum over all fragments is known from the rendered image; subtracting w_i q_i front to back leaves the rest. One
// number per pixel is thus all that is carried besides the transmittance, whatever the number of channels.
#include "isa.h"
#include "pixel_gradients.h"
#include "replay.h"
#include "texture.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kGeometrySums = 11;  // Moments without zc, zp and normal
constexpr int kDepthSums = 2;      // zc, zp
constexpr int kFirstLineChannels = 16 - kGeometrySums;

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
    float u[kVectors][kLanes], v[kVectors][kLanes];                  // with a texture
    float texture_u[kVectors][kLanes], texture_v[kVectors][kLanes];  // dL/du, dL/dv per weight through the texture
};

// -- Per entry, independent of each other -----------------------------------------------------------------------------

template <bool Depth, bool Textured>
TEXGS_INLINE void evaluate_entries(BackwardScratch& s, const TilePixels& pixels, const Limits& limits) {
    for (int i = 0; i < s.group.entries * kParts; ++i) {
        const int place = s.group.surfel[i / kParts];
        const Record& record = s.chunk.records[place];
        const unsigned flags = s.chunk.flags[place];
        const Fragments f = evaluate(record, flags, pixels.of(s.group.block[i / kParts], i % kParts), limits);
        const vf minus_inverse = -f.inverse_w;
        vf by_U = f.u * minus_inverse, by_V = f.v * minus_inverse, by_W = f.rho * f.inverse_w;
        if (flags & kFiltered) {
            const vm by_surfel = f.rho_surfel <= f.rho;
            by_U = zero_unless(by_surfel, by_U);
            by_V = zero_unless(by_surfel, by_V);
            by_W = zero_unless(by_surfel, by_W);
            store(s.filtered[i], zero_unless(~by_surfel, 1.0f));
        }
        store(s.alpha[i], f.log2_alpha);
        store(s.by_U[i], by_U), store(s.by_V[i], by_V), store(s.by_W[i], by_W);
        if constexpr (Depth || Textured) store(s.inverse_w[i], f.inverse_w);
        if constexpr (Depth) store(s.z[i], depth_of(record, f));
        if constexpr (Textured) store(s.u[i], f.u), store(s.v[i], f.v);
    }
}

// Depth in normalised device coordinates, 0 at the near and 1 at the far plane, from `origin`.
TEXGS_INLINE vf centred_ndc(const Raster& r, vf z, vf origin) {
    const float scale = r.options.far_plane / (r.options.far_plane - r.options.near_plane);
    return fnma(vf(scale * r.options.near_plane), vf(1.0f) / z, scale) - origin;
}

// q = dL/dw of each entry from its channels, sixteen at a time: `constant` plus gradient times channel.
void weigh_channels(const Raster& r, BackwardScratch& s) {
    for (int first = 0; first < r.channels; first += 16)
        with_constant<16>(r.channels - first < 16 ? r.channels - first : 16, [&](auto width) {
            for (int i = 0; i < s.group.entries * kParts; ++i) {
                const float* value = s.chunk.channels + s.group.surfel[i / kParts] * s.chunk.stride + first;
                const int pixel = s.group.block[i / kParts] * kBlockPixels + i % kParts * kLanes;
                vf q = load(first ? s.q[i] : s.p[kConstant] + pixel);
                for (int c = 0; c < decltype(width)::value; ++c)
                    q = fma(load(s.p[kGradient + first + c] + pixel), value[c], q);
                store(s.q[i], q);
            }
        });
}

// Fragments without alpha may not be hit at all: their depth is anything.
TEXGS_INLINE vm may_be_hit(vf z) { return abs(z) < vf(1e30f); }

TEXGS_INLINE void weigh_distortion(const Raster& r, BackwardScratch& s) {
    for (int i = 0; i < s.group.entries * kParts; ++i) {
        const int pixel = s.group.block[i / kParts] * kBlockPixels + i % kParts * kLanes;
        const vf z = load(s.z[i]), m = centred_ndc(r, z, load(s.d.origin + pixel));
        const vf by_w = m * fma(load(s.d.m2 + pixel), m, load(s.d.m + pixel));
        store(s.q[i], add_where(may_be_hit(z), load(s.q[i]), by_w));
    }
}

TEXGS_INLINE void weigh_texture(BackwardScratch& s) {
    for (int e = 0; e < s.group.entries; ++e) {
        const TextureTable& table = s.textures.of[s.group.surfel[e]];
        for (int part = 0; part < kParts; ++part) {
            const int i = e * kParts + part, pixel = s.group.block[e] * kBlockPixels + part * kLanes;
            const TexelCoordinates at = texel_coordinates(table, load(s.u[i]), load(s.v[i]));
            vf texel[3], by_u[3], by_v[3], q = 0.0f, gu = 0.0f, gv = 0.0f;
            sample_with_slope(table, at, texel, by_u, by_v);
            for (int c = 0; c < 3; ++c) {
                const vf gradient = load(s.p[kGradient + c] + pixel) * vf(table.gain);
                q = fma(gradient, texel[c], q), gu = fma(gradient, by_u[c], gu), gv = fma(gradient, by_v[c], gv);
            }
            store(s.q[i], load(s.q[i]) + q);
            store(s.texture_u[i], gu), store(s.texture_v[i], gv);
        }
    }
}

// -- Per entry, in order ----------------------------------------------------------------------------------------------

// Blends all entries: weights, and e = alpha dL/dalpha in place of alpha. N > 0: the surfels have N channels, few
// enough to compute q on the way; otherwise it is there, but for the depth.
template <bool Depth, int N>
TEXGS_INLINE void blend_entries(BackwardScratch& s, const Limits& limits) {
    const float* channels = s.chunk.channels;
    const int stride = N <= kRecordChannels ? Chunk::kRecordStride : s.chunk.stride;
    for (int i = 0; i < s.group.entries * kParts; ++i) {
        float* at = s.p.data + s.group.block[i / kParts] * kBlockPixels + i % kParts * kLanes;
        const float* value = channels + s.group.surfel[i / kParts] * stride;
        const vf alpha = alpha_of(load(s.alpha[i]), limits);
        vf q = load(N ? at + kConstant * kTilePixels : s.q[i]);
        for (int c = 0; c < N; ++c) q = fma(load(at + (kGradient + c) * kTilePixels), value[c], q);
        if constexpr (Depth) q = fma_where(alpha > vf(0.0f), load(s.z[i]), load(s.d.depth + (at - s.p.data)), q);
        const Blend b = blend(alpha, at + kTransmittance * kTilePixels, limits);
        const vf remaining = fnma(b.weight, q, load(at + kRemaining * kTilePixels));
        store(at + kRemaining * kTilePixels, remaining);
        const vf by_alpha = fma(b.before, q, -(remaining / (vf(1.0f) - alpha)));
        const vm live = (b.weight > vf(0.0f)) & (alpha < vf(kLargestAlpha));
        store(s.alpha[i], zero_unless(live, alpha * by_alpha));
        store(s.weight[i], b.weight);
    }
}

// -- Per surfel -------------------------------------------------------------------------------------------------------

struct Sums {
    vf u_dx = 0.0f, u_dy = 0.0f, u = 0.0f, v_dx = 0.0f, v_dy = 0.0f, v = 0.0f, w_dx = 0.0f, w_dy = 0.0f;
    vf disc_dx = 0.0f, disc_dy = 0.0f, e = 0.0f, zc = 0.0f, zp = 0.0f;
};

// dL/dz of fragments, from distortion, median and expected depth.
TEXGS_INLINE vf depth_gradient(const Raster& r, DepthGradients& d, int pixel, vf z, vf w) {
    vf by_w = load(d.depth + pixel);
    if (r.grad.distortion) {
        const float scale = r.options.far_plane / (r.options.far_plane - r.options.near_plane);
        const vf m = centred_ndc(r, z, load(d.origin + pixel));
        const vf by_m = fma(vf(2.0f) * load(d.m2 + pixel), m, load(d.m + pixel));
        by_w = fma(by_m, vf(scale * r.options.near_plane) / (z * z), by_w);
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

// Adds the fragments of one vector of pixels of weights `w`.
template <bool Depth, bool Textured>
TEXGS_INLINE void add_entry(const Raster& r, BackwardScratch& s, unsigned flags, int i, int pixel, vf dx, vf dy, vf w,
                            Sums& sums) {
    const vf e = load(s.alpha[i]);
    sums.e += e;
    const vm live = abs(e) > vf(0.0f);  // elsewhere U / W may not be finite
    vf gU = zero_unless(live, e * load(s.by_U[i]));
    vf gV = zero_unless(live, e * load(s.by_V[i]));
    vf gW = zero_unless(live, e * load(s.by_W[i]));
    if (flags & kFiltered) {
        const vf filtered = e * load(s.filtered[i]);
        sums.disc_dx = fma(filtered, dx, sums.disc_dx);
        sums.disc_dy = fma(filtered, dy, sums.disc_dy);
    }
    if constexpr (Depth) {
        const vf z = load(s.z[i]);
        vf gz = depth_gradient(r, s.d, pixel, z, w);
        if (flags & kFiltered) {
            const vf of_mean = gz * load(s.filtered[i]);
            sums.zp += of_mean;
            gz = gz - of_mean;
        }
        const vf by_zc = zero_unless(w > vf(0.0f), gz * load(s.inverse_w[i]));
        gW = gW - zero_unless(w > vf(0.0f), by_zc * z);
        sums.zc += by_zc;
    }
    if constexpr (Textured) {  // where a coordinate is clamped its gradient is 0, and u or v may not be finite
        const vf gu = load(s.texture_u[i]), gv = load(s.texture_v[i]), scaled = w * load(s.inverse_w[i]);
        const vm by_u = abs(gu * w) > vf(0.0f), by_v = abs(gv * w) > vf(0.0f);
        gU = add_where(by_u, gU, scaled * gu);
        gV = add_where(by_v, gV, scaled * gv);
        gW = gW - zero_unless(by_u, scaled * gu * load(s.u[i])) - zero_unless(by_v, scaled * gv * load(s.v[i]));
    }
    sums.u_dx = fma(gU, dx, sums.u_dx), sums.u_dy = fma(gU, dy, sums.u_dy), sums.u += gU;
    sums.v_dx = fma(gV, dx, sums.v_dx), sums.v_dy = fma(gV, dy, sums.v_dy), sums.v += gV;
    sums.w_dx = fma(gW, dx, sums.w_dx), sums.w_dy = fma(gW, dy, sums.w_dy);
}

// Sums over the surfel's entries, to its slot: geometry, then channels. N > 0: all channels fit into the first line and
// are summed on the way; more would not leave registers for the geometry.
template <bool Depth, bool Textured, int N>
TEXGS_INLINE void add_surfel(const Raster& r, BackwardScratch& s, const TilePixels& pixels, int k) {
    const int begin = s.group.first[k], end = s.group.first[k + 1], place = s.group.place[k];
    const unsigned flags = s.chunk.flags[place];
    const vf cx = s.chunk.records[place].cx, cy = s.chunk.records[place].cy;
    Sums a;
    vf channels[N + 1];
    for (int c = 0; c < N; ++c) channels[c] = 0.0f;
    for (int e = begin; e < end; ++e)
        for (int part = 0; part < kParts; ++part) {
            const int block = s.group.block[e], i = e * kParts + part, pixel = block * kBlockPixels + part * kLanes;
            const Pixels at = pixels.of(block, part);
            const vf w = load(s.weight[i]);
            add_entry<Depth, Textured>(r, s, flags, i, pixel, at.x - cx, at.y - cy, w, a);
            for (int c = 0; c < N; ++c)
                channels[c] = fma(w, load(s.p.data + (kGradient + c) * kTilePixels + pixel), channels[c]);
        }
    constexpr int used = kGeometrySums + (Depth ? kDepthSums : 0), room = 16 - used;
    vf line[16] = {a.u_dx, a.u_dy, a.u, a.v_dx, a.v_dy, a.v, a.w_dx, a.w_dy, a.disc_dx, a.disc_dy, a.e};
    if constexpr (Depth) line[kGeometrySums] = a.zc, line[kGeometrySums + 1] = a.zp;
    for (int c = 0; c < room; ++c) line[used + c] = c < N ? channels[c] : vf(0.0f);
    float* slot = r.slots + int64_t(s.chunk.slots[place]) * r.slot_stride;
    if constexpr (N == 0) {
        const int first = r.channels < room ? r.channels : room;
        with_constant<room>(first, [&](auto width) {
            weigh_planes<decltype(width)::value>(s.group, begin, end, s.weight[0], s.p[kGradient], line + used);
        });
        stream_planes(s.group, begin, end, s.weight[0], s.p[kGradient + first], r.channels - first, slot + 16);
    }
    stream_sums(line, slot);
}

// The group's entries are evaluated: blends them and sums over each surfel.
template <bool Depth, bool Textured, int N>
TEXGS_INLINE void add_group(const Raster& r, BackwardScratch& s, const TilePixels& pixels, const Limits& limits) {
    if constexpr (N == 0) {
        weigh_channels(r, s);
        if constexpr (Textured) weigh_texture(s);
        if (r.grad.distortion) weigh_distortion(r, s);
    }
    blend_entries<Depth, N>(s, limits);
    for (int k = 0; k < s.group.surfels; ++k) add_surfel<Depth, Textured, N>(r, s, pixels, k);
}

// N: the number of channels where they fit into the first line of a slot and nothing else does, else 0.
template <bool Depth, bool Textured, int N>
void replay_tile(const Raster& r, int tile, BackwardScratch& s) {
    const TilePixels pixels(r, tile);
    const Limits limits(r.options);
    if (r.tile_begin[tile] == r.tile_begin[tile + 1]) return;
    load_gradients(r, tile, s.p, Depth ? &s.d : nullptr);
    prefetch_gradients(r, tile + 1);
    uint32_t alive = start_tile(r, pixels, s.p[kTransmittance]);
    const uint32_t end = r.tile_begin[tile + 1];
    uint32_t begin = r.tile_begin[tile];
    for (; begin < end && alive; begin += kChunk) {
        const int n = static_cast<int>(end - begin < kChunk ? end - begin : kChunk);
        s.chunk.stage(r, begin, n);
        if constexpr (Textured) s.textures.stage(r, s.chunk, n);
        const auto skip = [&](int place) {
            stream_zeros(r.slots + int64_t(s.chunk.slots[place]) * r.slot_stride, r.slot_stride);
        };
        for (int next = 0; next < n;) {
            next = s.group.fill(s.chunk, next, n, alive, skip);
            evaluate_entries<Depth, Textured>(s, pixels, limits);
            add_group<Depth, Textured, N>(r, s, pixels, limits);
            alive = still_alive(r, s.p[kTransmittance], alive);
        }
    }
    for (; begin < end; ++begin) stream_zeros(r.slots + int64_t(r.pairs[begin].slot) * r.slot_stride, r.slot_stride);
    stream_fence();
}

}  // namespace

const int64_t kBackwardScratch = sizeof(BackwardScratch);

void backward_tile(const Raster& r, int tile, void* scratch) {
    BackwardScratch& s = *static_cast<BackwardScratch*>(scratch);
    const bool textured = r.surfels.base != nullptr, depth = r.grad.depth || r.grad.median || r.grad.distortion;
    if (depth && textured) return replay_tile<true, true, 0>(r, tile, s);
    if (depth) return replay_tile<true, false, 0>(r, tile, s);
    if (textured) return replay_tile<false, true, 0>(r, tile, s);
    if (r.channels > kFirstLineChannels) return replay_tile<false, false, 0>(r, tile, s);
    with_constant<kFirstLineChannels>(r.channels,
                                      [&](auto n) { replay_tile<false, false, decltype(n)::value>(r, tile, s); });
}

}  // namespace texgs::TEXGS_ISA
