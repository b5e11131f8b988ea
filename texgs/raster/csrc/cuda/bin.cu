// SPDX-License-Identifier: Apache-2.0
// Which tiles surfels reach, and which blocks there: one warp per surfel tests two tiles at a time, a lane per block.
// The same walk counts first and lists then.
#include "blocks.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 128;

// Calls visit(tile, mask) in lanes 0 and 16 for the surfel's tiles two by two; a mask may be 0. `visit` gets the masks
// of both to know its place.
template <class Visit>
__device__ void for_tiles(const Raster& r, const Footprint& foot, Visit visit) {
    const int lane = threadIdx.x % kWarp, half = lane / 16;
    const int columns = foot.x1 - foot.x0, tiles = columns * (foot.y1 - foot.y0);
    const BlockTest test(foot);
    for (int first = 0; first < tiles; first += 2) {
        const int index = first + half, x = foot.x0 + index % columns, y = foot.y0 + index / columns;
        const bool hit =
            index < tiles && test.reaches(lane % 16, static_cast<float>(x * kTile), static_cast<float>(y * kTile));
        const uint32_t both = __ballot_sync(kAllLanes, hit);
        visit(static_cast<uint32_t>(y * r.tiles_x + x), both & 0xffffu, both >> 16);
    }
}

__global__ __launch_bounds__(kBlock) void count_kernel(const Raster r) {
    const int64_t rank = (int64_t(blockIdx.x) * kBlock + threadIdx.x) / kWarp;
    if (rank > r.surfels.n) return;
    uint64_t count = 0;
    if (rank < r.surfels.n)
        for_tiles(r, r.footprints[r.order[rank]],
                  [&](uint32_t, uint32_t first, uint32_t second) { count += (first != 0) + (second != 0); });
    if (threadIdx.x % kWarp == 0) r.pair_begin[rank] = count;
}

// Surfels whose slots do not all fit are left out as a whole: from the first such rank on, none is listed.
__global__ __launch_bounds__(kBlock) void list_kernel(const Raster r, uint32_t* tiles, uint32_t* slots) {
    const int64_t rank = (int64_t(blockIdx.x) * kBlock + threadIdx.x) / kWarp;
    if (rank >= r.surfels.n || r.pair_begin[rank + 1] > static_cast<uint64_t>(r.capacity)) return;
    const uint32_t surfel = r.order[rank];
    const int lane = threadIdx.x % kWarp;
    uint64_t next = r.pair_begin[rank];
    for_tiles(r, r.footprints[surfel], [&](uint32_t tile, uint32_t first, uint32_t second) {
        const uint32_t mask = lane < 16 ? first : second;
        if (lane % 16 == 0 && mask) {
            const uint64_t slot = next + (lane == 16 && first != 0);
            r.listed[slot] = {surfel, mask};
            tiles[slot] = tile;
            slots[slot] = static_cast<uint32_t>(slot);
        }
        next += (first != 0) + (second != 0);
    });
}

__global__ __launch_bounds__(kBlock) void find_tiles_kernel(const uint32_t* sorted_tiles, int64_t n, uint32_t tiles,
                                                            uint32_t* tile_begin) {
    const uint32_t tile = blockIdx.x * kBlock + threadIdx.x;
    if (tile <= tiles) tile_begin[tile] = static_cast<uint32_t>(lower_bound(sorted_tiles, n, tile));
}

// Keys that sort the tiles by their numbers of pairs, most first, and the tiles as they come.
__global__ __launch_bounds__(kBlock) void key_tiles_kernel(const Raster r, uint32_t* keys, uint32_t* order) {
    const int tile = blockIdx.x * kBlock + threadIdx.x;
    if (tile >= r.tiles) return;
    keys[tile] = ~(r.tile_begin[tile + 1] - r.tile_begin[tile]);
    order[tile] = static_cast<uint32_t>(tile);
}

}  // namespace

void count_pairs(const Raster& r, cudaStream_t stream) {
    launch(count_kernel, blocks_for(r.surfels.n + 1, kBlock / kWarp), kBlock, stream, r);
}

void list_pairs(const Raster& r, uint32_t* tiles, uint32_t* slots, cudaStream_t stream) {
    launch(list_kernel, blocks_for(r.surfels.n, kBlock / kWarp), kBlock, stream, r, tiles, slots);
}

void find_tiles(const uint32_t* sorted_tiles, int64_t n, int tiles, uint32_t* tile_begin, cudaStream_t stream) {
    launch(find_tiles_kernel, blocks_for(tiles + 1, kBlock), kBlock, stream, sorted_tiles, n,
           static_cast<uint32_t>(tiles), tile_begin);
}

void key_tiles(const Raster& r, uint32_t* keys, uint32_t* order, cudaStream_t stream) {
    launch(key_tiles_kernel, blocks_for(r.tiles, kBlock), kBlock, stream, r, keys, order);
}

}  // namespace texgs::cuda
