// SPDX-License-Identifier: Apache-2.0
// Where a sparse voxel grid can show anything, a thread for each block: cells with a density above 0 at a corner, and
// how far they are away.
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

// Chebyshev distance, one axis after the other: the least over a line of the larger of the distance along it and the
// distance so far.
__global__ __launch_bounds__(kThreads) void distance_kernel(Blocks blocks, const uint64_t* occupied,
                                                            const uint8_t* from, uint8_t* to, int axis) {
    for_blocks<kThreads>(blocks.count(), [&](int64_t i) {
        const int own = blocks.place(i, axis);
        const int64_t stride = blocks.stride(axis), line = i - own * stride;
        int least = kFar;
        for (int k = 0; k < blocks.side[axis]; ++k) {
            const int so_far = from ? from[line + k * stride] : occupied[line + k * stride] ? 0 : kFar;
            const int along = k < own ? own - k : k - own, larger = along > so_far ? along : so_far;
            least = larger < least ? larger : least;
        }
        to[i] = static_cast<uint8_t>(least);
    });
}

}  // namespace

void occupy(const texgs_grid& grid, uint64_t* occupied, uint8_t* distance, uint64_t* scratch, cudaStream_t stream) {
    const Blocks blocks{{grid.size[0] / 4, grid.size[1] / 4, grid.size[2] / 4}};
    const int64_t threads = blocks_for(blocks.count(), kThreads);
    launch(dense_kernel, threads, kThreads, stream, grid, blocks, scratch);
    launch(spread_kernel, threads, kThreads, stream, blocks, scratch, occupied, 2);
    launch(spread_kernel, threads, kThreads, stream, blocks, occupied, scratch, 1);
    launch(spread_kernel, threads, kThreads, stream, blocks, scratch, occupied, 0);
    auto* other = reinterpret_cast<uint8_t*>(scratch);
    const uint8_t* none = nullptr;
    const int64_t fewer = blocks_for(blocks.count(), kBytes * kThreads);
    launch(distance_kernel, fewer, kThreads, stream, blocks, occupied, none, distance, 2);
    launch(distance_kernel, fewer, kThreads, stream, blocks, occupied, distance, other, 1);
    launch(distance_kernel, fewer, kThreads, stream, blocks, occupied, other, distance, 0);
}

}  // namespace texgs::cuda
