// SPDX-License-Identifier: Apache-2.0
// Bilateral smoothness of an attribute map, with its gradient:
//     alpha exp(-g(grey)) g(attribute),  g = |d/dx| + |d/dy| by Sobel's 3x3 kernels, zeros outside the image.
//
// One block per tile. The gradient of a pixel needs the edges of its neighbours, and those the values of theirs: shared
// planes hold two more rows and columns on every side.
#include "../checks.h"
#include "../texgs_losses.h"
#include "maths.cuh"
#include "workspace.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 256;
constexpr float kSobelSum = 8.0f;  // what the sums of Sobel's kernels are of a derivative
constexpr int kWidth = 32, kHeight = 16, kHalo = 2;
constexpr int kColumns = kWidth + 2 * kHalo, kRows = kHeight + 2 * kHalo;
using Plane = float[kRows][kColumns];

struct Job {
    const float *attribute, *guide, *alpha;
    int channels, height, width;
    float scale;  // derivative of the value by one pixel's term
    double* sums;
    float* gradient;

    __device__ int64_t pixels() const { return int64_t(height) * width; }
};

// Calls body(row, column, index, inside) for the shared planes' places but `margin` of them on every side; `index` is
// that of the pixel, `inside` whether there is one.
template <class Body>
__device__ void for_places(const Job& job, int margin, Body body) {
    const int tiles = (job.width + kWidth - 1) / kWidth;
    const int left = static_cast<int>(blockIdx.x % tiles) * kWidth,
              top = static_cast<int>(blockIdx.x / tiles) * kHeight;
    const int columns = kColumns - 2 * margin, rows = kRows - 2 * margin;
    for (int i = threadIdx.x; i < columns * rows; i += kBlock) {
        const int row = margin + i / columns, column = margin + i % columns;
        const int x = left - kHalo + column, y = top - kHalo + row;
        body(row, column, int64_t(y) * job.width + x, x >= 0 && y >= 0 && x < job.width && y < job.height);
    }
}

struct Edge {
    float x, y;
    __device__ float size() const { return abs(x) + abs(y); }
};
// Sobel's sums, kSobelSum times the derivatives.
__device__ inline Edge sobel(const Plane& p, int row, int c) {
    const auto across = [&](int k) { return fma(2.0f, p[row][k], p[row - 1][k] + p[row + 1][k]); };
    const auto along = [&](int k) { return fma(2.0f, p[k][c], p[k][c - 1] + p[k][c + 1]); };
    return {across(c + 1) - across(c - 1), along(row + 1) - along(row - 1)};
}

__device__ inline float sign(float a) { return static_cast<float>((a > 0.0f) - (a < 0.0f)); }

__global__ __launch_bounds__(kBlock) void smoothness_kernel(const Job job) {
    __shared__ Plane values, weight, edge_x, edge_y;  // edges: weight times the sign of the derivatives
    const int64_t plane = job.pixels();
    for_places(job, 0, [&](int row, int c, int64_t i, bool inside) {
        const float* guide = job.guide + i;
        values[row][c] = inside ? (guide[0] + guide[plane] + guide[2 * plane]) * (1.0f / 3.0f) : 0.0f;
    });
    __syncthreads();
    for_places(job, 1, [&](int row, int c, int64_t i, bool inside) {
        weight[row][c] = inside ? job.alpha[i] * exp2f(-1.44269504f / kSobelSum * sobel(values, row, c).size()) : 0.0f;
    });
    double total = 0.0;
    for (int channel = 0; channel < job.channels; ++channel) {
        __syncthreads();
        for_places(job, 0, [&](int row, int c, int64_t i, bool inside) {
            values[row][c] = inside ? job.attribute[channel * plane + i] : 0.0f;
        });
        __syncthreads();
        for_places(job, 1, [&](int row, int c, int64_t, bool) {
            const Edge edge = sobel(values, row, c);
            edge_x[row][c] = weight[row][c] * sign(edge.x), edge_y[row][c] = weight[row][c] * sign(edge.y);
        });
        __syncthreads();
        for_places(job, kHalo, [&](int row, int c, int64_t i, bool inside) {
            if (!inside) return;
            total += weight[row][c] * sobel(values, row, c).size();
            // The adjoint of the Sobel derivatives: the same kernels, turned by half a turn.
            if (job.gradient)
                job.gradient[channel * plane + i] = -job.scale * (sobel(edge_x, row, c).x + sobel(edge_y, row, c).y);
        });
    }
    total = block_sum<kBlock>(total);
    if (threadIdx.x == 0) job.sums[blockIdx.x] = total;
}

}  // namespace
}  // namespace texgs::cuda

using namespace texgs;
using namespace texgs::cuda;

int32_t texgs_bilateral_smoothness(const float* attribute, const float* guide, const float* alpha, int32_t channels,
                                   int32_t height, int32_t width, float weight, float* value, float* gradient,
                                   void* on) {
    return with_workspace(attribute, on, [&](Workspace& workspace, cudaStream_t stream) {
        check_image(channels, height, width);
        const double n = kSobelSum * static_cast<double>(channels) * height * width;
        const int64_t blocks = blocks_for(width, kWidth) * blocks_for(height, kHeight);
        double* sums = workspace.sums.ensure<double>(blocks);
        launch(smoothness_kernel, blocks, kBlock, stream,
               Job{attribute, guide, alpha, channels, height, width, static_cast<float>(weight / n), sums, gradient});
        finish_sum(sums, blocks, 1, 0.0, weight / n, value, stream);
    });
}
