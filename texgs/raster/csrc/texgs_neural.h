/* SPDX-License-Identifier: Apache-2.0
 *
 * What networks need besides a matrix product: points along rays and their hash encoding (Mueller et al. 2022) for
 * fields, convolutions for features of images. In libtexgs alone; the conventions are those of texgs.h.
 */
#ifndef TEXGS_NEURAL_H
#define TEXGS_NEURAL_H
#include "texgs_grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How many samples the rays of texgs_grid_render() had. */
TEXGS_API int64_t texgs_grid_count(const texgs_grid_samples*);
/* Their world positions, points [count, 3], ray by ray and front to back; how many each ray has, lengths [n rays]. */
TEXGS_API int32_t texgs_grid_points(texgs_grid_samples*, const texgs_grid*, const texgs_march*, float* points,
                                    int32_t* lengths, void* stream);

/* Lattices over the unit cube, one a level. Level l has resolution[l] cells along each side, and the rows first[l] to
 * first[l + 1] of a table [rows, 2]: one for each lattice point, x fastest, or where these are too many a power of two,
 * which lattice points share by their hash. */
typedef struct {
    int32_t levels;
    const int32_t* resolution; /* [levels] */
    const int64_t* first;      /* [levels + 1] */
} texgs_hash;

/* features [levels, 2, n]: rows of the table, trilinear between lattice points, at points [n, 3] of the unit cube. */
TEXGS_API int32_t texgs_hash_encode(const texgs_hash*, int64_t n, const float* points, const float* table,
                                    float* features, void* stream);
/* gradient [rows, 2] of the table from grad_features [levels, 2, n]. */
TEXGS_API int32_t texgs_hash_backward(const texgs_hash*, int64_t n, const float* points, const float* grad_features,
                                      float* gradient, void* stream);

/* 3x3 kernels, for convolutions of images with zeros around them. Channels: multiples of 16. */
typedef struct {
    int32_t width, height;
    int32_t inputs, outputs;
    const float* kernel;  /* [36, outputs / 16, inputs, 16]: G g G^T of each 3x3 kernel g (Lavin and Gray 2016) */
    const float* bias;    /* [outputs], or null for 0 */
    int32_t is_rectified; /* negative results are 0 */
} texgs_convolution;

/* result [height, width, outputs], at an address that 64 divides, of an image [height, width, inputs]. Where a gate
 * [height, width, inputs] is 0 or less, the image counts as 0; null: nowhere. */
TEXGS_API int32_t texgs_convolve(const texgs_convolution*, const float* image, const float* gate, float* result,
                                 void* stream);

#ifdef __cplusplus
}
#endif
#endif
