// SPDX-License-Identifier: Apache-2.0
// Where a sparse voxel grid can show anything, a thread for each block: cells with a density above 0 at a corner, and
// how far they are away.
#include "chebyshev.cuh"
#include "grid.cuh"

namespace texgs::cuda {
namespace {

constexpr int kThreads = 128;
constexpr int kFar = 255;

struct Blocks {
    int side[3];
    __host__ __device__ int64_t count() const { return int64_t(side[0]) * side[1] * side[2]; }
    __device__ int64_t stride(int axis) const { return axis == 2 ? 1 : axis == 1 ? side[2] : side[1] * side[2]; }
    __device__ int place(int64_t i, int axis) const { return static_cast<int>(i / stride(axis) % side[axis]); }
};

__device__ inline int64_t thread_index() { return int64_t(blockIdx.x) * kThreads + threadIdx.x; }

// One bit per voxel: its density is above 0.
__global__ __launch_bounds__(kThreads) void dense_kernel(const texgs_grid grid, Blocks blocks, uint64_t* dense) {
    const int64_t i = thread_index();
    if (i >= blocks.count()) return;
    uint64_t occupied = 0;
    const float* density = grid.density + grid.first[i];
    for (int bit = 0; bit < kBlockSide * kBlockSide * kBlockSide; ++bit)
        if (grid.masks[i] >> bit & 1) occupied |= uint64_t(*density++ > 0.0f) << bit;
    dense[i] = occupied;
}

// Blocks of voxels, and the same moved by one towards lower x, y or z, in one.
__global__ __launch_bounds__(kThreads) void spread_kernel(Blocks blocks, const uint64_t* from, uint64_t* to, int axis) {
    const int64_t i = thread_index();
    if (i >= blocks.count()) return;
    const uint64_t next = blocks.place(i, axis) + 1 < blocks.side[axis] ? from[i + blocks.stride(axis)] : 0;
    const int shift = axis == 0 ? 16 : axis == 1 ? 4 : 1;
    const uint64_t last = axis == 0 ? 0xffff000000000000u : axis == 1 ? 0xf000f000f000f000u : 0x8888888888888888u;
    to[i] = from[i] | (from[i] >> shift & ~last) | (next << 3 * shift & last);
}

// 0 where a block can show anything, else the farthest.
__global__ __launch_bounds__(kThreads) void shown_kernel(Blocks blocks, const uint64_t* occupied, uint8_t* shown) {
    for_blocks<kThreads>(blocks.count(), [&](int64_t i) { shown[i] = occupied[i] ? 0 : kFar; });
}

}  // namespace

void occupy(const texgs_grid& grid, uint64_t* occupied, uint8_t* distance, uint64_t* scratch, cudaStream_t stream) {
    const Blocks blocks{{grid.size[0] / 4, grid.size[1] / 4, grid.size[2] / 4}};
    const int64_t threads = blocks_for(blocks.count(), kThreads);
    launch(dense_kernel, threads, kThreads, stream, grid, blocks, scratch);
    launch(spread_kernel, threads, kThreads, stream, blocks, scratch, occupied, 2);
    launch(spread_kernel, threads, kThreads, stream, blocks, occupied, scratch, 1);
    launch(spread_kernel, threads, kThreads, stream, blocks, scratch, occupied, 0);
    auto* shown = reinterpret_cast<uint8_t*>(scratch);
    launch(shown_kernel, blocks_for(blocks.count(), kBytes * kThreads), kThreads, stream, blocks, occupied, shown);
    spread_distances(blocks.side, shown, distance, stream);
}

}  // namespace texgs::cuda
