// SPDX-License-Identifier: Apache-2.0
// Shares of light at places in cells.
#pragma once
#include "simd.h"

#include "../volume_maths.h"

namespace texgs::TEXGS_ISA {
namespace {

struct Shares {
    vf lamp, sky;  // in 255ths
};

// Shares at places that are counted in cells from the first centre.
TEXGS_INLINE Shares shares_at(const uint8_t* light, const int32_t (&size)[3], const vf (&at)[3]) {
    vf inside[3];
    const int32_t stride[3] = {2, 2 * size[0], 2 * size[0] * size[1]};  // bytes
    vi first = splat(0);
    for (int a = 0; a < 3; ++a) {
        const vf last = static_cast<float>(size[a] - 1), place = min(max(at[a], 0.0f), last);
        const vf cell = min(floor(place), last - vf(1.0f));
        inside[a] = place - cell;
        first = first + truncate(cell) * splat(stride[a]);
    }
    vf lamp[4], sky[4];  // of the four rows of a cell's corners
    for (int i = 0; i < 4; ++i) {
        const vi bytes = gather_bytes(light, first + splat((i & 1) * stride[1] + (i >> 1) * stride[2]));
        const vi byte = splat(255);
        lamp[i] = mix(to_float(bytes & byte), to_float((bytes >> 16) & byte), inside[0]);
        sky[i] = mix(to_float((bytes >> 8) & byte), to_float((bytes >> 24) & byte), inside[0]);
    }
    return {mix(mix(lamp[0], lamp[1], inside[1]), mix(lamp[2], lamp[3], inside[1]), inside[2]),
            mix(mix(sky[0], sky[1], inside[1]), mix(sky[2], sky[3], inside[1]), inside[2])};
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
