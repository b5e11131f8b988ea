// SPDX-License-Identifier: Apache-2.0
// What the C interface of the voxel grid refuses before any work, the same in every library.
#pragma once
#include "status.h"
#include "texgs_grid.h"

namespace texgs {

inline void check_grid(const texgs_grid& g) {
    for (const int32_t side : g.size)
        require(side >= 8 && side <= 1024 && side % 4 == 0, "grid: expected multiples of 4 from 8 to 1024 voxels");
    require(g.spacing > 0, "spacing: expected above 0");
    require(g.degree >= 0 && g.degree <= 2, "grid: expected spherical harmonics of degree 0 to 2");
    require(g.n >= 1 && g.n < (int64_t(1) << 31), "grid: expected fewer than 2^31 rows, and one for no voxel");
}

inline void check_march(const texgs_march& m) {
    require(m.n >= 0 && m.n < (int64_t(1) << 31), "rays: expected fewer than 2^31");
    require(m.step >= 0.1f && m.step <= 8.0f, "step: expected 0.1 to 8 spacings of voxels");
    require(m.transmittance_min >= 0 && m.transmittance_min < 1, "transmittance_min: expected 0 to 1, without 1");
}

inline void check_rule(const texgs_rule& r) {
    require(r.beta1 >= 0 && r.beta1 < 1 && r.beta2 >= 0 && r.beta2 < 1, "betas: expected 0 to 1, without 1");
    require(r.epsilon > 0, "epsilon: expected above 0");
}

}  // namespace texgs
