// SPDX-License-Identifier: Apache-2.0
// Sums over a tile's pixels for each of its surfels, put into the pairs' slots: no atomics, always the same order.
//
// Every warp sums over its own pixels and leaves the result in shared memory; when a chunk is done, its threads add
// the four warps' sums and store them.
#pragma once
#include "chunk.cuh"

namespace texgs::cuda {
namespace {

constexpr int kSlotChunk = 32;  // surfels between two stores

template <int Width>
struct SlotSums {
    static constexpr int kGroups = (Width + 15) / 16;
    float sums[kWarps][kSlotChunk][Width];
    uint32_t summed[kWarps];  // places with a sum, as bits

    // Called by whole warps, whose lanes bring their values for a place.
    __device__ __forceinline__ void add(int place, const float (&values)[Width]) {
        const int warp = threadIdx.x / kWarp, lane = lane_index();
#pragma unroll
        for (int group = 0; group < kGroups; ++group) {
            float v[16];
#pragma unroll
            for (int i = 0; i < 16; ++i) v[i] = 16 * group + i < Width ? values[16 * group + i] : 0.0f;
            const float sum = sum16(v);
            const int k = 16 * group + lane / 2;
            if (lane % 2 == 0 && k < Width) sums[warp][place][k] = sum;
        }
        if (lane == 0) summed[warp] |= 1u << place;
    }

    // The sum of all warps for number k of a place; of number `maximum` the largest.
    __device__ float total(int place, int k, int maximum) const {
        float total = 0.0f;
#pragma unroll
        for (int warp = 0; warp < kWarps; ++warp) {
            if (!(summed[warp] >> place & 1)) continue;
            const float sum = sums[warp][place][k];
            total = k == maximum ? fmaxf(total, sum) : total + sum;
        }
        return total;
    }

    // Called by all threads between barriers.
    template <class Chunk>
    __device__ void store(const Chunk& chunk, int n, int maximum, float* slots) const {
        for (int i = threadIdx.x; i < n * Width; i += kThreads) {
            const int place = i / Width, k = i % Width;
            slots[int64_t(chunk.slots[place]) * Width + k] = total(place, k, maximum);
        }
    }
    __device__ void clear() {
        if (threadIdx.x < kWarps) summed[threadIdx.x] = 0;
    }
};

// Walks a tile's list front to back: visit(place) in whole warps for the places of the chunk that reach the warp, as
// long as alive() holds for one of its lanes; slots of all pairs are stored, with zeros where nothing was visited.
template <int Width, class Chunk, class Alive, class Visit>
__device__ void for_pairs(const Raster& r, int tile, int used, int maximum, const Place& place, Chunk& chunk,
                          SlotSums<Width>& sums, Alive alive, Visit visit) {
    const uint32_t end = r.tile_begin[tile + 1];
    bool active = true;
    for (uint32_t begin = r.tile_begin[tile]; begin < end; begin += kSlotChunk) {
        const int n = static_cast<int>(min(end - begin, uint32_t(kSlotChunk)));
        const bool any = __syncthreads_or(active);
        sums.clear();
        if (any) {
            chunk.stage(r, n, used, FromList{r, begin});
        } else {
            if (static_cast<int>(threadIdx.x) < n) chunk.slots[threadIdx.x] = r.tile_slots[begin + threadIdx.x];
        }
        __syncthreads();
        if (active) {
            for (uint32_t hits = chunk.reach(0, place.quadrant()); hits; hits &= hits - 1)
                visit(__ffs(static_cast<int>(hits)) - 1);
            active = __any_sync(kAllLanes, alive());
        }
        __syncthreads();
        sums.store(chunk, n, maximum, r.slots);
    }
}

}  // namespace
}  // namespace texgs::cuda
