/* SPDX-License-Identifier: Apache-2.0
 *
 * Light inside of volumes: how much of it reaches a point, through what the transfer functions show. It is known at the
 * centres of cells, and trilinear between them. The conventions are those of texgs_volume.h; directions and planes are
 * in the memory of the host.
 */
#ifndef TEXGS_LIGHT_H
#define TEXGS_LIGHT_H
#include "texgs_volume.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TEXGS_LIGHT_SIDE = 256 }; /* cells along an axis, at most */

/* Cells that fill the box of a volume. */
typedef struct {
    int32_t size[3]; /* along x, y, z, at least 2 */
    float half[3];   /* half the box's sides, world units */
} texgs_cells;

/* The mean extinction of each cell, extinction [z, y, x]: the logarithm to base 2, negated, of the light that its
 * shortest edge lets through, over places in it that are no farther apart than samples are, up to eight along an axis;
 * at each of them at most 16. Places with n.x > offset for one of planes [n_planes, 4] of n and offset, at most
 * TEXGS_MAX_PLANES, show nothing; nor do bricks with a distance above 0. */
TEXGS_API int32_t texgs_extinction(const texgs_volume*, const texgs_transfer*, int32_t n, const uint8_t* distance,
                                   float opacity_unit, const float* planes, int32_t n_planes, const texgs_cells*,
                                   float* extinction, void* stream);

/* The share of a distant light that reaches the centre of each cell, in 255ths: the first of light [z, y, x, 2]. It
 * goes along columns that lie in the light's direction, from slice to slice of cells. */
TEXGS_API int32_t texgs_transmittance(const texgs_cells*, const float* extinction, const float to_light[3],
                                      uint8_t* light, void* stream);
/* Twice the mean share of lights from directions [n, 3] of length 1 that reaches each centre, at most 1, in 255ths: the
 * second of light. Only matter within `reach` world units hides them; on an even surface half of them are behind. */
TEXGS_API int32_t texgs_openness(const texgs_cells*, const float* extinction, int32_t n, const float* directions,
                                 float reach, uint8_t* light, void* stream);
/* Both shares at points [n, 3], shares [n, 2]. Beyond the outermost centres they are as there. */
TEXGS_API int32_t texgs_light_lookup(const texgs_cells*, const uint8_t* light, int64_t n, const float* points,
                                     float* shares, void* stream);

#ifdef __cplusplus
}
#endif
#endif
