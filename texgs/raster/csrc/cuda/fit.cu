// SPDX-License-Identifier: Apache-2.0
// The step of Adam, all parameters in one launch; and the part of the screen that spheres can cover.
#include <algorithm>

#include "../rendered_loss.h"
#include "maths.cuh"
#include "workspace.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 256;
constexpr int kTable = 16;         // parameters in one launch
constexpr int64_t kBlocks = 1024;  // of spheres, at most
constexpr float kHuge = 1e18f;     // as on a CPU

struct Table {
    texgs_learned parameters[kTable];
    int n;
};

__global__ __launch_bounds__(kBlock) void adam_kernel(const Table table, float take1, float take2, float epsilon) {
    int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    int k = 0;
    while (k < table.n && i >= table.parameters[k].n) i -= table.parameters[k++].n;
    if (k == table.n) return;
    const texgs_learned& p = table.parameters[k];
    float *const m = p.moments + i, *const v = m + p.n;
    const float g = p.gradient[i], first = fma(take1, g - *m, *m), second = fma(take2, fma(g, g, -*v), *v);
    *m = first, *v = second;
    p.values[i] = fma(p.keep, p.values[i], -(p.rate * first / fma(p.correction, sqrt(second), epsilon)));
}

__global__ __launch_bounds__(kBlock) void observe_kernel(int64_t n, const float* gradient, float across, float down,
                                                         float* sums, float* counts) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= n) return;
    const float x = across * gradient[2 * i], y = down * gradient[2 * i + 1], length = sqrt(fma(x, x, y * y));
    sums[i] += length, counts[i] += length > 0.0f ? 1.0f : 0.0f;
}

// Nearest, left, -right, top, -bottom: the least of each counts.
struct Bounds {
    float v[5] = {kHuge, kHuge, kHuge, kHuge, kHuge};

    __device__ void include(const Bounds& other) {
        for (int k = 0; k < 5; ++k) v[k] = fminf(v[k], other.v[k]);
    }
};

__device__ Bounds sphere_bounds(const View& view, int axes, const float* mean, const float* scales, float reach) {
    float largest = scales[0];
    for (int k = 1; k < axes; ++k) largest = scales[k] <= largest ? largest : scales[k];
    reach *= exp(largest);
    const Vec3<float> p =
        rotate(view, Vec3<float>{mean[0], mean[1], mean[2]}) + Vec3<float>{view.t[0], view.t[1], view.t[2]};
    const float near = p.z - reach, far = p.z + reach;
    Bounds b;
    b.v[0] = near > 0.0f && abs(p.x) + abs(p.y) + far < kHuge ? near : 0.0f;
    b.v[1] = fminf((p.x - reach) / near, (p.x - reach) / far),
    b.v[2] = fminf(-(p.x + reach) / near, -(p.x + reach) / far);
    b.v[3] = fminf((p.y - reach) / near, (p.y - reach) / far),
    b.v[4] = fminf(-(p.y + reach) / near, -(p.y + reach) / far);
    return b;
}

// The bounds of a block, in thread 0.
__device__ Bounds block_bounds(Bounds b) {
    __shared__ float shared[kBlock / kWarp][5];
    for (int k = 0; k < 5; ++k) {
        const float least = -warp_max(-b.v[k]);
        if (lane_index() == 0) shared[threadIdx.x / kWarp][k] = least;
    }
    __syncthreads();
    if (threadIdx.x == 0)
        for (const auto& part : shared)
            for (int k = 0; k < 5; ++k) b.v[k] = fminf(b.v[k], part[k]);
    return b;
}

__global__ __launch_bounds__(kBlock) void spheres_kernel(int64_t n, int axes, const float* means, const float* scales,
                                                         const float* viewmat, float reach, Bounds* parts) {
    const View view = make_view(viewmat, viewmat);  // without a lens
    Bounds b;
    for (int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x; i < n; i += int64_t(gridDim.x) * kBlock)
        b.include(sphere_bounds(view, axes, means + 3 * i, scales + axes * i, reach));
    b = block_bounds(b);
    if (threadIdx.x == 0) parts[blockIdx.x] = b;
}

__global__ __launch_bounds__(kBlock) void gather_kernel(int64_t n, const Bounds* parts, float* bounds) {
    Bounds b;
    for (int64_t i = threadIdx.x; i < n; i += kBlock) b.include(parts[i]);
    b = block_bounds(b);
    if (threadIdx.x) return;
    for (int k = 0; k < 5; ++k) bounds[k] = k == 2 || k == 4 ? -b.v[k] : b.v[k];
}

}  // namespace
}  // namespace texgs::cuda

using namespace texgs;
using namespace texgs::cuda;

int32_t texgs_adam(int64_t n_parameters, const texgs_learned* parameters, float take1, float take2, float epsilon,
                   void* on) {
    const texgs_learned* const end = parameters + n_parameters;
    const texgs_learned* const some = std::find_if(parameters, end, [](const texgs_learned& p) { return p.n > 0; });
    if (some == end) return TEXGS_OK;  // memory of no elements may have no address
    return on_device_of(some->moments, on, [&](cudaStream_t stream) {
        for (int64_t begin = 0; begin < n_parameters; begin += kTable) {
            Table table{};
            int64_t floats = 0;
            for (int64_t k = begin; k < n_parameters && table.n < kTable; ++k)
                table.parameters[table.n++] = parameters[k], floats += parameters[k].n;
            launch(adam_kernel, blocks_for(floats, kBlock), kBlock, stream, table, take1, take2, epsilon);
        }
    });
}

int32_t texgs_screen_bounds(int64_t n, int32_t axes, const float* means, const float* scales, const float* viewmat,
                            float reach, float* bounds, void* on) {
    return with_workspace(viewmat, on, [&](Workspace& workspace, cudaStream_t stream) {
        require(n >= 1 && (axes == 2 || axes == 3), "spheres: expected at least one, of 2 or 3 scales");
        const int64_t blocks = blocks_for(n, kBlock) < kBlocks ? blocks_for(n, kBlock) : kBlocks;
        Bounds* parts = workspace.sums.ensure<Bounds>(blocks);
        launch(spheres_kernel, blocks, kBlock, stream, n, axes, means, scales, viewmat, reach, parts);
        const Bounds* from = parts;
        launch(gather_kernel, int64_t(1), kBlock, stream, blocks, from, bounds);
    });
}

int32_t texgs_observe(int64_t n, const float* gradient, float across, float down, float* sums, float* counts,
                      void* on) {
    if (n == 0) return TEXGS_OK;
    return on_device_of(sums, on, [&](cudaStream_t stream) {
        launch(observe_kernel, blocks_for(n, kBlock), kBlock, stream, n, gradient, across, down, sums, counts);
    });
}
