/* SPDX-License-Identifier: Apache-2.0
 *
 * Rays through a volume: a regular grid of samples that a transfer function makes visible. The conventions are those of
 * texgs.h.
 */
#ifndef TEXGS_VOLUME_H
#define TEXGS_VOLUME_H
#include "texgs.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TEXGS_INSIDE 127.5f   /* of a mask, from which on a place is inside */
enum { TEXGS_BRICK = 4 };     /* cells along each side of a brick: what is known to be empty or not */
enum { TEXGS_CHANNELS = 16 }; /* volumes that a cast shows together, at most */
typedef enum {
    TEXGS_U8,
    TEXGS_I8,
    TEXGS_U16,
    TEXGS_I16,
    TEXGS_U32,
    TEXGS_I32,
    TEXGS_U64,
    TEXGS_I64,
    TEXGS_F32,
    TEXGS_F64,
} texgs_sample_type;

/* Samples at the corners of cells, in a box around the origin. Between them values are trilinear. */
typedef struct {
    const void* values; /* [z, y, x]; NaN is transparent, with all cells that it is a corner of */
    int32_t type;       /* a texgs_sample_type */
    int32_t size[3];    /* samples along x, y, z, at least 2 */
    float half[3];      /* half the box's sides, world units */
} texgs_volume;

/* The colour of values, and their opacity over a unit of length, linear between points [n, 5] of value, opacity, red,
 * green and blue, ascending by value. The second of two points at one value holds there. Beyond all points nothing
 * shows, nor does anything outside of a mask. n: 2 to 65536. */
typedef struct {
    int32_t n;
    const float* points;
    const uint8_t* within; /* [z, y, x] the mask, samples of the volume's lattice, trilinear between them; or NULL */
} texgs_transfer;

/* Bricks along x, y and z, and their number. */
TEXGS_API int64_t texgs_volume_bricks(const texgs_volume*, int32_t size[3]);
/* The smallest and the largest value in each brick, its faces included, extremes [bricks, 2]; of a brick without any
 * number the smallest is infinite. Returns in *missing how many samples are NaN. */
TEXGS_API int32_t texgs_volume_extremes(const texgs_volume*, float* extremes, int64_t* missing, void* stream);
/* How far it is from each brick to one in which something shows, distance [bricks + 3], the last three unused: by how
 * many bricks along the axis along which it is farthest, 0 there, at most 255. A mask is not looked at: bricks outside
 * of it need extremes of bricks without any number. */
TEXGS_API int32_t texgs_volume_distance(const texgs_volume*, const float* extremes, const texgs_transfer*,
                                        uint8_t* distance, void* stream);
/* In which cells of the bricks at distance 0 something may show, cells [bricks, 2]: cell (x, y, z) of a brick is bit
 * 16 (z % 2) + 4 y + x of its word z / 2. Those of other bricks, and behind the volume, are 0. */
TEXGS_API int32_t texgs_volume_cells(const texgs_volume*, const uint8_t* distance, const texgs_transfer*,
                                     uint32_t* cells, void* stream);

/* A view, and how it is lit: Blinn-Phong with a distant viewer and a distant white light. A sample k of a ray is at
 * (k + 0.5) steps from where the ray enters the box. Rays end where less than 1e-3 of the light is left. */
typedef struct {
    const float* viewmat; /* [4, 4] */
    const float* K;       /* [3, 3] without skew */
    int32_t width, height;
    float step;         /* between samples, world units */
    float opacity_unit; /* length that the opacity of values is over, world units */
    float to_viewer[3], to_light[3];
    float ambient, diffuse, specular, shininess;
    float* rgba;   /* [H, W, 4] premultiplied */
    float* depth;  /* [H, W] mean camera z, weighted as colours are; 0 where nothing shows; or NULL */
    float* median; /* [H, W] camera z at which half of the light is gone, 0 where it never is; or NULL */
    float* normal; /* [H, W, 3] mean normal, against the ray, world axes; or NULL */
    /* [2, H, W] camera z from which and to which a ray counts, or NULL: samples stay where they are, and count for what
     * of their step lies there. */
    const float* depth_range;
    /* The faces of a cut: over an opacity unit from where a ray begins, its plane's normal takes the place of the
     * volume's, or colours are unlit. */
    const int32_t* face; /* [H, W] the plane through which a ray enters, or none of these; or NULL */
    const float* planes; /* [n_planes, 3] unit normals */
    int32_t n_planes, unlit_faces;
    /* Shares of light that reach places `outset` world units along the normals of samples, on their side towards the
     * viewer, or NULL: see texgs_light.h. Of diffuse and highlights 1 - shadows (1 - first share) is left, of ambient
     * light 1 - occlusion (1 - second share). */
    const uint8_t* light;  /* [z, y, x, 2] in 255ths, at the centres of cells */
    int32_t light_size[3]; /* these cells, see texgs_cells */
    float light_half[3];
    float shadows, occlusion, outset;
} texgs_cast_view;

/* Volumes [n] of one lattice, each of its own type and with its transfer function, show together what all of them show:
 * where several do, extinctions add up, and colours are means that these weigh. distance: the least of theirs; cells:
 * those of any of them; own [n, bricks, 2]: those of each. Both, or the latter, are NULL where they are not known. */
TEXGS_API int32_t texgs_cast(const texgs_volume*, const texgs_transfer*, int32_t n, const uint8_t* distance,
                             const uint32_t* cells, const uint32_t* own, const texgs_cast_view*, void* stream);

/* What a volume is at points, and a transfer function there, mask or not; each of them may be NULL. Beyond the box it
 * is as at the nearest point of it. */
typedef struct {
    float* values;    /* [n] NaN where a sample of the cell is missing */
    float* gradients; /* [n, 3] of values, per world unit: central differences, one voxel to both sides */
    float* quats;     /* [n, 4] wxyz of length 1, which turn z to the gradient; (1, 0, 0, 0) where there is none */
    float* colors;    /* [n, 3] of the value, or of the nearest one that the transfer function has points for */
} texgs_lookup;
TEXGS_API int32_t texgs_volume_lookup(const texgs_volume*, const texgs_transfer*, int64_t n, const float* points,
                                      const texgs_lookup*, void* stream);

#ifdef __cplusplus
}
#endif
#endif
