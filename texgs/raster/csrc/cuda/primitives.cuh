// SPDX-License-Identifier: Apache-2.0
// Surfels and 3D Gaussians as the shared geometry takes them.
#pragma once
#include "maths.cuh"
#include "raster.cuh"

namespace texgs::cuda {
namespace {

template <class P>
__device__ P load_primitive(const texgs_surfels& s, int64_t i) {
    P p;
    p.mean = {s.means[3 * i], s.means[3 * i + 1], s.means[3 * i + 2]};
    for (int k = 0; k < 4; ++k) p.quat[k] = s.quats[4 * i + k];
    for (int k = 0; k < P::kScales; ++k) p.scale[k] = s.scales[P::kScales * i + k];
    p.opacity = s.opacities[i];
    if (s.raw) activate(p);
    return p;
}

}  // namespace
}  // namespace texgs::cuda
