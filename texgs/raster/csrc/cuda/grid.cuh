// SPDX-License-Identifier: Apache-2.0
// What the passes over a sparse voxel grid share.
#pragma once
#include "../texgs_grid.h"
#include "maths.cuh"
#include "memory.cuh"
#include "sort.cuh"

#include "../grid_maths.h"

namespace texgs::cuda {

// A point on a ray with density above 0.
struct GridSample {
    uint32_t cell, ray;
    float f[3];  // place inside the cell
    float weight, behind;
    float color[3];
};

// Everything the kernels read and write for one set of rays.
struct GridJob {
    texgs_grid grid;
    texgs_march how;
    float *color, *alpha, *depth;  // [n, 3], [n], [n] or null
    uint64_t* begin;               // [n + 1] first sample of a ray
    GridSample* samples;
    float* basis;  // [n, K] of rays with samples
    const float *grad_color, *grad_alpha;
    float4* gradients;    // [samples] of red, green, blue and density
    uint32_t* keys;       // [8 samples] rows of the corners
    uint32_t* values;     // [8 samples] sample and corner: 8 sample + corner
    uint32_t* row_begin;  // [rows + 1] into the sorted values
    float* gradient;
    uint8_t* touched;
    float* row_weight;
};

// Frees the memory of samples that wait to be used again.
void clear_grid_pool();

void count_samples(const GridJob&, cudaStream_t);  // of each ray, into begin; [n] = 0
void render_rays(const GridJob&, bool keep, cudaStream_t);
void sample_gradients(const GridJob&, cudaStream_t);
void list_corners(const GridJob&, int64_t samples, cudaStream_t);
void gather_rows(const GridJob&, cudaStream_t);
void mark_rows(const GridJob&, int64_t samples, cudaStream_t);

void occupy(const texgs_grid&, uint64_t* occupied, uint8_t* distance, uint64_t* scratch, cudaStream_t);
void total_variation(const texgs_grid&, int64_t n_blocks, const int32_t* blocks, float weight_density, float weight_sh,
                     float* gradient, uint8_t* touched, uint32_t* counts, cudaStream_t);
void step_rows(const texgs_grid&, const texgs_rule&, float* gradient, uint8_t* touched, float* first, float* second,
               cudaStream_t);

namespace {

__host__ __device__ constexpr int64_t block_count(const texgs_grid& g) {
    return int64_t(g.size[0] / 4) * (g.size[1] / 4) * (g.size[2] / 4);
}
// Bytes of neighbouring blocks share a word: a thread writes all of those of one.
constexpr int kBytes = 4;
// Calls body(block) for this thread's blocks.
template <int Threads, class Body>
__device__ void for_blocks(int64_t blocks, const Body& body) {
    const int64_t first = kBytes * (int64_t(blockIdx.x) * Threads + threadIdx.x);
    for (int64_t block = first; block < first + kBytes && block < blocks; ++block) body(block);
}

constexpr int floats_of(const texgs_grid& g) { return g.degree == 2 ? 32 : g.degree == 1 ? 16 : 4; }

}  // namespace
}  // namespace texgs::cuda
