// SPDX-License-Identifier: Apache-2.0
// Forward pass over one tile: block by block, so that a block's transmittance and colours stay in registers.
//
// The work on a batch of surfels is split in loops. The first intersects, and its fragments do not depend on each
// other; the second carries the transmittance from one to the next; the third blends.
#include "isa.h"
#include "replay.h"
#include "texel_pairs.h"

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
    int32_t texel[kBatch][kLanes];
    int32_t list[kChunk + 16];
#if defined(TEXGS_AVX512)
    TexelPairs pairs;
#endif
};

// A batch of surfels, by their place in the chunk.
struct Batch {
    const int32_t* list;
    int n;
};

template <class P, bool Depth, bool Textured>
TEXGS_INLINE void intersect(ForwardScratch& s, Batch batch, Pixels at, const Limits& limits) {
    for (int j = 0; j < batch.n; ++j) {
        const Record& record = s.chunk.records[batch.list[j]];
        const Fragments f = evaluate<P>(record, s.chunk.flags[batch.list[j]], at, limits);
        store(s.weight[j], f.log2_alpha);
        if constexpr (Depth) store(s.depth[j], depth_of<P>(record, f));
        if constexpr (Textured) store(s.u[j], f.u), store(s.v[j], f.v);
    }
    take_alphas(s.weight, batch.n, limits);
}

// Turns alphas into weights and blends the first N channels, which lie in the records. A pixel that has ended keeps
// multiplying: its transmittance only falls, so that `remaining >= transmittance_min` alone tells whether a fragment
// counts. Returns whether any pixel goes on.
template <int N>
TEXGS_INLINE bool weigh(ForwardScratch& s, Batch batch, int pixel, const Limits& limits) {
    vf T = load(s.transmittance + pixel), alpha = load(s.alpha + pixel), color[N + 1];
    for (int c = 0; c < N; ++c) color[c] = load(s.color[c] + pixel);
    for (int j = 0; j < batch.n; ++j) {
        const vf a = load(s.weight[j]);
        const vf remaining = fnma(a, T, T);
        const vf w = zero_unless(remaining >= limits.transmittance_min, a * T);
        alpha += w;
        T = remaining;
        store(s.weight[j], w);
        for (int c = 0; c < N; ++c) color[c] = fma(w, s.chunk.records[batch.list[j]].color[c], color[c]);
    }
    store(s.transmittance + pixel, T);
    store(s.alpha + pixel, alpha);
    for (int c = 0; c < N; ++c) store(s.color[c] + pixel, color[c]);
    return any(T >= limits.transmittance_min);
}

// -- Depths: each only where it is asked for -------------------------------------------------------------------------

TEXGS_INLINE void blend_expected_depth(ForwardScratch& s, Batch batch, int pixel) {
    vf depth = load(s.z.depth + pixel);
    for (int j = 0; j < batch.n; ++j) {
        const vf w = load(s.weight[j]);
        depth = fma_where(w > vf(0.0f), load(s.depth[j]), w, depth);  // without weight, depth may not be finite
    }
    store(s.z.depth + pixel, depth);
}

// The fragment before which more than half of the light is left sets the median; `alpha` is that before the batch.
TEXGS_INLINE void take_median(ForwardScratch& s, Batch batch, int pixel, vf alpha) {
    vf median = load(s.z.median + pixel), stop = load(s.z.stop + pixel);
    for (int j = 0; j < batch.n; ++j) {
        const vf w = load(s.weight[j]);
        const vm above_half = (w > vf(0.0f)) & (alpha < vf(0.5f));
        alpha += w;
        median = select(above_half, load(s.depth[j]), median);
        stop = select(above_half, alpha, stop);
    }
    store(s.z.median + pixel, median), store(s.z.stop + pixel, stop);
}

// Moments of the depth in normalised device coordinates, about that of the pixel's first fragment: no cancellation.
TEXGS_INLINE void add_distortion(const Raster& r, ForwardScratch& s, Batch batch, int pixel, vf alpha) {
    vf m1 = load(s.z.moments[0] + pixel), m2 = load(s.z.moments[1] + pixel), origin = load(s.z.moments[2] + pixel);
    for (int j = 0; j < batch.n; ++j) {
        const vf w = load(s.weight[j]);
        const vm counts = w > vf(0.0f);
        const vf z = load(s.depth[j]);
        origin = select(alpha <= vf(0.0f), select(counts, z, 1.0f), origin);
        const vf centred = centred_ndc(r, z, origin), wm = w * centred;
        m1 = add_where(counts, m1, wm);
        m2 = fma_where(counts, wm, centred, m2);
        alpha += w;
    }
    store(s.z.moments[0] + pixel, m1), store(s.z.moments[1] + pixel, m2), store(s.z.moments[2] + pixel, origin);
}

TEXGS_INLINE void blend_depths(const Raster& r, ForwardScratch& s, Batch batch, int pixel, vf alpha) {
    if (r.image.depth) blend_expected_depth(s, batch, pixel);
    if (r.image.median) take_median(s, batch, pixel, alpha);
    if (r.image.distortion) add_distortion(r, s, batch, pixel, alpha);
}

// -- Channels --------------------------------------------------------------------------------------------------------

// Adds weight * channel for the channels that are constant over a surfel, sixteen at a time.
TEXGS_INLINE void blend_channels(const Raster& r, ForwardScratch& s, Batch batch, int pixel) {
    for (int first = 0; first < r.channels; first += 16)
        with_constant<16>(r.channels - first < 16 ? r.channels - first : 16, [&](auto width) {
            constexpr int N = decltype(width)::value;
            vf sum[N];
            for (int c = 0; c < N; ++c) sum[c] = load(s.color[first + c] + pixel);
            for (int j = 0; j < batch.n; ++j) {
                const vf w = load(s.weight[j]);
                const float* value = s.chunk.channels + batch.list[j] * s.chunk.stride + first;
                for (int c = 0; c < N; ++c) sum[c] = fma(w, value[c], sum[c]);
            }
            for (int c = 0; c < N; ++c) store(s.color[first + c] + pixel, sum[c]);
        });
}

TEXGS_INLINE void blend_texture(ForwardScratch& s, Batch batch, int pixel) {
    for (int j = 0; j < batch.n; ++j) {
        const TexelCoordinates at = texel_coordinates(s.textures.of[batch.list[j]], load(s.u[j]), load(s.v[j]));
        store(s.u[j], at.fx), store(s.v[j], at.fy);
        store(s.texel[j], at.first);
    }
    vf sum[3];
    for (int c = 0; c < 3; ++c) sum[c] = load(s.color[c] + pixel);
#if defined(TEXGS_AVX512)
    s.pairs.clear();
#endif
    for (int j = 0; j < batch.n; ++j) {
        const TextureTable& table = s.textures.of[batch.list[j]];
        const vf weight = load(s.weight[j]), w = weight * vf(table.gain), fx = load(s.u[j]), fy = load(s.v[j]);
        const vi first = load(s.texel[j]);
#if defined(TEXGS_AVX512)
        if (!table.planes) {
            if (any(weight > vf(0.0f))) s.pairs.add(table, first, fx, fy, w);
            continue;
        }
#endif
        vf texel[3];
        sample(table, first, fx, fy, texel);
        for (int c = 0; c < 3; ++c) sum[c] = fma(w, texel[c], sum[c]);
    }
#if defined(TEXGS_AVX512)
    if (s.pairs.is_used)
        for (int c = 0; c < 3; ++c) sum[c] += s.pairs.sum_of(c);
#endif
    for (int c = 0; c < 3; ++c) store(s.color[c] + pixel, sum[c]);
}

// Blends the chunk's surfels into one vector of a block; returns whether any of its pixels goes on.
template <class P, bool Depth, bool Textured, int N>
TEXGS_INLINE bool blend_part(const Raster& r, ForwardScratch& s, int n, Pixels at, int pixel, const Limits& limits) {
    bool alive = true;
    for (int j = 0; j < n && alive; j += kBatch) {
        const Batch batch{s.list + j, n - j < kBatch ? n - j : kBatch};
        intersect<P, Depth, Textured>(s, batch, at, limits);
        [[maybe_unused]] const vf alpha_before = load(s.alpha + pixel);
        alive = weigh<N>(s, batch, pixel, limits);
        if constexpr (N == 0) blend_channels(r, s, batch, pixel);
        if constexpr (Textured) blend_texture(s, batch, pixel);
        if constexpr (Depth) blend_depths(r, s, batch, pixel, alpha_before);
    }
    return alive;
}

// N: the number of channels where the records hold them, else 0.
template <class P, bool Depth, bool Textured, int N>
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
                goes_on |= blend_part<P, Depth, Textured, N>(r, s, members, pixels.of(block, part),
                                                             block * kBlockPixels + part * kLanes, limits);
            if (!goes_on) alive &= ~(1u << block);
        }
    }
}

template <class P, bool Depth, bool Textured>
void blend_tile_channels(const Raster& r, int tile, ForwardScratch& s) {
    if (r.channels > kRecordChannels) return blend_tile<P, Depth, Textured, 0>(r, tile, s);
    with_constant<kRecordChannels>(r.channels,
                                   [&](auto n) { blend_tile<P, Depth, Textured, decltype(n)::value>(r, tile, s); });
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
    with_primitive<vf>(r.surfels.axes, [&](auto primitive) {
        using P = typename decltype(primitive)::type;
        const bool textured = !P::kAffine && r.surfels.base;
        if constexpr (!P::kAffine) {
            if (r.with_depth && textured) blend_tile_channels<P, true, true>(r, tile, s);
            if (!r.with_depth && textured) blend_tile_channels<P, false, true>(r, tile, s);
        }
        if (r.with_depth && !textured) blend_tile_channels<P, true, false>(r, tile, s);
        if (!r.with_depth && !textured) blend_tile_channels<P, false, false>(r, tile, s);
    });
    finish_color(r, tile, s);
    if (r.with_depth) finish_depth(r, tile, s);
}

}  // namespace texgs::TEXGS_ISA
