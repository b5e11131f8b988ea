// SPDX-License-Identifier: Apache-2.0
#include "isa.h"
#include "kernels.h"

namespace texgs::TEXGS_ISA {
namespace {

int64_t scratch_bytes() {
    const int64_t sizes[] = {kForwardScratch, kBackwardScratch, kContributeScratch, kTextureScratch};
    int64_t most = 0;
    for (const int64_t size : sizes) most = size > most ? size : most;
    return most;
}

}  // namespace

extern const Kernels table;
const Kernels table = {
    .scratch_bytes = scratch_bytes,
    .project = project_surfels,
    .bin = bin_surfels,
    .forward = forward_tile,
    .backward = backward_tile,
    .reduce = reduce_gradients,
    .contribute = contribute_tile,
    .reduce_contributions = reduce_contributions,
    .texture_backward = texture_backward_tile,
    .reduce_textures = reduce_textures,
};

}  // namespace texgs::TEXGS_ISA
