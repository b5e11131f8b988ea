// SPDX-License-Identifier: Apache-2.0
// Vectors of values in the table of a transfer function.
#pragma once
#include "simd.h"

#include "../volume_maths.h"
#include "volume_kernels.h"

namespace texgs::TEXGS_ISA {
namespace {

// The intervals of a transfer function that values are in, and how far.
struct Intervals {
    bool is_short;  // the table fits in registers
    vi first;       // points
    vf place;

    TEXGS_INLINE Intervals(const CastTable& t, vf value) : is_short(t.length == kTablePoints) {
        vf passed = 0.0f;
        for (int step = t.length / 2; step; step /= 2) {
            const vf next = passed + vf(static_cast<float>(step));
            passed = select(at(t.value, truncate(next)) <= value, next, passed);
        }
        first = truncate(min(passed, static_cast<float>(t.n - 2)));
        place = (value - at(t.value, first)) * at(t.per_width, first);
    }
    TEXGS_INLINE vf at(const float* column, vi point) const {
        return is_short ? table_lookup<1>(column, point) : gather(column, point);
    }
    TEXGS_INLINE vf mixed(const float* column) const {
        return mix(at(column, first), at(column, first + splat(1)), place);
    }
};

}  // namespace
}  // namespace texgs::TEXGS_ISA
