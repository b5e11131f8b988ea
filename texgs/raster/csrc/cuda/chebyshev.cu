// SPDX-License-Identifier: Apache-2.0
#include "chebyshev.cuh"

namespace texgs::cuda {
namespace {

constexpr int kThreads = 128;
constexpr int kFarthest = 255;
constexpr int kBytes = 4;  // of a word, all written by one thread

struct Line {
    int64_t count, stride;  // between neighbours along the axis
    int side;               // places along it
};

// One axis after the other: the least over a line of the larger of the distance along it and the distance so far.
__global__ __launch_bounds__(kThreads) void line_kernel(Line lattice, const uint8_t* from, uint8_t* to) {
    const int64_t first = kBytes * (int64_t(blockIdx.x) * kThreads + threadIdx.x);
    for (int64_t i = first; i < first + kBytes && i < lattice.count; ++i) {
        const int own = static_cast<int>(i / lattice.stride % lattice.side);
        const int64_t line = i - own * lattice.stride;
        int least = kFarthest;
        for (int k = 0; k < lattice.side; ++k) {
            const int so_far = from[line + k * lattice.stride], along = k < own ? own - k : k - own;
            const int larger = along > so_far ? along : so_far;
            least = larger < least ? larger : least;
        }
        to[i] = static_cast<uint8_t>(least);
    }
}

}  // namespace

void spread_distances(const int (&sides)[3], uint8_t* shown, uint8_t* distance, cudaStream_t stream) {
    const int64_t count = int64_t(sides[0]) * sides[1] * sides[2];
    const int64_t strides[3] = {int64_t(sides[1]) * sides[2], sides[2], 1};
    const int64_t threads = blocks_for(count, kBytes * kThreads);
    launch(line_kernel, threads, kThreads, stream, Line{count, strides[2], sides[2]}, shown, distance);
    launch(line_kernel, threads, kThreads, stream, Line{count, strides[1], sides[1]}, distance, shown);
    launch(line_kernel, threads, kThreads, stream, Line{count, strides[0], sides[0]}, shown, distance);
}

}  // namespace texgs::cuda
