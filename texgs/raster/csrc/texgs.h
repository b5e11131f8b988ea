/* SPDX-License-Identifier: Apache-2.0
 *
 * The C interface of the native libraries. `libtexgs` (CPU) and `libtexgs_cuda` export the same functions, the latter
 * without texgs_pass_seconds(); in it every pointer is a device pointer and `stream` the CUDA stream to work on (NULL
 * on a CPU).
 *
 * Conventions
 * - Tensors are dense, row-major, 32-bit floats unless the type says otherwise; images are planar [C, H, W].
 * - A NULL output is not computed; a NULL gradient input counts as zero.
 * - Gradients are written, not accumulated.
 * - Functions return 0, or a texgs_status; texgs_error() then holds one sentence about it (per thread).
 * - Nothing here keeps a pointer to a caller's memory after it returns; on a GPU, after the stream has passed.
 */
#ifndef TEXGS_H
#define TEXGS_H
#include <stdint.h>

#if defined(_WIN32)
#define TEXGS_API __declspec(dllexport)
#else
#define TEXGS_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define TEXGS_ABI_VERSION 10
#ifndef TEXGS_SOURCES /* the build defines it, see texgs_sources() */
#define TEXGS_SOURCES "unknown"
#endif
#define TEXGS_MAX_CHANNELS 32
#define TEXGS_MAX_PLANES 12    /* of a cut */
#define TEXGS_MAX_SIDE 1048560 /* 2^20 - 16 pixels: 65535 tiles, which 16 bits can count */

typedef enum {
    TEXGS_OK = 0,
    TEXGS_INVALID_ARGUMENT = 1,
    TEXGS_OUT_OF_MEMORY = 2, /* the sentence says how many bytes were asked for */
    TEXGS_DEVICE_ERROR = 3,
    TEXGS_STOPPED = 4, /* by the caller, see texgs_set_loops(); outputs are unfinished */
} texgs_status;

/* Surfels or 3D Gaussians in world space. Their colour has the three channels of a texture, where `base` is given, and
 * then those of `features`. */
typedef struct {
    int64_t n;
    int32_t axes;           /* 2: surfels; 3: 3D Gaussians, which have neither texture nor normals */
    const float* means;     /* [N, 3] */
    const float* quats;     /* [N, 4] wxyz, any length but zero */
    const float* scales;    /* [N, axes] standard deviations along the first axes, world units */
    const float* opacities; /* [N] in [0, 1] */
    int32_t raw;            /* not 0: `scales` are natural logarithms and `opacities` logits, and so their gradients */
    const float* shift;     /* [N, 2] pixels added to the projection, or NULL */
    int32_t channels;       /* C of the colour, 1 to TEXGS_MAX_CHANNELS */
    const float* features;  /* [N, C], or [N, C - 3] beside a texture, NULL where that leaves none */
    const float* base;      /* [N, 3]; fragment colour = base + gain * bilinear(texel) */
    const float* gain;      /* [N] */
    const float* texels;    /* [T, 3]; no two surfels share one */
    const int32_t* sizes;   /* [N, 2] texels along u and v; the texture spans +-3 standard deviations */
    const int64_t* offsets; /* [N] index of a surfel's first texel; texel (i, j) follows at i + j * sizes[0] */
    int64_t n_texels;       /* T */
} texgs_surfels;

/* A pinhole camera with OpenCV axes, pixel centres at +0.5, no skew. */
typedef struct {
    const float* viewmat;  /* [4, 4] world to camera */
    const float* K;        /* [3, 3] */
    int32_t width, height; /* 1 to TEXGS_MAX_SIDE */
    /* [2, H, W] camera z, or NULL: of a ray counts what lies from the first on and before the second. */
    const float* depth_range;
} texgs_camera;

typedef struct {
    const float* background; /* [C] or NULL for black */
    float low_pass;          /* k in rho = min(rho_surfel, k |pixel - centre|^2) */
    float filter_sigma;      /* low-pass centre: middle of the projected box of so many sigma; 0: projected mean */
    float dilation;          /* px^2 added to the variances of 3D Gaussians on screen; above 0 */
    int32_t antialiased;     /* 3D Gaussians lose as much opacity as the dilation adds area; 0 or 1 */
    float alpha_min;         /* weaker fragments are skipped; above 0 */
    float transmittance_min; /* a pixel ends before the fragment that would leave less */
    float near_plane, far_plane;
} texgs_options;

typedef struct {
    float* color;      /* [C, H, W] with background */
    float* alpha;      /* [H, W] */
    float* depth;      /* [H, W] expected depth of the fragments, 0 where alpha is 0 */
    float* median;     /* [H, W] depth of the last fragment that more than half of the light reaches, else 0 */
    float* normal;     /* [3, H, W] blended world normals, facing the camera */
    float* distortion; /* [H, W] sum over fragment pairs of w_i w_j (m_i - m_j)^2, m = NDC depth */
    float* radii;      /* [N] half extent on screen in pixels, 0 where culled */
} texgs_image;

/* Gradients of a scalar with respect to the surfels; NULL where not wanted. */
typedef struct {
    float *means, *quats, *scales, *opacities, *shift, *features, *base, *gain, *texels;
} texgs_gradients;

/* What each surfel contributed to an image. */
typedef struct {
    const float* image; /* [C, H, W] to splat back, or NULL */
    int32_t channels;   /* C of `image` */
    float* sums;        /* [N, C] sum of weight * image */
    float* weight_sum;  /* [N] */
    float* weight_max;  /* [N] */
    float* pixels;      /* [N] number of pixels with a weight above 0 */
} texgs_contributions;

/* Projected, sorted and binned surfels of one view: what forward leaves for backward. */
typedef struct texgs_frame texgs_frame;

TEXGS_API int32_t texgs_abi_version(void);
/* Digest of the sources that the library was built from (texgs/core/native_sources.py). */
TEXGS_API const char* texgs_sources(void);
TEXGS_API const char* texgs_error(void);
/* "avx512", "avx2", "portable" (CPU), or the compiled architectures (CUDA). */
TEXGS_API const char* texgs_instruction_set(void);

/* CPU: run parallel loops on the caller's OpenMP runtime (its GOMP_parallel), so that one thread pool serves both;
 * NULL: on threads of our own. */
TEXGS_API void texgs_use_openmp(void* gomp_parallel);
/* CPU: how parallel loops of the calling thread run: on so many threads, 0 for as many as there are, and until another
 * thread sets *stop, a number that stays where it is, or NULL, to what is not 0. Loops look at it before each range of
 * their items; then they end, and so does the call, with TEXGS_STOPPED. A GPU goes on. */
TEXGS_API void texgs_set_loops(int32_t threads, const int32_t* stop);

/* Projects, sorts and bins, then renders if `image` asks for a colour. */
TEXGS_API int32_t texgs_forward(const texgs_surfels*, const texgs_camera*, const texgs_options*, const texgs_image*,
                                texgs_frame** frame, void* stream);
/* `image` holds the forward outputs, `grad` their gradients. */
TEXGS_API int32_t texgs_backward(texgs_frame*, const texgs_surfels*, const texgs_camera*, const texgs_options*,
                                 const texgs_image* image, const texgs_image* grad, const texgs_gradients* out,
                                 void* stream);
TEXGS_API int32_t texgs_contribute(texgs_frame*, const texgs_surfels*, const texgs_camera*, const texgs_options*,
                                   const texgs_contributions*, void* stream);
TEXGS_API void texgs_release(texgs_frame*);

/* The part of each ray of a camera behind planes [n, 4]: where a x + b y + c z <= d, normals (a, b, c) of any length
 * but zero. Writes depth_range [2, H, W], 0 to infinity without a plane, the second not above the first where nothing
 * is left; and the plane through which a ray enters, face [H, W], -1 where it enters through none. */
TEXGS_API int32_t texgs_cut_range(const texgs_camera*, int32_t n, const float* planes, float* depth_range,
                                  int32_t* face, void* stream);

/* Frees the memory of frames that were released: a few are kept, to be used again. */
TEXGS_API void texgs_trim(void);
/* CPU: seconds that the passes of the calling thread's latest calls took, in the order of texgs_pass. */
typedef enum {
    TEXGS_PROJECT,
    TEXGS_SORT,
    TEXGS_BIN,
    TEXGS_FORWARD,
    TEXGS_BACKWARD,
    TEXGS_REDUCE,
    TEXGS_PASSES
} texgs_pass;
TEXGS_API void texgs_pass_seconds(double seconds[TEXGS_PASSES]);
/* The most bytes of scratch memory held since the last call with reset. */
TEXGS_API int64_t texgs_memory(int32_t reset);
/* TEXGS_OUT_OF_MEMORY where the machine (device) says that it has less left. */
TEXGS_API int32_t texgs_require_memory(int64_t bytes);

#ifdef __cplusplus
}
#endif
#endif
