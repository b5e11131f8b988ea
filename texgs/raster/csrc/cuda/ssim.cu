// SPDX-License-Identifier: Apache-2.0
// L1 and D-SSIM with the gradient. The first kernel compares windows and leaves the derivatives of each, the second
// gathers a pixel's gradient from the windows that hold it.
//
// With the sum p = x + y and the difference d = x - y of image and target, their blurs mp, md and the variances vp, vd,
// the two factors of SSIM (Wang et al. 2004) are
//     r = (A - a) / (A + a),  A = mp^2 / 2 + C1,  a = md^2 / 2      (luminance)
//     q = (B - b) / (B + b),  B = vp / 2 + C2,    b = vd / 2        (contrast and structure),
// so that 1 - r q = 2 (A b + a B) / ((A + a) (B + b)). This takes four blurs instead of five, does not cancel where
// the images are alike, and is exactly 0, with a gradient of exactly 0, where d = 0 all over the window: tiles in which
// the images do not differ are skipped. Variances are those of p - 1, which for values in [0, 1] loses less to
// cancellation; the zeros outside the image are then -1.
#include "../checks.h"
#include "../texgs_losses.h"
#include "workspace.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 256;
constexpr int kRadius = 5, kWidth = 32, kHeight = 16;
constexpr int kColumns = kWidth + 2 * kRadius, kRows = kHeight + 2 * kRadius;  // of a tile with its halo
constexpr float kC1 = 0.01f * 0.01f, kC2 = 0.03f * 0.03f;
// exp(-k^2 / (2 1.5^2)), k = 0 to 5, normalised over the window.
__constant__ const float kWindow[kRadius + 1] = {0.266011725f,  0.213005538f,   0.10936069f,
                                                 0.0360007721f, 0.00759875814f, 0.00102838008f};

using Plane = float[kRows][kColumns];
using Strip = float[kRows][kWidth];  // blurred along rows

struct Job {
    const float *image, *target;  // [C, H, W]
    int channels, height, width;
    float l1_scale, dssim_scale;  // derivative of the value by one pixel's |difference| and 1 - SSIM
    double* sums;                 // [tiles] of the value
    float* derivatives;           // [3, C, H, W] of 1 - SSIM by the means together, by the square of p - 1, of d
    float* gradient;              // [C, H, W] or null

    __device__ int64_t size() const { return int64_t(channels) * height * width; }
};

struct Tile {
    int x, y;
    int64_t plane;  // index of the channel's first pixel

    __device__ explicit Tile(const Job& job) {
        const int columns = (job.width + kWidth - 1) / kWidth, rows = (job.height + kHeight - 1) / kHeight;
        const int tile = static_cast<int>(blockIdx.x);
        x = tile % columns * kWidth, y = tile / columns % rows * kHeight;
        plane = int64_t(tile / (columns * rows)) * job.height * job.width;
    }
    // Calls body(row, column, index, inside) for all places of the tile and its halo.
    template <class Body>
    __device__ void for_places(const Job& job, Body body) const {
        for (int i = threadIdx.x; i < kRows * kColumns; i += kBlock) {
            const int row = i / kColumns, column = i % kColumns;
            const int px = x - kRadius + column, py = y - kRadius + row;
            const bool inside = px >= 0 && py >= 0 && px < job.width && py < job.height;
            body(row, column, plane + int64_t(py) * job.width + px, inside);
        }
    }
    // Calls body(row, column, index) for the tile's own pixels; row and column count from the halo's.
    template <class Body>
    __device__ void for_pixels(const Job& job, Body body) const {
        for (int i = threadIdx.x; i < kHeight * kWidth; i += kBlock) {
            const int row = i / kWidth, column = i % kWidth;
            if (x + column < job.width && y + row < job.height)
                body(row, column, plane + int64_t(y + row) * job.width + x + column);
        }
    }
};

// value(k) for k = -5 to 5, weighted by the window.
template <class Value>
__device__ float blur(Value value) {
    float total = kWindow[0] * value(0);
#pragma unroll
    for (int k = 1; k <= kRadius; ++k) total = fmaf(kWindow[k], value(-k) + value(k), total);
    return total;
}

// Blurs each row of a tile: places of the strip are sums over value(row, column).
template <class Value>
__device__ void blur_rows(Strip& strip, Value value) {
    for (int i = threadIdx.x; i < kRows * kWidth; i += kBlock) {
        const int row = i / kWidth, column = i % kWidth;
        strip[row][column] = blur([&](int k) { return value(row, column + kRadius + k); });
    }
}
__device__ float blur_column(const Strip& strip, int row, int column) {
    return blur([&](int k) { return strip[row + kRadius + k][column]; });
}

struct Comparison {
    float dissimilarity, by_means, by_pp, by_dd;

    // From the blurs of p - 1, its square, d, its square.
    __device__ Comparison(float shifted, float pp, float md, float dd) {
        const float mp = shifted + 1.0f;
        const float A = fmaf(0.5f * mp, mp, kC1), a = 0.5f * md * md;
        const float B = fmaf(0.5f, fmaf(-shifted, shifted, pp), kC2), b = 0.5f * fmaf(-md, md, dd);
        const float over_A = 1.0f / (A + a), over_B = 1.0f / (B + b);
        const float r = (A - a) * over_A, q = (B - b) * over_B;
        const float r_B = r * over_B * over_B;         // by the blur of (p - 1)^2: -b r_B, of d^2: B r_B
        const float q_A = 2.0f * q * over_A * over_A;  // by A: -a q_A, by a: A q_A
        by_pp = -(b * r_B), by_dd = B * r_B;
        by_means = -(a * q_A * mp + 2.0f * by_pp * shifted) + (A * q_A - 2.0f * by_dd) * md;
        dissimilarity = 2.0f * fmaf(A, b, a * B) * over_A * over_B;
    }
};

__global__ __launch_bounds__(kBlock) void compare_kernel(const Job job) {
    __shared__ Plane p, d;
    __shared__ Strip blurred[4];
    const Tile tile(job);
    const int64_t size = job.size();
    bool differs = false;
    tile.for_places(job, [&](int row, int column, int64_t i, bool inside) {
        const float image = inside ? job.image[i] : 0.0f, target = inside ? job.target[i] : 0.0f;
        p[row][column] = image + target - 1.0f, d[row][column] = image - target;
        differs |= !(image - target == 0.0f);  // NaN differs
    });
    differs = __syncthreads_or(differs);
    if (differs) {
        blur_rows(blurred[0], [&](int row, int c) { return p[row][c]; });
        blur_rows(blurred[1], [&](int row, int c) { return p[row][c] * p[row][c]; });
        blur_rows(blurred[2], [&](int row, int c) { return d[row][c]; });
        blur_rows(blurred[3], [&](int row, int c) { return d[row][c] * d[row][c]; });
    }
    __syncthreads();
    float value = 0.0f;
    tile.for_pixels(job, [&](int row, int column, int64_t i) {
        float by_means = 0.0f, by_pp = 0.0f, by_dd = 0.0f;
        if (differs) {
            const Comparison c(blur_column(blurred[0], row, column), blur_column(blurred[1], row, column),
                               blur_column(blurred[2], row, column), blur_column(blurred[3], row, column));
            value = fmaf(job.l1_scale, fabsf(d[row + kRadius][column + kRadius]), value);
            value = fmaf(job.dssim_scale, c.dissimilarity, value);
            by_means = c.by_means, by_pp = c.by_pp, by_dd = c.by_dd;
        }
        if (!job.gradient) return;
        job.derivatives[i] = by_means, job.derivatives[i + size] = by_pp, job.derivatives[i + 2 * size] = by_dd;
    });
    const double sum = block_sum<kBlock>(value);
    if (threadIdx.x == 0) job.sums[blockIdx.x] = sum;
}

__global__ __launch_bounds__(kBlock) void differentiate_kernel(const Job job) {
    __shared__ Plane plane;
    __shared__ Strip blurred[3];
    const Tile tile(job);
    const int64_t size = job.size();
    for (int k = 0; k < 3; ++k) {
        __syncthreads();
        tile.for_places(job, [&](int row, int column, int64_t i, bool inside) {
            plane[row][column] = inside ? job.derivatives[i + k * size] : 0.0f;
        });
        __syncthreads();
        blur_rows(blurred[k], [&](int row, int c) { return plane[row][c]; });
    }
    __syncthreads();
    tile.for_pixels(job, [&](int row, int column, int64_t i) {
        const float image = job.image[i], target = job.target[i];
        const float p = image + target - 1.0f, d = image - target;
        const float by_pp = blur_column(blurred[1], row, column), by_dd = blur_column(blurred[2], row, column);
        const float outer = fmaf(2.0f, fmaf(p, by_pp, d * by_dd), blur_column(blurred[0], row, column));
        const float sign = static_cast<float>((d > 0.0f) - (d < 0.0f));
        job.gradient[i] = fmaf(job.dssim_scale, outer, job.l1_scale * sign);
    });
}

}  // namespace
}  // namespace texgs::cuda

using namespace texgs;
using namespace texgs::cuda;

int32_t texgs_l1_dssim(const float* image, const float* target, int32_t channels, int32_t height, int32_t width,
                       float l1_weight, float dssim_weight, float* value, float* gradient, void* on) {
    return with_workspace(image, on, [&](Workspace& workspace, cudaStream_t stream) {
        check_image(channels, height, width);
        const int64_t n = int64_t(channels) * height * width;
        const int64_t tiles = blocks_for(width, kWidth) * blocks_for(height, kHeight) * channels;
        double* sums = workspace.sums.ensure<double>(tiles);
        const Job job{image,
                      target,
                      channels,
                      height,
                      width,
                      l1_weight / static_cast<float>(n),
                      dssim_weight / static_cast<float>(n),
                      sums,
                      gradient ? workspace.planes.ensure<float>(3 * n) : nullptr,
                      gradient};
        launch(compare_kernel, tiles, kBlock, stream, job);
        if (gradient) launch(differentiate_kernel, tiles, kBlock, stream, job);
        finish_sum(sums, tiles, 1, 0.0, 1.0, value, stream);
    });
}
