// SPDX-License-Identifier: Apache-2.0
// Backward pass over one tile: gradient sums of each of its surfels into the pair's slot.
//
// A fragment adds w_i c_i to its pixel, so with q_i = dL/dw_i
//     dL/dalpha_i = T_i q_i - (sum over j behind i of w_j q_j) / (1 - alpha_i).
// The sum over all fragments is known from the rendered image; subtracting w_i q_i front to back leaves the rest. One
// number per pixel is thus all that is carried besides the transmittance, whatever the number of channels.
#include "fragment_sums.h"
#include "isa.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kLine = 16;                                    // sums in one cache line
constexpr int kFewChannels = kLine - SurfelSums::kGeometry;  // fit into the first line of a slot

// -- Per entry, independent of each other -----------------------------------------------------------------------------

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
        const vf alpha = load(s.alpha[i]);
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

// Sums over the surfel's entries, to its slot: geometry, then channels. N > 0: all channels fit into the first line.
// They are summed on the way where that leaves registers for the geometry.
template <class P, bool Depth, bool Textured, int N>
TEXGS_INLINE void add_surfel(const Raster& r, BackwardScratch& s, const TilePixels& pixels, int k) {
    const int begin = s.group.first[k], end = s.group.first[k + 1], place = s.group.place[k];
    const unsigned flags = s.chunk.flags[place];
    const vf cx = s.chunk.records[place].cx, cy = s.chunk.records[place].cy;
    FragmentSums<P> sums;
    constexpr int used = Depth ? P::Sums::kAll : P::Sums::kGeometry, room = kLine - used;
    constexpr int on_the_way = kRegisters >= 32 ? N : 0;
    vf channels[on_the_way + 1];
    for (int c = 0; c < on_the_way; ++c) channels[c] = 0.0f;
    for (int e = begin; e < end; ++e)
        for (int part = 0; part < kParts; ++part) {
            const int block = s.group.block[e], i = e * kParts + part, pixel = block * kBlockPixels + part * kLanes;
            const Pixels at = pixels.of(block, part);
            const vf w = load(s.weight[i]);
            sums.template add<Depth, Textured>(r, s, flags, i, pixel, at.x - cx, at.y - cy, w);
            for (int c = 0; c < on_the_way; ++c)
                channels[c] = fma(w, load(s.p.data + (kGradient + c) * kTilePixels + pixel), channels[c]);
        }
    vf line[kLine];
    sums.template put<Depth>(line);
    for (int c = 0; c < room; ++c) line[used + c] = c < on_the_way ? channels[c] : vf(0.0f);
    if constexpr (on_the_way < N) weigh_planes<N>(s.group, begin, end, s.weight[0], s.p[kGradient], line + used);
    float* slot = r.slots + int64_t(s.chunk.slots[place]) * r.slot_stride;
    if constexpr (N == 0) {
        const int first = r.channels < room ? r.channels : room;
        with_constant<room>(first, [&](auto width) {
            weigh_planes<decltype(width)::value>(s.group, begin, end, s.weight[0], s.p[kGradient], line + used);
        });
        stream_planes(s.group, begin, end, s.weight[0], s.p[kGradient + first], r.channels - first, slot + kLine);
    }
    stream_sums(line, slot);
}

// The group's entries are evaluated: blends them and sums over each surfel.
template <class P, bool Depth, bool Textured, int N>
TEXGS_INLINE void add_group(const Raster& r, BackwardScratch& s, const TilePixels& pixels, const Limits& limits) {
    if constexpr (N == 0) {
        weigh_channels(r, s);
        if constexpr (Textured) weigh_texture(s);
        if (r.grad.distortion) weigh_distortion(r, s);
    }
    blend_entries<Depth, N>(s, limits);
    for (int k = 0; k < s.group.surfels; ++k) add_surfel<P, Depth, Textured, N>(r, s, pixels, k);
}

// N: the number of channels where they fit into the first line of a slot and nothing else does, else 0.
template <class P, bool Depth, bool Textured, int N>
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
            evaluate_entries<P, Depth, Textured>(s, pixels, limits);
            add_group<P, Depth, Textured, N>(r, s, pixels, limits);
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
    const bool depth = r.grad.depth || r.grad.median || r.grad.distortion;
    with_primitive<vf>(r.surfels.axes, [&](auto primitive) {
        using P = typename decltype(primitive)::type;
        if constexpr (!P::kAffine) {
            if (depth && r.surfels.base) return replay_tile<P, true, true, 0>(r, tile, s);
            if (r.surfels.base) return replay_tile<P, false, true, 0>(r, tile, s);
        }
        if (depth) return replay_tile<P, true, false, 0>(r, tile, s);
        if (r.channels > kFewChannels) return replay_tile<P, false, false, 0>(r, tile, s);
        with_constant<kFewChannels>(r.channels,
                                    [&](auto n) { replay_tile<P, false, false, decltype(n)::value>(r, tile, s); });
    });
}

}  // namespace texgs::TEXGS_ISA
