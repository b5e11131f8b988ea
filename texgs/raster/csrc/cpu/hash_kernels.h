// SPDX-License-Identifier: Apache-2.0
// What hash.cpp hands to the kernels of an instruction set, and the table of those kernels.
#pragma once
#include <cstdint>

#include "../texgs_neural.h"

namespace texgs {

// One level of an encoding.
struct HashLevel {
    int32_t resolution;
    uint32_t rows;
    bool is_dense;        // a row for each lattice point
    const float* points;  // [n, 3]
    const float* table;   // [rows, 2]
    float* gradient;      // [rows, 2]
};

struct HashKernels {
    // Writes features [2, n] of points [begin, end), whose planes are n apart.
    void (*encode)(const HashLevel&, int64_t n, int64_t begin, int64_t end, float* features);
    // Adds to the gradient of the rows from that of features [2, n].
    void (*scatter)(const HashLevel&, int64_t n, const float* grad_features);
};

// One table per instruction set, each in hash_level.cpp.
namespace portable {
extern const HashKernels kHashKernels;
}
namespace avx2 {
extern const HashKernels kHashKernels;
}
namespace avx512 {
extern const HashKernels kHashKernels;
}

}  // namespace texgs
