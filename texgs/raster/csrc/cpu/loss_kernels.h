// SPDX-License-Identifier: Apache-2.0
// What losses.cpp and fit.cpp hand to the kernels of an instruction set, and the table of those kernels.
#pragma once
#include <cstdint>

#include "../texgs_fit.h"
#include "../texgs_losses.h"

namespace texgs {

// Image losses work on tiles of this size at most. It is fixed, so that sums do not depend on the number of threads.
constexpr int kLossTileWidth = 256;
constexpr int kLossTileHeight = 144;
constexpr float kSobelSum = 8.0f;  // what the sums of Sobel's kernels are of a derivative

// Columns [x0, x1) and rows [y0, y1) of one plane.
struct LossTile {
    int plane, x0, x1, y0, y1;
};

struct SsimJob {
    const float *image, *target;  // [C, H, W]
    int height, width;
    float l1_scale, dssim_scale;  // derivative of the value by one pixel's |difference| and 1 - SSIM
    float* gradient;              // [C, H, W] or null
};
struct SsimSums {
    double l1, dssim;
};

struct NormalJob {
    const float *depth, *viewmat, *K;
    int height, width;
    const float *normal, *alpha;    // consistency: [3, H, W] and [H, W]
    const float* upstream;          // depth_to_normal backward: [3, H, W]
    float scale;                    // consistency: derivative of the value by one pixel's term
    float *out_normal, *out_depth;  // normals or their gradient; gradient of the depth
};

struct SmoothnessJob {
    const float *attribute, *guide, *alpha;
    int channels, height, width;
    float scale;      // derivative of the value by one pixel's term
    float* gradient;  // [C, H, W] or null
};

struct BlinnPhongJob {
    const float *color, *ambient, *diffuse, *specular, *shininess;
    int shared;  // TEXGS_SHARED_...
    const float *means, *quats, *camera_position, *light;
    bool facing, clamped;
    float *shaded, *gain;
    const float *grad_shaded, *grad_gain;
    float *grad_color, *grad_ambient, *grad_diffuse, *grad_specular, *grad_shininess, *grad_means, *grad_quats;
    const float* ranges;  // [4, 2] or null
};
// Sums over surfels of the gradients of ambient, diffuse, specular and shininess.
struct MaterialSums {
    double v[4];
};

struct HarmonicsJob {
    int degree;
    const float *sh, *means, *camera_position;
    float* color;
    const float *forward_color, *grad_color;
    float *grad_sh, *grad_means;
};

struct AdamJob {
    float take1, take2, epsilon;
};

struct SpheresJob {
    int axes;
    const float *means, *scales, *viewmat;
    float reach;
};
// See texgs_screen_bounds().
struct ScreenBounds {
    float nearest, left, right, top, bottom;
};

struct LossKernels {
    SsimSums (*ssim)(const SsimJob&, const LossTile&);
    void (*depth_to_normal)(const NormalJob&, int y0, int y1);
    void (*depth_to_normal_backward)(const NormalJob&, int y0, int y1);
    double (*normal_consistency)(const NormalJob&, int y0, int y1);  // sum of the agreement alpha n . n_depth
    double (*smoothness)(const SmoothnessJob&, const LossTile&);     // sum of the terms
    void (*blinn_phong)(const BlinnPhongJob&, int64_t begin, int64_t end);
    MaterialSums (*blinn_phong_backward)(const BlinnPhongJob&, int64_t begin, int64_t end);
    void (*harmonics)(const HarmonicsJob&, int64_t begin, int64_t end);
    void (*harmonics_backward)(const HarmonicsJob&, int64_t begin, int64_t end);
    void (*adam)(const AdamJob&, const texgs_learned&, int64_t begin, int64_t end);
    ScreenBounds (*screen_bounds)(const SpheresJob&, int64_t begin, int64_t end);
};
const LossKernels& loss_kernels();  // of the active instruction set

// One table per instruction set, each in loss_table.cpp.
namespace portable {
extern const LossKernels kLossKernels;
}
namespace avx2 {
extern const LossKernels kLossKernels;
}
namespace avx512 {
extern const LossKernels kLossKernels;
}

#ifdef TEXGS_ISA
namespace TEXGS_ISA {
SsimSums ssim_tile(const SsimJob&, const LossTile&);
void depth_to_normal_rows(const NormalJob&, int y0, int y1);
void depth_to_normal_backward_rows(const NormalJob&, int y0, int y1);
double normal_consistency_rows(const NormalJob&, int y0, int y1);
double smoothness_tile(const SmoothnessJob&, const LossTile&);
void blinn_phong_range(const BlinnPhongJob&, int64_t begin, int64_t end);
MaterialSums blinn_phong_backward_range(const BlinnPhongJob&, int64_t begin, int64_t end);
void harmonics_range(const HarmonicsJob&, int64_t begin, int64_t end);
void harmonics_backward_range(const HarmonicsJob&, int64_t begin, int64_t end);
void adam_range(const AdamJob&, const texgs_learned&, int64_t begin, int64_t end);
ScreenBounds screen_bounds_range(const SpheresJob&, int64_t begin, int64_t end);
}  // namespace TEXGS_ISA
#endif

}  // namespace texgs
