/* SPDX-License-Identifier: Apache-2.0
 *
 * Depth maps of many views as one surface (Curless and Levoy 1996). In libtexgs alone; the conventions are those of
 * texgs.h.
 */
#ifndef TEXGS_FUSION_H
#define TEXGS_FUSION_H
#include "texgs.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TEXGS_FUSION_BLOCK = 8 }; /* voxels along each side of a block */

/* What is known of voxels [z, y, x] of a lattice: means over the views that saw them. */
typedef struct {
    int32_t shape[3]; /* voxels along x, y, z: multiples of TEXGS_FUSION_BLOCK */
    float lower[3];   /* place of voxel 0, 0, 0 */
    float spacing;    /* distance of voxels */
    float* distance;  /* to the surface in truncations, -1 to 1, negative behind it */
    float* views;     /* how many saw a voxel */
    float* color;     /* [z, y, x, 3] */
} texgs_lattice;

/* A view of a surface. */
typedef struct {
    const float* viewmat; /* [4, 4] */
    const float* K;       /* [3, 3] */
    int32_t width, height;
    const float* depth;   /* [H, W] camera z, 0 where there is no surface */
    const uint8_t* color; /* [H, W, 3] */
} texgs_depth_view;

/* Adds a view to the voxels of `n` different blocks [n, 3], by their numbers along x, y, z: those in front of the
 * surface, and behind it by less than `truncation` world units. */
TEXGS_API int32_t texgs_fuse(const texgs_lattice* lattice, int64_t n, const int32_t* blocks,
                             const texgs_depth_view* view, float truncation, void* stream);

#ifdef __cplusplus
}
#endif
#endif
