// SPDX-License-Identifier: Apache-2.0
// What CUB does for the kernels: sorting and prefix sums, with scratch memory and two buffers to go between.
#include <algorithm>
#include <numeric>
#include <vector>

#include "emulation.h"

namespace emulation {
namespace {

// As CUB: without scratch memory, only says how much is needed.
bool only_asked(const void* scratch, size_t& bytes, int64_t n) {
    const size_t needed = 256 + static_cast<size_t>(n);
    if (!scratch) bytes = needed;
    if (bytes < needed) throw Failure("scratch memory for fewer numbers than there are");
    return !scratch;
}

void spoil(void* scratch, size_t bytes) {
    require_allocated(scratch, bytes, "scratch is");
    mark_unwritten(scratch, bytes);
}

struct Item {
    uint32_t key, value;
    bool written;  // the value
};

void sort(const uint32_t* keys, const uint32_t* values, uint32_t* keys_out, uint32_t* values_out, size_t n,
          uint32_t mask) {
    std::vector<Item> items(n);
    for (size_t i = 0; i < n; ++i) {
        if (!is_written(keys + i)) throw Failure("sorting keys that nothing wrote");
        items[i] = {keys[i], values[i], is_written(values + i)};
    }
    std::stable_sort(items.begin(), items.end(),
                     [mask](const Item& a, const Item& b) { return (a.key & mask) < (b.key & mask); });
    for (size_t i = 0; i < n; ++i) {
        keys_out[i] = items[i].key, values_out[i] = items[i].value;
        mark_written(keys_out + i, sizeof *keys_out);
        if (items[i].written)
            mark_written(values_out + i, sizeof *values_out);
        else
            mark_unwritten(values_out + i, sizeof *values_out);
    }
}

}  // namespace

cudaError_t sort_pairs(void* scratch, size_t& bytes, uint32_t* keys[2], uint32_t* values[2], int& selector, int64_t n,
                       int begin_bit, int end_bit, cudaStream_t stream) {
    if (only_asked(scratch, bytes, n)) return cudaSuccess;
    selector = static_cast<int>(chance(2));
    const auto mask = static_cast<uint32_t>((uint64_t(1) << end_bit) - (uint64_t(1) << begin_bit));
    enqueue(stream, [=, keys = std::vector(keys, keys + 2), values = std::vector(values, values + 2), to = selector,
                     bytes = bytes] {
        const auto count = static_cast<size_t>(n), size = count * sizeof(uint32_t);
        for (uint32_t* buffer : {keys[0], keys[1], values[0], values[1]}) require_allocated(buffer, size, "sorting");
        spoil(scratch, bytes);
        sort(keys[0], values[0], keys[to], values[to], count, mask);
        mark_unwritten(keys[1 - to], size), mark_unwritten(values[1 - to], size);
    });
    return cudaGetLastError();
}

cudaError_t prefix_sums(void* scratch, size_t& bytes, const uint64_t* in, uint64_t* out, int64_t n,
                        cudaStream_t stream) {
    if (only_asked(scratch, bytes, n)) return cudaSuccess;
    enqueue(stream, [=, bytes = bytes] {
        require_allocated(in, static_cast<size_t>(n) * sizeof *in, "summing");
        require_allocated(out, static_cast<size_t>(n) * sizeof *out, "summing");
        spoil(scratch, bytes);
        for (int64_t i = 0; i < n; ++i)
            if (!is_written(in + i)) throw Failure("summing numbers that nothing wrote");
        std::exclusive_scan(in, in + n, out, uint64_t(0));
        mark_written(out, static_cast<size_t>(n) * sizeof *out);
    });
    return cudaGetLastError();
}

}  // namespace emulation
