// SPDX-License-Identifier: Apache-2.0
// From the gradients of samples to those of rows: the corners of all samples are sorted by row, and each row adds up
// its own, in the order of rays.
#include "grid.cuh"

namespace texgs::cuda {
namespace {

constexpr int kThreads = 256;

__device__ inline int64_t thread_index() { return int64_t(blockIdx.x) * kThreads + threadIdx.x; }

__global__ __launch_bounds__(kThreads) void list_kernel(const GridJob job, int64_t samples) {
    const int64_t i = thread_index();
    if (i >= samples) return;
    const Corners corners = corners_of(job.grid, unpack(job.samples[i].cell));
    for (int corner = 0; corner < 8; ++corner) {
        job.keys[8 * i + corner] = static_cast<uint32_t>(corners.row[corner]);
        job.values[8 * i + corner] = static_cast<uint32_t>(8 * i + corner);
    }
}

// Which of a sample's four gradients a float of a row has.
__device__ inline int channel_of(int lane) { return lane % 4 < 3 ? lane % 4 : lane == 3 ? 3 : lane / 4 - 1; }

__device__ inline float corner_weight(const GridSample& s, int corner) {
    const float x = corner & 4 ? s.f[0] : 1.0f - s.f[0], y = corner & 2 ? s.f[1] : 1.0f - s.f[1];
    return x * y * (corner & 1 ? s.f[2] : 1.0f - s.f[2]);
}

// A thread for each float of each row but the first.
template <int K>
__global__ __launch_bounds__(kThreads) void gather_kernel(const GridJob job) {
    const int64_t row = 1 + thread_index() / K;
    const int lane = static_cast<int>(threadIdx.x % K), channel = channel_of(lane);
    if (row >= job.grid.n) return;
    const uint32_t begin = job.row_begin[row], end = job.row_begin[row + 1];
    if (begin == end) return;
    float sum = 0.0f;
    for (uint32_t i = begin; i < end; ++i) {
        const uint32_t sample = job.values[i] / 8, corner = job.values[i] % 8;
        const GridSample& s = job.samples[sample];
        const float4 g = job.gradients[sample];
        const float own = channel == 0 ? g.x : channel == 1 ? g.y : channel == 2 ? g.z : channel == 3 ? g.w : 0.0f;
        sum = fma(corner_weight(s, corner) * own, job.basis[int64_t(s.ray) * K + lane], sum);
    }
    job.gradient[row * K + lane] += sum;
}

// Blocks are touched where one of their rows has samples.
__global__ __launch_bounds__(kThreads) void touch_kernel(const GridJob job, int64_t blocks) {
    for_blocks<kThreads>(blocks, [&](int64_t block) {
        const int32_t first = job.grid.first[block], count = popcount(job.grid.masks[block]);
        if (job.row_begin[first] != job.row_begin[first + count]) job.touched[block] = 1;
    });
}

__global__ __launch_bounds__(kThreads) void mark_kernel(const GridJob job, int64_t samples) {
    const int64_t i = thread_index();
    if (i >= samples) return;
    const Corners corners = corners_of(job.grid, unpack(job.samples[i].cell));
    auto* weights = reinterpret_cast<int32_t*>(job.row_weight);  // positive ones are ordered as the floats are
    for (int corner = 0; corner < 8; ++corner)
        if (corners.row[corner]) atomicMax(weights + corners.row[corner], __float_as_int(job.samples[i].weight));
}

}  // namespace

void list_corners(const GridJob& job, int64_t samples, cudaStream_t stream) {
    launch(list_kernel, blocks_for(samples, kThreads), kThreads, stream, job, samples);
}

void gather_rows(const GridJob& job, cudaStream_t stream) {
    const int floats = floats_of(job.grid);
    const auto kernel = floats == 32 ? gather_kernel<32> : floats == 16 ? gather_kernel<16> : gather_kernel<4>;
    launch(kernel, blocks_for((job.grid.n - 1) * floats, kThreads), kThreads, stream, job);
    const int64_t blocks = block_count(job.grid);
    launch(touch_kernel, blocks_for(blocks, kBytes * kThreads), kThreads, stream, job, blocks);
}

void mark_rows(const GridJob& job, int64_t samples, cudaStream_t stream) {
    launch(mark_kernel, blocks_for(samples, kThreads), kThreads, stream, job, samples);
}

}  // namespace texgs::cuda
