// SPDX-License-Identifier: Apache-2.0
// Part of a tile's surfels in shared memory.
#pragma once
#include "fragment.cuh"
#include "texture.cuh"

namespace texgs::cuda {
namespace {

struct Pair {
    uint32_t surfel, slot, mask;
};

// C is at least the number of channels; the rest of them are zero.
template <int Size, int C, bool Textured>
struct Chunk {
    Record records[Size];
    uint32_t masks[Size];  // 0 beyond the surfels staged
    uint32_t slots[Size];
    float channels[Size * C];
    TextureTable textures[Textured ? Size : 1];

    // Fills the places from find(place), n of them, with `used` channels. Barriers must precede and follow.
    template <class Find>
    __device__ void stage(const Raster& r, int n, int used, Find find) {
        constexpr int kSharers = kThreads / Size;  // threads that fill a place
        const int place = threadIdx.x / kSharers, share = threadIdx.x % kSharers;
        const Pair pair = place < n ? find(place) : Pair{0, 0, 0};
        if (share == 0) masks[place] = pair.mask, slots[place] = pair.slot;
        if (!pair.mask) return;
        copy_record(r, pair.surfel, place, share, kSharers);
        copy_channels(r, pair.surfel, place, share, kSharers, used);
        if constexpr (Textured)
            if (share == 0) textures[place] = TextureTable(r.surfels, pair.surfel);
    }

    // Which of the places first to first + 31 reach the blocks of `quadrant`, as bits.
    __device__ uint32_t reach(int first, uint32_t quadrant) const {
        return __ballot_sync(kAllLanes, (masks[first + lane_index()] & quadrant) != 0);
    }

private:
    __device__ void copy_record(const Raster& r, int64_t surfel, int place, int share, int sharers) {
        static_assert(sizeof(Record) == 4 * sizeof(float4));
        const float4* from = reinterpret_cast<const float4*>(r.records + surfel);
        for (int k = share; k < 4; k += sharers) reinterpret_cast<float4*>(records + place)[k] = from[k];
    }
    __device__ void copy_channels(const Raster& r, int64_t surfel, int place, int share, int sharers, int used) {
        const int own = r.surfels.channels, textured = r.surfels.base ? 3 : 0;
        for (int c = share; c < C; c += sharers) {
            float value = 0.0f;
            if (c < textured)
                value = r.surfels.base[3 * surfel + c];
            else if (c < own)
                value = r.surfels.features[surfel * (own - textured) + c - textured];
            else if (c < used)
                value = r.normals[3 * surfel + c - own];
            channels[place * C + c] = value;
        }
    }
};

// Pairs of a tile's list, from place `begin` on.
struct FromList {
    const Raster& r;
    uint32_t begin;
    __device__ Pair operator()(int place) const {
        const uint32_t slot = r.tile_slots[begin + place];
        const Listed pair = r.listed[slot];
        return {pair.surfel, slot, pair.mask};
    }
};

}  // namespace
}  // namespace texgs::cuda
