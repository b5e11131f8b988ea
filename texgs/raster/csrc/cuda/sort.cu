// SPDX-License-Identifier: Apache-2.0
#include "sort.cuh"

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

namespace texgs::cuda {

size_t sort_bytes(int64_t n) {
    cub::DoubleBuffer<uint32_t> keys, values;
    size_t bytes = 0;
    check(cub::DeviceRadixSort::SortPairs(nullptr, bytes, keys, values, n), "preparing to sort");
    return bytes;
}

void sort_pairs(PingPong& keys, PingPong& values, int64_t n, int bits, void* scratch, cudaStream_t stream) {
    cub::DoubleBuffer<uint32_t> k(keys.current, keys.other), v(values.current, values.other);
    size_t bytes = sort_bytes(n);
    check(cub::DeviceRadixSort::SortPairs(scratch, bytes, k, v, n, 0, bits, stream), "sorting");
    keys = {k.Current(), k.Alternate()};
    values = {v.Current(), v.Alternate()};
}

size_t prefix_sums_bytes(int64_t n) {
    size_t bytes = 0;
    uint64_t* none = nullptr;
    check(cub::DeviceScan::ExclusiveSum(nullptr, bytes, none, none, n), "preparing prefix sums");
    return bytes;
}

void prefix_sums(uint64_t* values, int64_t n, void* scratch, cudaStream_t stream) {
    size_t bytes = prefix_sums_bytes(n);
    check(cub::DeviceScan::ExclusiveSum(scratch, bytes, values, values, n, stream), "prefix sums");
}

}  // namespace texgs::cuda
