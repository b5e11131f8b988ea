// SPDX-License-Identifier: Apache-2.0
// The hash encoding on CPUs: levels in parallel, each with rows of its own, so that gradients need no atomics and have
// the same bits for any number of threads.
#include <algorithm>

#include "../status.h"
#include "dispatch.h"
#include "hash_kernels.h"
#include "parallel.h"

namespace texgs {
namespace {

constexpr int64_t kPointRange = 8192;
constexpr int32_t kLevels = 32;

const HashKernels& hash_kernels() {
#if defined(__x86_64__) || defined(_M_X64)
    if (active_isa() == Isa::avx512) return avx512::kHashKernels;
    if (active_isa() == Isa::avx2) return avx2::kHashKernels;
#endif
    return portable::kHashKernels;
}

HashLevel level_of(const texgs_hash& hash, int64_t level, const float* points) {
    const int64_t side = int64_t(hash.resolution[level]) + 1, rows = hash.first[level + 1] - hash.first[level];
    return {hash.resolution[level], static_cast<uint32_t>(rows), side * side * side <= rows, points, nullptr, nullptr};
}

void check_hash(const texgs_hash& hash, int64_t n) {
    require(hash.levels >= 1 && hash.levels <= kLevels, "encoding: expected 1 to 32 levels");
    require(n >= 0, "points: expected none or more");
    for (int32_t i = 0; i < hash.levels; ++i) {
        require(hash.resolution[i] >= 1 && hash.resolution[i] < 1 << 20, "resolution: expected 1 to 2^20 - 1 cells");
        const int64_t rows = hash.first[i + 1] - hash.first[i];
        require(rows >= 8 && rows < int64_t(1) << 31, "encoding: expected 8 to 2^31 - 1 rows in each level");
        const bool shares = !level_of(hash, i, nullptr).is_dense;
        require(!shares || (rows & (rows - 1)) == 0, "encoding: expected a power of two of rows that are shared");
    }
}

}  // namespace
}  // namespace texgs

using namespace texgs;

int32_t texgs_hash_encode(const texgs_hash* hash, int64_t n, const float* points, const float* table, float* features,
                          void*) {
    return guarded([&] {
        check_hash(*hash, n);
        const int64_t ranges = (n + kPointRange - 1) / kPointRange;
        parallel_for(hash->levels * ranges, 1, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i) {
                const int64_t index = i / ranges, first = i % ranges * kPointRange;
                HashLevel level = level_of(*hash, index, points);
                level.table = table + 2 * hash->first[index];
                hash_kernels().encode(level, n, first, std::min(first + kPointRange, n), features + 2 * n * index);
            }
        });
    });
}

int32_t texgs_hash_backward(const texgs_hash* hash, int64_t n, const float* points, const float* grad_features,
                            float* gradient, void*) {
    return guarded([&] {
        check_hash(*hash, n);
        parallel_for(hash->levels, 1, [&](int64_t begin, int64_t end, int) {
            for (int64_t index = begin; index < end; ++index) {
                HashLevel level = level_of(*hash, index, points);
                level.gradient = gradient + 2 * hash->first[index];
                std::fill_n(level.gradient, 2 * int64_t(level.rows), 0.0f);
                hash_kernels().scatter(level, n, grad_features + 2 * n * index);
            }
        });
    });
}
