// SPDX-License-Identifier: Apache-2.0
// Walks a tile surfel by surfel, front to back, as the backward passes need it: a surfel's sums then stay in registers
// over its blocks. The transmittance is replayed bit for bit as in the forward pass, so nothing per fragment is kept.
//
// Surfels are taken in groups whose (surfel, block) entries are listed flat: loops over entries are long enough for
// the machine, loops over the blocks of one surfel are not.
#pragma once
#include "fragment.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kGroupEntries = 1024 / kLanes;  // at least; the last surfel may go beyond
constexpr int kMaxEntries = kGroupEntries + kBlocks;
constexpr int kVectors = kMaxEntries * kParts;  // vectors of pixels in a group

struct alignas(64) Group {
    int32_t surfel[kMaxEntries + kLanes];  // place in the chunk
    int32_t block[kMaxEntries + kLanes];
    int first[kChunk + 1];  // entries of the k-th surfel of the group: [first[k], first[k + 1])
    int place[kChunk];      // its place in the chunk
    int surfels, entries;

    // Takes surfels from place `next` on, as far as their blocks in `alive` fit; calls skip(place) for those that reach
    // none. Returns the next place.
    template <class Skip>
    int fill(const Chunk& chunk, int next, int n, uint32_t alive, Skip skip) {
        surfels = entries = 0;
        for (; next < n && entries < kGroupEntries; ++next) {
            const uint32_t mask = chunk.masks[next] & alive;
            if (!mask) {
                skip(next);
                continue;
            }
            first[surfels] = entries;
            place[surfels++] = next;
            append(next, mask);
        }
        first[surfels] = entries;
        return next;
    }

private:
    TEXGS_INLINE void append(int next, uint32_t mask) {
        for (int first = 0; first < kBlocks; first += kLanes) {
            const vm hit = mask_of(mask >> first);
            store_chosen(block + entries, splat(first) + iota(), hit);
            store(surfel + entries, splat(next));
            entries += count(hit);
        }
    }
};

// Transmittance of a tile's pixels at the start: 1, or 0 where nothing counts. Returns the blocks that have any.
TEXGS_INLINE uint32_t start_tile(const Raster& r, const TilePixels& pixels, float* transmittance) {
    uint32_t alive = 0;
    for (int block = 0; block < kBlocks; ++block)
        for (int part = 0; part < kParts; ++part) {
            const vf open = open_pixels(r, pixels.of(block, part));
            store(transmittance + block * kBlockPixels + part * kLanes, open);
            alive |= uint32_t(any(open > vf(0.0f))) << block;
        }
    return alive;
}

// Blocks of `alive` in which some pixel goes on.
TEXGS_INLINE uint32_t still_alive(const Raster& r, const float* transmittance, uint32_t alive) {
    for (int block = 0; block < kBlocks; ++block) {
        vf most = 0.0f;
        for (int part = 0; part < kParts; ++part)
            most = max(most, load(transmittance + block * kBlockPixels + part * kLanes));
        if (!any(most >= vf(r.options.transmittance_min))) alive &= ~(1u << block);
    }
    return alive;
}

// Blends fragments of opacity `alpha` into the pixels at `transmittance` and returns their weights.
struct Blend {
    vf weight, before;
    vm counts;
};
TEXGS_INLINE Blend blend(vf alpha, float* transmittance, const Limits& limits) {
    Blend b;
    b.before = load(transmittance);
    const vf remaining = fnma(alpha, b.before, b.before);
    b.counts = remaining >= limits.transmittance_min;
    b.weight = zero_unless(b.counts, alpha * b.before);
    store(transmittance, remaining);
    return b;
}

// Sums of up to 16 vectors, in order, as one cache line at `out` that bypasses the caches: it is read much later.
TEXGS_INLINE void stream_sums(const vf sums[16], float* out) {
#if defined(TEXGS_AVX512)
    // Four rounds of halving: add pairs of vectors after interleaving them, so that each keeps its own sums.
    const auto fold = [](__m512 a, __m512 b, auto low, auto high) { return _mm512_add_ps(low(a, b), high(a, b)); };
    const auto lo32 = [](__m512 a, __m512 b) { return _mm512_unpacklo_ps(a, b); };
    const auto hi32 = [](__m512 a, __m512 b) { return _mm512_unpackhi_ps(a, b); };
    const auto lo64 = [](__m512 a, __m512 b) {
        return _mm512_castpd_ps(_mm512_unpacklo_pd(_mm512_castps_pd(a), _mm512_castps_pd(b)));
    };
    const auto hi64 = [](__m512 a, __m512 b) {
        return _mm512_castpd_ps(_mm512_unpackhi_pd(_mm512_castps_pd(a), _mm512_castps_pd(b)));
    };
    const auto even128 = [](__m512 a, __m512 b) { return _mm512_shuffle_f32x4(a, b, 0x88); };
    const auto odd128 = [](__m512 a, __m512 b) { return _mm512_shuffle_f32x4(a, b, 0xdd); };
    __m512 quad[4];  // quad[k]: in each 128-bit part the partial sums of vectors 4k to 4k + 3
    for (int k = 0; k < 4; ++k) {
        const vf* s = sums + 4 * k;
        quad[k] = fold(fold(s[0].v, s[1].v, lo32, hi32), fold(s[2].v, s[3].v, lo32, hi32), lo64, hi64);
    }
    const __m512 low = fold(quad[0], quad[1], even128, odd128), high = fold(quad[2], quad[3], even128, odd128);
    stream(out, fold(low, high, even128, odd128));
#else
    for (int k = 0; k < 16; k += kLanes) stream(out + k, sums_of(sums + k));
#endif
}
TEXGS_INLINE void stream_zeros(float* out, int n) {
    for (int k = 0; k < n; k += kLanes) stream(out + k, 0.0f);
}

// Sums over a surfel's entries of weight * plane for N planes; `weights` holds a vector per entry and part.
template <int N>
TEXGS_INLINE void weigh_planes(const Group& group, int begin, int end, const float* weights, const float* planes,
                               vf sums[N]) {
    for (int c = 0; c < N; ++c) sums[c] = 0.0f;
    for (int e = begin; e < end; ++e)
        for (int part = 0; part < kParts; ++part) {
            const vf w = load(weights + (e * kParts + part) * kLanes);
            const float* at = planes + group.block[e] * kBlockPixels + part * kLanes;
            for (int c = 0; c < N; ++c) sums[c] = fma(w, load(at + c * kTilePixels), sums[c]);
        }
}

// The sums for n planes, 16 to a line of the slot at `out`.
TEXGS_INLINE void stream_planes(const Group& group, int begin, int end, const float* weights, const float* planes,
                                int n, float* out) {
    for (; n > 0; n -= 16, planes += 16 * kTilePixels, out += 16)
        with_constant<16>(n < 16 ? n : 16, [&](auto width) {
            constexpr int N = decltype(width)::value;
            vf line[16];
            weigh_planes<N>(group, begin, end, weights, planes, line);
            for (int c = N; c < 16; ++c) line[c] = 0.0f;
            stream_sums(line, out);
        });
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
