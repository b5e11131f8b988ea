/* SPDX-License-Identifier: Apache-2.0
 *
 * Losses and per-surfel shading; the conventions are those of texgs.h. A loss and its gradients come from one call:
 * the gradients are those of the value, for the caller to scale. `value` is a single float (on the device, for CUDA).
 */
#ifndef TEXGS_LOSSES_H
#define TEXGS_LOSSES_H
#include "texgs.h"

#ifdef __cplusplus
extern "C" {
#endif

/* value = l1_weight * mean |image - target| + dssim_weight * (1 - mean SSIM), over [C, H, W]. SSIM has a Gaussian
 * window of 11 x 11 pixels, sigma 1.5, and zeros outside the image. `gradient`: [C, H, W] or NULL. */
TEXGS_API int32_t texgs_l1_dssim(const float* image, const float* target, int32_t channels, int32_t height,
                                 int32_t width, float l1_weight, float dssim_weight, float* value, float* gradient,
                                 void* stream);

/* World normals [3, H, W] of the surface that a depth map [H, W] samples, from central differences; they face the
 * camera. 0 at the border of the image and where one of the four neighbours has no depth (0 or less). */
TEXGS_API int32_t texgs_depth_to_normal(const float* depth, const float* viewmat, const float* K, int32_t height,
                                        int32_t width, float* normal, void* stream);
TEXGS_API int32_t texgs_depth_to_normal_backward(const float* depth, const float* viewmat, const float* K,
                                                 int32_t height, int32_t width, const float* grad_normal,
                                                 float* grad_depth, void* stream);
/* value = weight * mean (1 - alpha * normal . depth_to_normal(depth)); gradients may be NULL, alpha has none. */
TEXGS_API int32_t texgs_normal_consistency(const float* normal, const float* depth, const float* alpha,
                                           const float* viewmat, const float* K, int32_t height, int32_t width,
                                           float weight, float* value, float* grad_normal, float* grad_depth,
                                           void* stream);

/* value = weight * mean over [C, H, W] of alpha * exp(-g(grey guide)) * g(attribute), g = |d/dx| + |d/dy| by Sobel's
 * kernels, zeros outside the image; grey is the mean of the three planes of `guide`. `gradient`: [C, H, W] of the
 * attribute, or NULL. */
TEXGS_API int32_t texgs_bilateral_smoothness(const float* attribute, const float* guide, const float* alpha,
                                             int32_t channels, int32_t height, int32_t width, float weight,
                                             float* value, float* gradient, void* stream);

/* Which parameters of a Blinn-Phong material are one number for all surfels ([1]) instead of one each ([N]). */
enum { TEXGS_SHARED_AMBIENT = 1, TEXGS_SHARED_DIFFUSE = 2, TEXGS_SHARED_SPECULAR = 4, TEXGS_SHARED_SHININESS = 8 };

/* gain = ambient + diffuse |n.l|, shaded = gain * color + specular |n.h|^shininess, n the surfel's normal, l the
 * direction to the light (`light` [3], any length, or NULL for a headlight), h halfway between it and the direction v
 * to the camera. With `facing` not 0, n is turned towards the camera, and its side alone is lit:
 * gain = ambient + diffuse max(n.l, 0), and the highlight max(n.h, 0)^shininess is there only where n.l > 0. With
 * `clamped` not 0, shaded is clamped to 0 and 1. `gain` may be NULL. */
TEXGS_API int32_t texgs_blinn_phong(int64_t n, const float* color, const float* ambient, const float* diffuse,
                                    const float* specular, const float* shininess, int32_t shared, const float* means,
                                    const float* quats, const float* camera_position, const float* light,
                                    int32_t facing, int32_t clamped, float* shaded, float* gain, void* stream);
/* A gradient of a shared parameter is one number. `ranges` [4, 2], on the host, or NULL: of parameters that are
 * low + span * sigmoid(number), low and span; the gradient is that of the number. Others have span 0. Outputs and
 * `grad_gain` may be NULL. */
TEXGS_API int32_t texgs_blinn_phong_backward(int64_t n, const float* color, const float* ambient, const float* diffuse,
                                             const float* specular, const float* shininess, int32_t shared,
                                             const float* means, const float* quats, const float* camera_position,
                                             const float* light, int32_t facing, int32_t clamped, const float* ranges,
                                             const float* grad_shaded, const float* grad_gain, float* grad_color,
                                             float* grad_ambient, float* grad_diffuse, float* grad_specular,
                                             float* grad_shininess, float* grad_means, float* grad_quats, void* stream);

/* color [N, 3] = max(0, 0.5 + sum_k Y_k(direction from the camera) sh[k]) for sh [N, (degree + 1)^2, 3]. */
TEXGS_API int32_t texgs_spherical_harmonics(int64_t n, int32_t degree, const float* sh, const float* means,
                                            const float* camera_position, float* color, void* stream);
/* `color` is the forward result: where it is 0 no gradient passes. Outputs may be NULL. */
TEXGS_API int32_t texgs_spherical_harmonics_backward(int64_t n, int32_t degree, const float* sh, const float* means,
                                                     const float* camera_position, const float* color,
                                                     const float* grad_color, float* grad_sh, float* grad_means,
                                                     void* stream);

#ifdef __cplusplus
}
#endif
#endif
