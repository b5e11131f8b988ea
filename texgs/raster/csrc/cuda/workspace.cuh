// SPDX-License-Identifier: Apache-2.0
// Scratch memory of a loss, and sums over thread blocks that do not depend on their order.
#pragma once
#include "../status.h"
#include "pool.cuh"
#include "warp.cuh"

namespace texgs::cuda {

struct Workspace {
    explicit Workspace(int device) : device(device) {}
    const int device;
    Mark last_use;
    Buffer sums, planes;
};

// Calls body(stream) on the device of `pointer`; errors become status codes.
template <class Body>
int32_t on_device_of(const void* pointer, void* stream, const Body& body) {
    return guarded([&] {
        const DeviceScope scope(device_of(pointer));
        body(static_cast<cudaStream_t>(stream));
    });
}

// The same for body(workspace, stream), with a workspace of its own.
template <class Body>
int32_t with_workspace(const void* pointer, void* stream, const Body& body) {
    return on_device_of(pointer, stream, [&](cudaStream_t on) {
        std::unique_ptr<Workspace> workspace = pool<Workspace>().take(device_of(pointer));
        {
            const Turn turn(workspace->last_use, on);
            body(*workspace, on);
        }
        pool<Workspace>().give(std::move(workspace));
    });
}

// *out = offset + scale * (sums[0] + sums[stride] + ...), n of them.
void finish_sum(const double* sums, int64_t n, int stride, double offset, double scale, float* out, cudaStream_t);

namespace {

// The sum over a block of `Threads` threads, in thread 0.
template <int Threads>
__device__ inline double block_sum(double a) {
    __shared__ double sums[Threads / kWarp];
    a = warp_sum(a);
    __syncthreads();
    if (lane_index() == 0) sums[threadIdx.x / kWarp] = a;
    __syncthreads();
    double total = 0.0;
    if (threadIdx.x == 0)
        for (const double sum : sums) total += sum;
    return total;
}

}  // namespace
}  // namespace texgs::cuda
