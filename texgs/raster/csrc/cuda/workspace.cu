// SPDX-License-Identifier: Apache-2.0
#include "workspace.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 256;

// A single block, so that the order of the sum is fixed.
__global__ __launch_bounds__(kBlock) void finish_sum_kernel(const double* sums, int64_t n, int stride, double offset,
                                                            double scale, float* out) {
    double total = 0.0;
    for (int64_t i = threadIdx.x; i < n; i += kBlock) total += sums[i * stride];
    total = block_sum<kBlock>(total);
    if (threadIdx.x == 0) *out = static_cast<float>(offset + scale * total);
}

}  // namespace

void finish_sum(const double* sums, int64_t n, int stride, double offset, double scale, float* out,
                cudaStream_t stream) {
    launch(finish_sum_kernel, 1, kBlock, stream, sums, n, stride, offset, scale, out);
}

}  // namespace texgs::cuda
