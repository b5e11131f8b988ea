// SPDX-License-Identifier: Apache-2.0
// Shares of light at places in cells.
#pragma once
#include "volume.cuh"

namespace texgs::cuda {
namespace {

struct Shares {
    float lamp, sky;  // in 255ths
};

// Shares at a place that is counted in cells from the first centre.
__device__ inline Shares shares_at(const uint8_t* light, const int32_t (&size)[3], const float (&at)[3]) {
    float last[3], lamp[8], sky[8];
    for (int a = 0; a < 3; ++a) last[a] = static_cast<float>(size[a] - 1);
    const Spot spot(last, at);
    for (int i = 0; i < 8; ++i) {
        const int x = spot.cell[0] + (i & 1), y = spot.cell[1] + (i >> 1 & 1), z = spot.cell[2] + (i >> 2);
        const uint8_t* both = light + 2 * ((int64_t(z) * size[1] + y) * size[0] + x);
        lamp[i] = both[0], sky[i] = both[1];
    }
    return {trilinear(lamp, spot.inside), trilinear(sky, spot.inside)};
}

}  // namespace
}  // namespace texgs::cuda
