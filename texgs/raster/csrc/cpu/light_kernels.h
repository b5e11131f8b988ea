// SPDX-License-Identifier: Apache-2.0
// What light.cpp hands to the kernels of an instruction set, and the table of these.
#pragma once
#include "../light_maths.h"
#include "volume_kernels.h"

namespace texgs {

constexpr int kBand = 16;    // rows of columns that one worker follows at a time
constexpr int kMargin = 16;  // numbers behind a row that whole vectors may reach: the most lanes there are

struct ExtinctionJob {
    texgs_volume volume;  // the first; others have its lattice
    int32_t n;
    const CastChannel* channels;
    const uint8_t* distance;  // [bricks]
    float opacity_unit;
    const float* planes;  // [n_planes, 4]
    int32_t n_planes;
    texgs_cells cells;
    float* extinction;  // [z, y, x]
};

struct SweepJob {
    Columns columns;
    const float* matter;  // extinctions by slices w, [n_v + 2] rows and `stride` columns: zeros around all
    int64_t stride;
    float per_slice;  // edges along a column in a slice
    int32_t reach;    // slices whose matter counts
    float* sums;      // [w, v, u] of shares
};

struct LightLookupJob {
    texgs_cells cells;
    const uint8_t* light;
    const float* points;  // [n, 3]
    float* shares;        // [n, 2]
};

struct LightKernels {
    // Extinctions of the row (y, z) of cells.
    void (*extinction)(const ExtinctionJob&, int y, int z);
    // Follows columns of the rows [first, end), end before the last; adds their shares. `scratch`: `sweep_scratch`.
    void (*sweep)(const SweepJob&, int first, int end, float* scratch);
    // Looks the points [begin, end) up.
    void (*lookup)(const LightLookupJob&, int64_t begin, int64_t end);
};

// Numbers that a sweep needs: of each column, its extinctions up to a slice and up to its middle.
inline int64_t sweep_scratch(const Columns& columns) { return 2 * int64_t(kBand + 1) * (columns.wide + kMargin); }

namespace portable {
extern const LightKernels kLightKernels;
}
namespace avx2 {
extern const LightKernels kLightKernels;
}
namespace avx512 {
extern const LightKernels kLightKernels;
}

}  // namespace texgs
