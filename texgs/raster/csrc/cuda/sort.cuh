// SPDX-License-Identifier: Apache-2.0
// Sorting and prefix sums of arrays on the device.
#pragma once
#include "device.cuh"

namespace texgs::cuda {

// Two arrays that a sort goes back and forth between; `current` holds the input, then the result.
struct PingPong {
    uint32_t *current, *other;
};

// Stable sort of n keys by their lowest `bits`, with a value each. `scratch` has sort_bytes(n).
size_t sort_bytes(int64_t n);
void sort_pairs(PingPong& keys, PingPong& values, int64_t n, int bits, void* scratch, cudaStream_t);

// Exclusive prefix sums in place. `scratch` has prefix_sums_bytes(n).
size_t prefix_sums_bytes(int64_t n);
void prefix_sums(uint64_t* values, int64_t n, void* scratch, cudaStream_t);

}  // namespace texgs::cuda
