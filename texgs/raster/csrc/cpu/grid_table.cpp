// SPDX-License-Identifier: Apache-2.0
// The voxel grid's kernels of one instruction set.
#include "grid_kernels.h"

namespace texgs::TEXGS_ISA {

const GridKernels kGridKernels = {
    march_rays, place_records, scatter_records, mark_records, step_blocks, total_variation_blocks,
};

}  // namespace texgs::TEXGS_ISA
