// SPDX-License-Identifier: Apache-2.0
// What grid.cpp hands to the kernels of an instruction set, and the table of those kernels.
#pragma once
#include <cstdint>

#include "../texgs_grid.h"

namespace texgs {

constexpr int kBrickSide = 8;  // voxels; gradients are gathered brick by brick

// A point on a ray with density above 0, front to back.
struct GridSample {
    uint32_t cell;
    float f[3];    // place inside the cell
    float weight;  // in the ray's colour
    float behind;  // transmittance after it
    float color[3];
};

// What a sample adds to the rows of its cell's corners: gradients of red, green, blue and density, or with marks the
// weight in the first place.
struct GridRecord {
    uint32_t cell, ray;
    float f[3];
    float g[4];
};

// The samples of some consecutive rays.
struct GridChunk {
    GridSample* samples;
    int64_t count, capacity;
};

struct GridJob {
    texgs_grid grid;
    texgs_march march;
    int32_t bricks[3];
    bool keep;                     // whether the samples are wanted afterwards
    float *color, *alpha, *depth;  // [n, 3], [n], [n] or null
    float* basis;                  // [n, K] of rays with samples
    int32_t* lengths;              // [n] samples of a ray
    const float *grad_color, *grad_alpha;
    float* gradient;    // [rows, K], or with marks
    float* row_weight;  // [rows]
    uint8_t* touched;   // [B]
};

struct GridStep {
    texgs_grid grid;
    texgs_rule rule;
    float *gradient, *first, *second;
    uint8_t* touched;
};

struct GridVariation {
    texgs_grid grid;
    float weight_density, weight_sh;
    float* gradient;
    uint8_t* touched;
};

struct GridKernels {
    // Renders rays [begin, end) until the chunk may have too little room for the next; returns that one.
    int64_t (*march)(const GridJob&, GridChunk&, int64_t begin, int64_t end);
    // Writes records of the samples of rays [begin, end) to the places that the bricks' cursors say.
    void (*place)(const GridJob&, const GridSample*, int64_t begin, int64_t end, uint32_t* cursors, GridRecord* out);
    void (*scatter)(const GridJob&, const GridRecord* begin, const GridRecord* end);
    void (*mark)(const GridJob&, const GridRecord* begin, const GridRecord* end);
    void (*step)(const GridStep&, int64_t first_block, int64_t end_block);
    void (*total_variation)(const GridVariation&, const int32_t* blocks, int64_t n);
};

// Those of the active instruction set.
const GridKernels& grid_kernels();

// Writes where the grid can show anything; see texgs_grid_occupy().
void occupy(const texgs_grid&, uint64_t* occupied, uint8_t* distance);

// One table per instruction set, each in grid_table.cpp.
namespace portable {
extern const GridKernels kGridKernels;
}
namespace avx2 {
extern const GridKernels kGridKernels;
}
namespace avx512 {
extern const GridKernels kGridKernels;
}

#ifdef TEXGS_ISA
namespace TEXGS_ISA {
int64_t march_rays(const GridJob&, GridChunk&, int64_t begin, int64_t end);
void place_records(const GridJob&, const GridSample*, int64_t begin, int64_t end, uint32_t* cursors, GridRecord* out);
void scatter_records(const GridJob&, const GridRecord* begin, const GridRecord* end);
void mark_records(const GridJob&, const GridRecord* begin, const GridRecord* end);
void step_blocks(const GridStep&, int64_t first_block, int64_t end_block);
void total_variation_blocks(const GridVariation&, const int32_t* blocks, int64_t n);
}  // namespace TEXGS_ISA
#endif

}  // namespace texgs
