// SPDX-License-Identifier: Apache-2.0
// Stable sorting as CUB offers it. Which of the two buffers ends up with the result is up to chance, as it is up to
// CUB.
#pragma once
#include <cuda_runtime.h>

namespace emulation {
cudaError_t sort_pairs(void* scratch, size_t& bytes, uint32_t* keys[2], uint32_t* values[2], int& selector, int64_t n,
                       int begin_bit, int end_bit, cudaStream_t);
}

namespace cub {

template <class T>
struct DoubleBuffer {
    T* d_buffers[2] = {};
    int selector = 0;
    DoubleBuffer() = default;
    DoubleBuffer(T* current, T* alternate) : d_buffers{current, alternate} {}
    T* Current() const { return d_buffers[selector]; }
    T* Alternate() const { return d_buffers[selector ^ 1]; }
};

struct DeviceRadixSort {
    static cudaError_t SortPairs(void* scratch, size_t& bytes, DoubleBuffer<uint32_t>& keys,
                                 DoubleBuffer<uint32_t>& values, int64_t n, int begin_bit = 0, int end_bit = 32,
                                 cudaStream_t stream = nullptr) {
        int selector = 0;
        uint32_t *k[2] = {keys.Current(), keys.Alternate()}, *v[2] = {values.Current(), values.Alternate()};
        const cudaError_t status = emulation::sort_pairs(scratch, bytes, k, v, selector, n, begin_bit, end_bit, stream);
        keys.selector ^= selector, values.selector ^= selector;
        return status;
    }
};

}  // namespace cub
