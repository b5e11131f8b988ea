// SPDX-License-Identifier: Apache-2.0
// Surfel tensors as the shared geometry takes them.
#pragma once
#include "maths.cuh"
#include "raster.cuh"

namespace texgs::cuda {
namespace {

__device__ inline Surfel<float> load_surfel(const texgs_surfels& s, int64_t i) {
    return {{s.means[3 * i], s.means[3 * i + 1], s.means[3 * i + 2]},
            s.quats[4 * i],
            s.quats[4 * i + 1],
            s.quats[4 * i + 2],
            s.quats[4 * i + 3],
            s.scales[2 * i],
            s.scales[2 * i + 1],
            s.opacities[i]};
}

}  // namespace
}  // namespace texgs::cuda
