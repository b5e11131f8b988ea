// SPDX-License-Identifier: Apache-2.0
// Tensors of surfels or 3D Gaussians as vectors: a lane for each.
#pragma once
#include "kernels.h"
#include "simd.h"

#include "../primitive.h"

namespace texgs::TEXGS_ISA {
namespace {

// Lanes p[0], p[stride], ...; beyond n the last one is repeated.
inline vf load_strided(const float* p, int stride, int64_t n) {
    float lanes[kLanes];
    if (n >= kLanes)
        for (int i = 0; i < kLanes; ++i) lanes[i] = p[stride * i];
    else
        for (int i = 0; i < kLanes; ++i) lanes[i] = p[stride * (i < n ? i : n - 1)];
    return load(lanes);
}

template <class P>
P load_primitives(const texgs_surfels& s, int64_t first, int64_t n) {
    const float *mean = s.means + 3 * first, *quat = s.quats + 4 * first, *scale = s.scales + P::kScales * first;
    P p;
    p.mean = {load_strided(mean, 3, n), load_strided(mean + 1, 3, n), load_strided(mean + 2, 3, n)};
    for (int k = 0; k < 4; ++k) p.quat[k] = load_strided(quat + k, 4, n);
    for (int k = 0; k < P::kScales; ++k) p.scale[k] = load_strided(scale + k, P::kScales, n);
    p.opacity = load_strided(s.opacities + first, 1, n);
    if (s.raw) activate(p);
    return p;
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
