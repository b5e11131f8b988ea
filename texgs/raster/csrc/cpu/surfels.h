// SPDX-License-Identifier: Apache-2.0
// Surfel tensors as vectors: a lane per surfel.
#pragma once
#include "kernels.h"
#include "simd.h"

#include "../maths.h"

namespace texgs::TEXGS_ISA {
namespace {

// What is blended of a surfel besides its normal, [N, surfels.channels].
inline const float* surfel_channels(const Raster& r) { return r.surfels.base ? r.surfels.base : r.surfels.features; }

// Lanes p[0], p[stride], ...; beyond n the last one is repeated.
inline vf load_strided(const float* p, int stride, int64_t n) {
    float lanes[kLanes];
    if (n >= kLanes)
        for (int i = 0; i < kLanes; ++i) lanes[i] = p[stride * i];
    else
        for (int i = 0; i < kLanes; ++i) lanes[i] = p[stride * (i < n ? i : n - 1)];
    return load(lanes);
}

inline Surfel<vf> load_surfels(const texgs_surfels& s, int64_t first, int64_t n) {
    const float *mean = s.means + 3 * first, *quat = s.quats + 4 * first, *scale = s.scales + 2 * first;
    return {{load_strided(mean, 3, n), load_strided(mean + 1, 3, n), load_strided(mean + 2, 3, n)},
            load_strided(quat, 4, n),
            load_strided(quat + 1, 4, n),
            load_strided(quat + 2, 4, n),
            load_strided(quat + 3, 4, n),
            load_strided(scale, 2, n),
            load_strided(scale + 1, 2, n),
            load_strided(s.opacities + first, 1, n)};
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
