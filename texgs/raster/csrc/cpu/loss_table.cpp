// SPDX-License-Identifier: Apache-2.0
// The loss, shading and fit kernels of one instruction set.
#include "loss_kernels.h"

namespace texgs::TEXGS_ISA {

const LossKernels kLossKernels = {
    ssim_tile,
    depth_to_normal_rows,
    depth_to_normal_backward_rows,
    normal_consistency_rows,
    smoothness_tile,
    blinn_phong_range,
    blinn_phong_backward_range,
    harmonics_range,
    harmonics_backward_range,
    adam_range,
    screen_bounds_range,
};

}  // namespace texgs::TEXGS_ISA
