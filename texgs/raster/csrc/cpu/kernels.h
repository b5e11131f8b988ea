// SPDX-License-Identifier: Apache-2.0
// What the passes over a view share, and the table of kernels that each instruction set provides.
//
// Screen: tiles of 16x16 pixels, each of 4x4 squares of 4x4 pixels. Inside tiles, planes of pixels are stored block by
// block ("block-linear"). What blocks are depends on the instruction set (blocks.h).
#pragma once
#include <cstdint>

#include "../texgs.h"

namespace texgs {

constexpr int kTile = 16;
constexpr int kTilePixels = kTile * kTile;
constexpr int kSquares = 16;       // per tile, 4 x 4
constexpr int kSquarePixels = 16;  // 4 x 4
constexpr int kRecordChannels = 3;
constexpr int kSlotAlign = 16;  // floats in a cache line

// A projected surfel or Gaussian as fragments need it (Forms, maths.h): one cache line.
struct alignas(64) Record {
    float cx, cy;                        // low-pass centre, or mean, pixels
    float ux, uy, u, vx, vy, v, wx, wy;  // affine forms about it
    float log2_opacity;
    float zc, zp;                  // depth of the plane at the centre, depth of the mean
    float color[kRecordChannels];  // the channels, where there are no more: what most views need is one line
};
static_assert(sizeof(Record) == 64);

// What the fragments of a projected surfel have to look out for; most surfels have neither.
constexpr uint8_t kClipped = 1;   // the near plane may cut it
constexpr uint8_t kFiltered = 2;  // the low-pass filter may rule some of its fragments

// Where a projected surfel or Gaussian is visible: an ellipse and a disc. At the height y above its centre the ellipse
// holds the interval slope y +- width sqrt(1 - (y / height)^2), which ends farthest to the right at y = tip.
struct alignas(64) Footprint {
    float ex, ey, slope, width, height, tip;
    float cx, cy, disc;       // disc: squared radius, negative where the ellipse covers it
    uint16_t x0, y0, x1, y1;  // tiles, half open; empty where culled
    float nearest, farthest;  // camera z of its fragments
};

// One surfel in one tile, with the mask of blocks it reaches and the place of its gradient.
struct Pair {
    uint32_t surfel, slot, mask;
};

// One surfel before sorting into tiles.
struct Candidate {
    uint32_t tile, surfel, rank, mask;  // rank: how many of the surfel's tiles come before
};

// Texel gradients of one pair: those of the part of the texture that the tile touches, four floats a texel; or, for
// textures that are looked up in registers, whole planes. No sums where the tile shows nothing of the surfel.
struct TexelPart {
    float* sums;
    int32_t column, row, columns, rows;
};

// Memory for texel parts, cut from large blocks (texel_arena.h). One per worker.
struct TexelArena {
    float* next;
    float* end;
    void (*refill)(TexelArena*, int64_t floats);  // leaves next = end where memory is exhausted
};

// Everything the kernels read and write for one view. Arrays are owned by the frame.
struct Raster {
    texgs_surfels surfels;
    texgs_camera camera;
    texgs_options options;
    int tiles_x, tiles_y;
    int channels;     // constant over a surfel: base and features, then the normal
    bool with_depth;  // depth, median or distortion is wanted
    bool with_normal;

    Record* records;        // [N]
    Footprint* footprints;  // [N]
    uint8_t* flags;         // [N] kClipped, kFiltered
    float* normals;         // [N, 3] facing the camera
    uint32_t* depth_keys;   // [N] ordered as the depths; kCulled where invisible

    const float* square_ranges;  // [tiles, 2, 16] smallest and largest depth that counts in a square; NULL: all do
    const uint32_t* tile_begin;  // [tiles + 1] into pairs
    const Pair* pairs;
    const uint32_t* slot_begin;  // [N + 1] slots of a surfel, in surfel order

    texgs_image image, grad;
    float* median_stop;         // [tiles, 256] alpha behind the fragment that is a pixel's median
    float* distortion_moments;  // [tiles, 3, 256] sum w m', sum w m'^2, depth where m' = 0

    float* slots;  // [slots, slot_stride]
    int slot_stride;
    TexelPart* texel_parts;  // [slots]
    texgs_gradients out;
    texgs_contributions contributions;
};

constexpr uint32_t kCulled = 0xffffffffu;

// Kernels work on a range of surfels, of depth-ordered surfels, or on one tile. `scratch` is the worker's own memory.
struct Kernels {
    int64_t (*scratch_bytes)();
    void (*project)(const Raster&, int64_t begin, int64_t end);
    // Appends the tiles of order[begin, end) to `out`, counts them per tile and per surfel; returns how many.
    int64_t (*bin)(const Raster&, const uint32_t* order, int64_t begin, int64_t end, Candidate* out, uint32_t* per_tile,
                   uint32_t* per_surfel);
    void (*forward)(const Raster&, int tile, void* scratch);
    void (*backward)(const Raster&, int tile, void* scratch);
    void (*reduce)(const Raster&, int64_t begin, int64_t end);
    void (*contribute)(const Raster&, int tile, void* scratch);
    void (*reduce_contributions)(const Raster&, int64_t begin, int64_t end);
    void (*texture_backward)(const Raster&, int tile, void* scratch, TexelArena&);
    void (*reduce_textures)(const Raster&, int64_t begin, int64_t end, float* largest_texture);
};

// The instruction set in use: the best this machine has, or the one named by TEXGS_ISA.
const Kernels& kernels();

}  // namespace texgs
