/* SPDX-License-Identifier: Apache-2.0
 *
 * A sparse grid of voxels with density and spherical harmonics (Plenoxels, Fridovich-Keil et al. 2022), rendered along
 * rays and differentiated; the conventions are those of texgs.h.
 *
 * Voxels are the points of a lattice. Blocks of 4 x 4 x 4 of them have a mask each, one bit a voxel; the row of a voxel
 * is that of its block's first one plus the number of bits below its own. So a grid of any size costs 21 bytes a block
 * and its rows. A point's density is max(0, trilinear density), its colour max(0, 0.5 + Y(direction) . trilinear
 * coefficients); voxels without a row have the first one. Nothing is outside of the lattice.
 *
 * A row has K = 4, 16 or 32 floats for degree 0, 1 or 2: quadruples (red, green, blue, extra), one a coefficient. The
 * extra of the first is the density; the ninth coefficient is in the extras of the second, third and fourth.
 */
#ifndef TEXGS_GRID_H
#define TEXGS_GRID_H
#include "texgs.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    int32_t size[3];          /* voxels along x, y and z: multiples of 4, 8 to 1024 */
    float lower[3];           /* world position of voxel (0, 0, 0) */
    float spacing;            /* of voxels, world units */
    int32_t degree;           /* of the spherical harmonics, 0 to 2 */
    int64_t n;                /* rows; the first is that of voxels without one, density 0 */
    const uint64_t* masks;    /* [B] voxels that have a row; blocks and bits in the order x, y, z, z fastest */
    const int32_t* first;     /* [B] row of a block's first voxel, 1 or more */
    const uint64_t* occupied; /* [B] cells, by their lowest corner, in which density can be above 0 */
    const uint8_t* distance;  /* [B] Chebyshev distance in blocks to the next block with such a cell; 0: itself */
    float* rows;              /* [n, K] */
    float* density;           /* [n] a copy of what the rows say, for marching */
} texgs_grid;

/* n rays, [n, 6]: origin and direction of any length, world units. */
typedef struct {
    int64_t n;
    const float* rays;
    float background[3];
    float step;              /* between samples along a ray, in spacings; 0.1 or more */
    float transmittance_min; /* a ray ends with the sample that leaves less; the rest of its light is background */
    /* [2, n] in lengths of the direction, or NULL: of a ray count the samples from the first on and before the second.
     */
    const float* depth_range;
} texgs_march;

/* Samples along rays: what rendering leaves for its gradients. */
typedef struct texgs_grid_samples texgs_grid_samples;

/* Writes `occupied` and `distance` of a grid from its masks and density. */
TEXGS_API int32_t texgs_grid_occupy(const texgs_grid*, uint64_t* occupied, uint8_t* distance, void* stream);

/* color [n, 3] with background, alpha [n], depth [n]: expected distance from the origin, 0 where alpha is 0. Outputs
 * may be NULL, and `samples` too where no gradient is wanted. */
TEXGS_API int32_t texgs_grid_render(const texgs_grid*, const texgs_march*, float* color, float* alpha, float* depth,
                                    texgs_grid_samples** samples, void* stream);
/* Adds to `gradient` [n, K], unlike other functions, and sets `touched` [B] where it did. */
TEXGS_API int32_t texgs_grid_backward(texgs_grid_samples*, const texgs_grid*, const texgs_march*,
                                      const float* grad_color, const float* grad_alpha, float* gradient,
                                      uint8_t* touched, void* stream);
/* weight [n] = max(weight, the largest blending weight of the samples in the cells around a voxel). */
TEXGS_API int32_t texgs_grid_mark(texgs_grid_samples*, const texgs_grid*, const texgs_march*, float* weight,
                                  void* stream);
TEXGS_API void texgs_grid_release(texgs_grid_samples*);

/* Adds the gradient of total variation over the voxels of some blocks (places in [B]): for every float of a row,
 * weight * sqrt(1e-9 + sum over x, y, z of (next voxel - voxel)^2), where a voxel without a row counts as equal. */
TEXGS_API int32_t texgs_grid_total_variation(const texgs_grid*, int64_t n_blocks, const int32_t* blocks,
                                             float weight_density, float weight_sh, float* gradient, uint8_t* touched,
                                             void* stream);

typedef struct {
    float rate_density, rate_base, rate_sh; /* learning rates: density, zeroth harmonic, the others */
    float beta1, beta2, epsilon;
} texgs_rule;

/* A step of a lazy optimiser: the rows with a gradient in touched blocks, and nothing else, move by
 * -rate * first / (sqrt(second) + epsilon) with first and second the running means of the gradient (beta1) and of its
 * square (beta2), both of which start at the first one. `first` NULL: the gradient itself (RMSProp). Writes rows and
 * density; leaves gradient and touched at zero. */
TEXGS_API int32_t texgs_grid_step(const texgs_grid*, const texgs_rule*, float* gradient, uint8_t* touched, float* first,
                                  float* second, void* stream);

#ifdef __cplusplus
}
#endif
#endif
