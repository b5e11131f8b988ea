// SPDX-License-Identifier: Apache-2.0
// What each surfel contributed to an image: the sum of its weights, the largest, the number of its pixels, and the sum
// of weight times another image (the adjoint of rendering).
#include "slots.cuh"

namespace texgs::cuda {
namespace {

using Sums = ContributionSums;

template <class P, int C>
__global__ __launch_bounds__(kThreads, 1) void contribute_kernel(const Raster r) {
    constexpr int kWidth = Sums::kChannels + C;
    __shared__ Chunk<kSlotChunk, 1, false> chunk;
    __shared__ SlotSums<kWidth> sums;
    const int tile = static_cast<int>(r.tile_order[blockIdx.x]);
    const Place at(r, tile);
    const float limit = r.options.transmittance_min;
    const texgs_contributions& wanted = r.contributions;
    float transmittance[kPixels], image[kPixels][C] = {};
#pragma unroll
    for (int p = 0; p < kPixels; ++p) {
        transmittance[p] = at.inside(r, p) ? 1.0f : -1.0f;
#pragma unroll
        for (int c = 0; c < C; ++c)
            if (at.inside(r, p) && c < wanted.channels) image[p][c] = wanted.image[c * r.plane + at.pixel(r, p)];
    }
    const auto visit = [&](int place) {
        float v[kWidth] = {};
        float most = 0.0f;
#pragma unroll
        for (int p = 0; p < kPixels; ++p) {
            if (!(chunk.masks[place] & at.blocks[p])) continue;
            const Fragment f = evaluate<P>(r, chunk.records[place], at, p);
            const float w = blend(f.alpha, limit, transmittance[p]);
            if (!(w > 0.0f)) continue;
            most = fmaxf(most, w);
            v[Sums::kWeight] += w, v[Sums::kPixels] += 1.0f;
#pragma unroll
            for (int c = 0; c < C; ++c) v[Sums::kChannels + c] = fma(w, image[p][c], v[Sums::kChannels + c]);
        }
        most = warp_max(most);
        if (most == 0.0f) return;
        if (lane_index() == 0) v[Sums::kLargest] = most;  // its sum is the largest
        sums.add(place, v);
    };
    for_pairs(
        r, tile, 0, Sums::kLargest, at, chunk, sums,
        [&] { return transmittance[0] >= limit || transmittance[1] >= limit; }, visit);
}

// Calls visit(kernel, width of its slots).
template <class Visit>
void choose(const Raster& r, Visit visit) {
    with_primitive<float>(r.surfels.axes, [&](auto primitive) {
        using P = typename decltype(primitive)::type;
        const int channels = r.contributions.channels;
        if (channels <= 1) return visit(contribute_kernel<P, 1>, Sums::kChannels + 1);
        if (channels <= 13) return visit(contribute_kernel<P, 13>, Sums::kChannels + 13);
        visit(contribute_kernel<P, TEXGS_MAX_CHANNELS>, Sums::kChannels + TEXGS_MAX_CHANNELS);
    });
}

}  // namespace

int contribute_slot_width(const Raster& r) {
    int found = 0;
    choose(r, [&](auto, int width) { found = width; });
    return found;
}

void contribute(const Raster& r, cudaStream_t stream) {
    choose(r, [&](auto kernel, int) { launch(kernel, r.tiles, kThreads, stream, r); });
    sum_slots(r, Sums::kLargest, stream);
    surfel_contributions(r, stream);
}

}  // namespace texgs::cuda
