// SPDX-License-Identifier: Apache-2.0
// Sums over the lanes of a warp, always in the same order.
#pragma once
#include "device.cuh"

namespace texgs::cuda {
namespace {

__device__ inline int lane_index() { return threadIdx.x % kWarp; }

// One step of sum16: lanes exchange half of the values they still hold with a partner, and keep sums of the other half.
template <int Half>
__device__ __forceinline__ void exchange(float (&v)[16]) {
    const bool upper = lane_index() & (2 * Half);
#pragma unroll
    for (int i = 0; i < Half; ++i) {
        const float sent = upper ? v[i] : v[i + Half];
        v[i] = (upper ? v[i + Half] : v[i]) + __shfl_xor_sync(kAllLanes, sent, 2 * Half);
    }
}

// Sums sixteen values over the warp; lane l receives the sum of value l / 2. It takes 16 shuffles instead of the 80 of
// one value at a time.
__device__ __forceinline__ float sum16(float (&v)[16]) {
    exchange<8>(v), exchange<4>(v), exchange<2>(v), exchange<1>(v);
    return v[0] + __shfl_xor_sync(kAllLanes, v[0], 1);
}

__device__ inline float warp_max(float a) {
#pragma unroll
    for (int step = kWarp / 2; step >= 1; step /= 2) a = fmaxf(a, __shfl_xor_sync(kAllLanes, a, step));
    return a;
}

template <class T>
__device__ inline T warp_sum(T a) {
#pragma unroll
    for (int step = kWarp / 2; step >= 1; step /= 2) a += __shfl_xor_sync(kAllLanes, a, step);
    return a;
}

}  // namespace
}  // namespace texgs::cuda
