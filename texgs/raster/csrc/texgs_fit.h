/* SPDX-License-Identifier: Apache-2.0
 *
 * A step of a fit: where on screen something can be, the loss of a view with its gradients, and the step of Adam. The
 * conventions are those of texgs.h.
 */
#ifndef TEXGS_FIT_H
#define TEXGS_FIT_H
#include "texgs.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A parameter that learns. The structures themselves lie on the host. */
typedef struct {
    int64_t n; /* floats */
    float* values;
    const float* gradient;
    float* moments;   /* [2, n] running means of the gradient, first, and of its square, second */
    float keep;       /* by which values are multiplied before the step: 1 - decay */
    float rate;       /* learning rate / (1 - beta1^t), t the number of steps with this one */
    float correction; /* 1 / sqrt(1 - beta2^t) */
} texgs_learned;

/* A step of Adam with decoupled decay (Kingma and Ba 2015; Loshchilov and Hutter 2019), each parameter by itself:
 * first += take1 (g - first), second += take2 (g^2 - second),
 * value = keep value - rate first / (correction sqrt(second) + epsilon), with take = 1 - beta. */
TEXGS_API int32_t texgs_adam(int64_t n_parameters, const texgs_learned*, float take1, float take2, float epsilon,
                             void* stream);

/* Where a camera sees spheres around means [n, 3], of `reach` exp(largest of scales [n, axes]): bounds [5] are the
 * least camera z, and the least and largest x / z and y / z. The first is 0 or less, and the others void, where a
 * sphere reaches behind the camera or a value is not finite. */
TEXGS_API int32_t texgs_screen_bounds(int64_t n, int32_t axes, const float* means, const float* scales,
                                      const float* viewmat, float reach, float* bounds, void* stream);

/* Adds to sums [n] the length of gradients [n, 2] times `across` and `down`, and 1 to counts [n] where it is not 0. */
TEXGS_API int32_t texgs_observe(int64_t n, const float* gradient, float across, float down, float* sums, float* counts,
                                void* stream);

enum { TEXGS_COLORS = 3 }; /* channels that are colour; those behind them are attributes */

/* What a view should look like, and the weights of its losses. */
typedef struct {
    const float *color, *alpha; /* [3, H, W] and [H, W] */
    float l1, dssim;            /* of colour, and of alpha: */
    float alpha_l1, alpha_dssim;
    float normal;     /* of normal consistency */
    float smoothness; /* of bilateral smoothness of attributes */
} texgs_target;

/* Renders a view into `image` and writes the gradients of its losses into `grad`, which has the same memory, without
 * that of losses that do not count: of alpha, and of normal and depth. Then the gradients `out` of surfels, if not
 * NULL. values [4] are the losses times their weights, of colour, alpha, normals and attributes, where they count. */
TEXGS_API int32_t texgs_rendered_loss(const texgs_surfels*, const texgs_camera*, const texgs_options*,
                                      const texgs_image* image, const texgs_image* grad, const texgs_target*,
                                      const texgs_gradients* out, float* values, void* stream);

#ifdef __cplusplus
}
#endif
#endif
