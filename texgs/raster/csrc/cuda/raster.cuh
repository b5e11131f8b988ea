// SPDX-License-Identifier: Apache-2.0
// What the passes over a view share, and those passes.
//
// Screen: tiles of 16x16 pixels, one thread block each. A warp has a quadrant of 8x8 pixels, two per thread. As on the
// CPU, surfels are culled by blocks of 4x4 pixels; a quadrant has four of them.
//
// Kernels that keep many numbers per pixel are bound to one block per multiprocessor: that leaves the registers to the
// compiler, whose own guess at the occupancy spills.
#pragma once
#include "../texgs.h"
#include "device.cuh"

namespace texgs::cuda {

constexpr int kTile = 16;
constexpr int kThreads = 128;  // of a tile
constexpr int kWarps = kThreads / kWarp;
constexpr int kPixels = 2;  // of a thread
constexpr uint32_t kCulled = 0xffffffffu;

// A projected surfel or Gaussian as fragments need it (Forms, maths.h): 64 bytes, read as four vectors.
struct alignas(16) Record {
    float cx, cy;                        // low-pass centre, or mean, pixels
    float ux, uy, u, vx, vy, v, wx, wy;  // affine forms about it
    float log2_opacity;
    float zc, zp;  // depth of the plane at the centre, depth of the mean
    float clip;    // 1 where the near plane may cut the surfel
    int32_t id;    // surfel
    float reserved;
};

// Where a projected surfel or Gaussian is visible: an ellipse (centre, inverse covariance scaled to level 1) and a
// disc.
struct Footprint {
    float ex, ey, xx, xy, yy;
    float cx, cy, disc;       // disc: squared radius, negative where the ellipse covers it
    uint16_t x0, y0, x1, y1;  // tiles, half open; empty where culled
};

// A surfel in one of its tiles, with the mask of blocks it reaches there.
struct Listed {
    uint32_t surfel, mask;
};

// Everything the kernels read and write for one view. Arrays are owned by the frame.
struct Raster {
    texgs_surfels surfels;
    texgs_camera camera;
    texgs_options options;
    int tiles_x, tiles;
    int64_t plane;  // pixels of the image
    bool with_normal, with_depth;

    Record* records;        // [N]
    Footprint* footprints;  // [N]
    float* normals;         // [N, 3] facing the camera
    uint32_t* depth_keys;   // [N] ordered as the depths, kCulled where invisible; sorting overwrites them
    uint32_t* order;        // [N] surfels by depth; ranks are places in it

    // Pairs of a surfel and a tile. Their slots are numbered by rank, then by tile, so that each surfel's are adjacent
    // and a pair's gradient has a place of its own. Pairs of the surfels that end at slot `capacity` are listed.
    uint64_t* pair_begin;  // [N + 1] first slot of each rank
    int64_t capacity;
    Listed* listed;              // [capacity] by slot
    const uint32_t* tile_slots;  // [capacity] slots by tile, each tile's by depth
    const uint32_t* tile_begin;  // [tiles + 1] into tile_slots
    const uint32_t* tile_order;  // [tiles] those with most pairs first: none is left alone at the end

    texgs_image image, grad;
    int32_t* median_surfel;     // [H, W] surfel whose fragment is the median
    float* distortion_moments;  // [3, H, W] sum w m', sum w m'^2, depth where m' = 0

    float* slots;  // [capacity, slot_width]
    int slot_width;
    float* sums;                 // [N, slot_width] of each surfel's slots
    bool geometry;               // gradients of means, quats, scales, opacities or shift are wanted
    int64_t* texel_sums;         // [T, 3] fixed point
    const uint32_t* magnitudes;  // largest |colour gradient|, largest |gain|, as bits
    texgs_gradients out;
    texgs_contributions contributions;
};

void project(const Raster&, cudaStream_t);
void count_pairs(const Raster&, cudaStream_t);  // of each rank, into pair_begin; [N] = 0
void list_pairs(const Raster&, uint32_t* tiles, uint32_t* slots, cudaStream_t);  // tile and slot of each pair
void find_tiles(const uint32_t* sorted_tiles, int64_t n, int tiles, uint32_t* tile_begin, cudaStream_t);
void key_tiles(const Raster&, uint32_t* keys, uint32_t* order, cudaStream_t);  // to sort them for tile_order
void forward(const Raster&, cudaStream_t);
int backward_slot_width(const Raster&);
void backward(const Raster&, cudaStream_t);
void sum_slots(const Raster&, int maximum, cudaStream_t);  // `maximum`: place to take the largest of, or -1
void surfel_gradients(const Raster&, cudaStream_t);
void largest_magnitude(const float*, int64_t n, bool finite_only, uint32_t* bits, cudaStream_t);
void texel_gradients(const Raster&, cudaStream_t);
int contribute_slot_width(const Raster&);
void contribute(const Raster&, cudaStream_t);
void surfel_contributions(const Raster&, cudaStream_t);

}  // namespace texgs::cuda
