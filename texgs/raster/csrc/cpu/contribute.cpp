// SPDX-License-Identifier: Apache-2.0
// What each surfel contributed to an image: the sum of its weights, the largest, the number of its pixels, and the sum
// of weight times another image. The last is the adjoint of rendering, and the gradient of features when the
// geometry is frozen.
#include "isa.h"
#include "replay.h"

namespace texgs::TEXGS_ISA {
namespace {

using Sums = ContributionSums;

struct alignas(64) ContributeScratch {
    Chunk chunk;
    Group group;
    float image[TEXGS_MAX_CHANNELS][kTilePixels];
    float transmittance[kTilePixels];
    float weight[kVectors][kLanes];
};

// Weights of the group's entries.
template <class P>
TEXGS_INLINE void blend_entries(ContributeScratch& s, const TilePixels& pixels, const Limits& limits) {
    for (int e = 0; e < s.group.entries; ++e)
        for (int part = 0; part < kParts; ++part) {
            const int place = s.group.surfel[e];
            const Pixels at = pixels.of(s.group.block[e], part);
            store(s.weight[e * kParts + part],
                  evaluate<P>(s.chunk.records[place], s.chunk.flags[place], at, limits).log2_alpha);
        }
    take_alphas(s.weight, s.group.entries * kParts, limits);
    for (int i = 0; i < s.group.entries * kParts; ++i) {
        const int pixel = s.group.block[i / kParts] * kBlockPixels + i % kParts * kLanes;
        store(s.weight[i], blend(load(s.weight[i]), s.transmittance + pixel, limits).weight);
    }
}

// Sums of one surfel, to its slot: the counts and the first N channels of the image in the first line.
template <int N>
TEXGS_INLINE void add_surfel(const Raster& r, const ContributeScratch& s, int k) {
    const int begin = s.group.first[k], end = s.group.first[k + 1];
    vf sum_w = 0.0f, most = 0.0f, pixels = 0.0f, sums[N + 1];
    for (int c = 0; c < N; ++c) sums[c] = 0.0f;
    for (int e = begin; e < end; ++e)
        for (int part = 0; part < kParts; ++part) {
            const vf w = load(s.weight[e * kParts + part]);
            const float* at = s.image[0] + s.group.block[e] * kBlockPixels + part * kLanes;
            sum_w += w;
            most = max(most, w);
            pixels += zero_unless(w > vf(0.0f), 1.0f);
            for (int c = 0; c < N; ++c) sums[c] = fma(w, load(at + c * kTilePixels), sums[c]);
        }
    float* slot = r.slots + int64_t(s.chunk.slots[s.group.place[k]]) * r.slot_stride;
    float only_lane[kLanes] = {largest(most)};  // its sum is the largest
    vf line[16];
    line[Sums::kWeight] = sum_w, line[Sums::kLargest] = load(only_lane), line[Sums::kPixels] = pixels;
    for (int c = 0; c < 16 - Sums::kChannels; ++c) line[Sums::kChannels + c] = c < N ? sums[c] : vf(0.0f);
    stream_sums(line, slot);
    stream_planes(s.group, begin, end, s.weight[0], s.image[N], r.contributions.channels - N, slot + 16);
}

void add_surfels(const Raster& r, const ContributeScratch& s) {
    constexpr int most = 16 - Sums::kChannels;
    const auto add = [&](auto first) {
        for (int k = 0; k < s.group.surfels; ++k) add_surfel<decltype(first)::value>(r, s, k);
    };
    if (r.contributions.channels == 0) return add(Constant<0>{});
    with_constant<most>(r.contributions.channels < most ? r.contributions.channels : most, add);
}

template <class P>
void replay_tile(const Raster& r, int tile, ContributeScratch& s) {
    if (r.tile_begin[tile] == r.tile_begin[tile + 1]) return;
    const TilePixels pixels(r, tile);
    const Limits limits(r.options);
    for (int c = 0; c < r.contributions.channels; ++c) {
        std::memset(s.image[c], 0, sizeof s.image[c]);
        load_plane(r, tile, r.contributions.image + int64_t(c) * r.camera.width * r.camera.height, s.image[c]);
    }
    prefetch_planes(r, tile + 1, r.contributions.image, r.contributions.channels);
    uint32_t alive = start_tile(r, pixels, s.transmittance);
    const uint32_t end = r.tile_begin[tile + 1];
    uint32_t begin = r.tile_begin[tile];
    for (; begin < end && alive; begin += kChunk) {
        const int n = static_cast<int>(end - begin < kChunk ? end - begin : kChunk);
        s.chunk.stage(r, begin, n);
        for (int next = 0; next < n;) {
            next = s.group.fill(s.chunk, next, n, alive, [&](int place) {
                stream_zeros(r.slots + int64_t(s.chunk.slots[place]) * r.slot_stride, r.slot_stride);
            });
            blend_entries<P>(s, pixels, limits);
            add_surfels(r, s);
            alive = still_alive(r, s.transmittance, alive);
        }
    }
    for (; begin < end; ++begin) stream_zeros(r.slots + int64_t(r.pairs[begin].slot) * r.slot_stride, r.slot_stride);
    stream_fence();
}

}  // namespace

const int64_t kContributeScratch = sizeof(ContributeScratch);

void contribute_tile(const Raster& r, int tile, void* scratch) {
    with_primitive<vf>(r.surfels.axes, [&](auto primitive) {
        replay_tile<typename decltype(primitive)::type>(r, tile, *static_cast<ContributeScratch*>(scratch));
    });
}

void reduce_contributions(const Raster& r, int64_t begin, int64_t end) {
    const texgs_contributions& out = r.contributions;
    for (int64_t i = begin; i < end; ++i) {
        alignas(64) float sums[Sums::kChannels + TEXGS_MAX_CHANNELS + 16] = {};
        for (uint32_t slot = r.slot_begin[i]; slot < r.slot_begin[i + 1]; ++slot) {
            const float* from = r.slots + int64_t(slot) * r.slot_stride;
            const float most =
                sums[Sums::kLargest] > from[Sums::kLargest] ? sums[Sums::kLargest] : from[Sums::kLargest];
            for (int k = 0; k < r.slot_stride; k += kLanes) store(sums + k, load(sums + k) + load(from + k));
            sums[Sums::kLargest] = most;
        }
        if (out.weight_sum) out.weight_sum[i] = sums[Sums::kWeight];
        if (out.weight_max) out.weight_max[i] = sums[Sums::kLargest];
        if (out.pixels) out.pixels[i] = sums[Sums::kPixels];
        for (int c = 0; c < out.channels; ++c) out.sums[i * out.channels + c] = sums[Sums::kChannels + c];
    }
}

}  // namespace texgs::TEXGS_ISA
