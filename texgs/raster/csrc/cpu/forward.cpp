// SPDX-License-Identifier: Apache-2.0
// Forward pass over one tile: block by block, so that a block's transmittance and colours stay in registers.
//
// The work on a batch of surfels is split in two loops. The first computes alphas, which do not depend on each other;
// the second carries the transmittance from one to the next. Fused, the long dependency chain would fill the
// scheduler and nothing would overlap.
#include "isa.h"
#include "replay.h"
#include "texture.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kBatch = 32;

struct alignas(64) ForwardScratch {
    Chunk chunk;
    TextureTables textures;
    float transmittance[kTilePixels], alpha[kTilePixels];
    float color[kMaxChannels][kTilePixels];
    struct {
        float depth[kTilePixels], median[kTilePixels], stop[kTilePixels], moments[3][kTilePixels];
    } z;
    float weight[kBatch][kLanes], depth[kBatch][kLanes], u[kBatch][kLanes], v[kBatch][kLanes];
    int32_t list[kChunk + 16];
};

// A batch of surfels, by their place in the chunk.
struct Batch {
    const int32_t* list;
    int n;
};

template <bool Depth, bool Textured>
TEXGS_INLINE void alphas(ForwardScratch& s, Batch batch, Pixels at, const Limits& limits) {
    for (int j = 0; j < batch.n; ++j) {
        const Record& record = s.chunk.records[batch.list[j]];
        const Fragments f = evaluate(record, s.chunk.flags[batch.list[j]], at, limits);
        store(s.weight[j], f.alpha);
        if constexpr (Depth) store(s.depth[j], depth_of(record, f));
        if constexpr (Textured) store(s.u[j], f.u), store(s.v[j], f.v);
    }
}

// Turns alphas into weights. A pixel that has ended keeps multiplying: its transmittance only falls, so that
// `remaining >= transmittance_min` alone tells whether a fragment counts.
TEXGS_INLINE bool weights(ForwardScratch& s, Batch batch, int pixel, vf limit) {
    vf T = load(s.transmittance + pixel), alpha = load(s.alpha + pixel);
    for (int j = 0; j < batch.n; ++j) {
        const vf a = load(s.weight[j]);
        const vf remaining = fnma(a, T, T);
        const vf w = zero_unless(remaining >= limit, a * T);
        alpha += w;
        T = remaining;
        store(s.weight[j], w);
    }
    store(s.transmittance + pixel, T);
    store(s.alpha + pixel, alpha);
    return any(T >= limit);
}

// Expected and median depth, and the moments of the distortion. The fragment before which more than half of the light
// is left sets the median.
TEXGS_INLINE void blend_depth(const Raster& r, ForwardScratch& s, Batch batch, int pixel, vf alpha) {
    const float scale = r.options.far_plane / (r.options.far_plane - r.options.near_plane);
    vf depth = load(s.z.depth + pixel), median = load(s.z.median + pixel), stop = load(s.z.stop + pixel);
    vf m1 = load(s.z.moments[0] + pixel), m2 = load(s.z.moments[1] + pixel), origin = load(s.z.moments[2] + pixel);
    for (int j = 0; j < batch.n; ++j) {
        const vf w = load(s.weight[j]), z = load(s.depth[j]);
        const vm counts = w > vf(0.0f), above_half = counts & (alpha < vf(0.5f));
        const vf m = fnma(vf(scale * r.options.near_plane), vf(1.0f) / z, scale);
        origin = select(counts & (alpha <= vf(0.0f)), m, origin);  // moments about the first fragment: no cancellation
        depth = fma_where(counts, z, w, depth);
        const vf centred = m - origin, wm = w * centred;
        m1 = add_where(counts, m1, wm);
        m2 = fma_where(counts, wm, centred, m2);
        median = select(above_half, z, median);
        alpha += w;
        stop = select(above_half, alpha, stop);
    }
    store(s.z.depth + pixel, depth), store(s.z.median + pixel, median), store(s.z.stop + pixel, stop);
    store(s.z.moments[0] + pixel, m1), store(s.z.moments[1] + pixel, m2), store(s.z.moments[2] + pixel, origin);
}

// Adds weight * channel for N channels that are constant over a surfel.
template <int N>
TEXGS_INLINE void blend_group(const ForwardScratch& s, Batch batch, const float* channels, int stride, float* color) {
    vf sum[N];
    for (int c = 0; c < N; ++c) sum[c] = load(color + c * kTilePixels);
    for (int j = 0; j < batch.n; ++j) {
        const vf w = load(s.weight[j]);
        const float* value = channels + batch.list[j] * stride;
        for (int c = 0; c < N; ++c) sum[c] = fma(w, value[c], sum[c]);
    }
    for (int c = 0; c < N; ++c) store(color + c * kTilePixels, sum[c]);
}

TEXGS_INLINE void blend_channels(const Raster& r, ForwardScratch& s, Batch batch, int pixel) {
    const int n = r.channels, stride = s.chunk.stride;
    int c = 0;
    for (; n - c >= 8; c += 8) blend_group<8>(s, batch, s.chunk.channels + c, stride, s.color[c] + pixel);
    if (n - c >= 4) {
        blend_group<4>(s, batch, s.chunk.channels + c, stride, s.color[c] + pixel);
        c += 4;
    }
    const float* channels = s.chunk.channels + c;
    switch (n - c) {
        case 1: return blend_group<1>(s, batch, channels, stride, s.color[c] + pixel);
        case 2: return blend_group<2>(s, batch, channels, stride, s.color[c] + pixel);
        case 3: return blend_group<3>(s, batch, channels, stride, s.color[c] + pixel);
        default: return;
    }
}

TEXGS_INLINE void blend_texture(ForwardScratch& s, Batch batch, int pixel) {
    vf sum[3];
    for (int c = 0; c < 3; ++c) sum[c] = load(s.color[c] + pixel);
    for (int j = 0; j < batch.n; ++j) {
        const vf w = load(s.weight[j]);
        if (!any(w > vf(0.0f))) continue;
        const TextureTable& table = s.textures.of[batch.list[j]];
        vf texel[3];
        sample(table, texel_coordinates(table, load(s.u[j]), load(s.v[j])), texel);
        for (int c = 0; c < 3; ++c) sum[c] = fma(w * vf(table.gain), texel[c], sum[c]);
    }
    for (int c = 0; c < 3; ++c) store(s.color[c] + pixel, sum[c]);
}

// Blends the chunk's surfels into one vector of a block; returns whether any of its pixels goes on.
template <bool Depth, bool Textured>
TEXGS_INLINE bool blend_part(const Raster& r, ForwardScratch& s, int n, Pixels at, int pixel, const Limits& limits) {
    bool alive = true;
    for (int j = 0; j < n && alive; j += kBatch) {
        const Batch batch{s.list + j, n - j < kBatch ? n - j : kBatch};
        alphas<Depth, Textured>(s, batch, at, limits);
        [[maybe_unused]] const vf alpha_before = load(s.alpha + pixel);
        alive = weights(s, batch, pixel, limits.transmittance_min);
        blend_channels(r, s, batch, pixel);
        if constexpr (Textured) blend_texture(s, batch, pixel);
        if constexpr (Depth) blend_depth(r, s, batch, pixel, alpha_before);
    }
    return alive;
}

template <bool Depth, bool Textured>
void blend_tile(const Raster& r, int tile, ForwardScratch& s) {
    const TilePixels pixels(r, tile);
    const Limits limits(r.options);
    uint32_t alive = start_tile(r, pixels, s.transmittance);
    const uint32_t end = r.tile_begin[tile + 1];
    for (uint32_t begin = r.tile_begin[tile]; begin < end && alive; begin += kChunk) {
        const int n = static_cast<int>(end - begin < kChunk ? end - begin : kChunk);
        s.chunk.stage(r, begin, n);
        if constexpr (Textured) s.textures.stage(r, s.chunk, n);
        for (int block = 0; block < kBlocks; ++block) {
            if (!(alive >> block & 1)) continue;
            const int members = list_block(s.chunk.masks, n, block, s.list);
            bool goes_on = false;
            for (int part = 0; part < kParts; ++part)
                goes_on |= blend_part<Depth, Textured>(r, s, members, pixels.of(block, part),
                                                       block * kBlockPixels + part * kLanes, limits);
            if (!goes_on) alive &= ~(1u << block);
        }
    }
}

// Composites over the background and writes the tile's part of the images.
void finish_color(const Raster& r, int tile, ForwardScratch& s) {
    const int64_t plane = int64_t(r.camera.width) * r.camera.height;
    for (int c = 0; c < r.surfels.channels; ++c) {
        if (const float background = r.options.background ? r.options.background[c] : 0.0f; background != 0.0f)
            for (int i = 0; i < kTilePixels; i += kLanes)
                store(s.color[c] + i, fma(vf(1.0f) - load(s.alpha + i), background, load(s.color[c] + i)));
        save_plane(r, tile, s.color[c], r.image.color + c * plane);
    }
    if (r.image.alpha) save_plane(r, tile, s.alpha, r.image.alpha);
    if (r.with_normal)
        for (int c = 0; c < 3; ++c) save_plane(r, tile, s.color[r.surfels.channels + c], r.image.normal + c * plane);
}

void finish_depth(const Raster& r, int tile, ForwardScratch& s) {
    float distortion[kTilePixels];
    for (int i = 0; i < kTilePixels; i += kLanes) {
        const vf alpha = load(s.alpha + i), m1 = load(s.z.moments[0] + i);
        store(s.z.depth + i, zero_unless(alpha > vf(0.0f), load(s.z.depth + i) / max(alpha, 1e-30f)));
        store(distortion + i, fnma(m1, m1, alpha * load(s.z.moments[1] + i)));
    }
    if (r.image.depth) save_plane(r, tile, s.z.depth, r.image.depth);
    if (r.image.median) save_plane(r, tile, s.z.median, r.image.median);
    if (r.image.distortion) save_plane(r, tile, distortion, r.image.distortion);
    if (r.median_stop) std::memcpy(r.median_stop + int64_t(tile) * kTilePixels, s.z.stop, sizeof s.z.stop);
    if (r.distortion_moments)
        std::memcpy(r.distortion_moments + int64_t(tile) * 3 * kTilePixels, s.z.moments, sizeof s.z.moments);
}

}  // namespace

const int64_t kForwardScratch = sizeof(ForwardScratch);

void forward_tile(const Raster& r, int tile, void* scratch) {
    ForwardScratch& s = *static_cast<ForwardScratch*>(scratch);
    std::memset(s.alpha, 0, sizeof s.alpha);
    std::memset(s.color, 0, r.channels * sizeof s.color[0]);
    if (r.with_depth) std::memset(&s.z, 0, sizeof s.z);
    const bool textured = r.surfels.base != nullptr;
    if (r.with_depth && textured) blend_tile<true, true>(r, tile, s);
    if (r.with_depth && !textured) blend_tile<true, false>(r, tile, s);
    if (!r.with_depth && textured) blend_tile<false, true>(r, tile, s);
    if (!r.with_depth && !textured) blend_tile<false, false>(r, tile, s);
    finish_color(r, tile, s);
    if (r.with_depth) finish_depth(r, tile, s);
}

}  // namespace texgs::TEXGS_ISA
