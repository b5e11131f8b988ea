// SPDX-License-Identifier: Apache-2.0
// What changes the rows of a sparse voxel grid, a thread block for each block of voxels, a thread for each voxel: the
// step of the optimiser, and the gradient of total variation.
#include "grid.cuh"

namespace texgs::cuda {
namespace {

constexpr int kVoxels = 64;  // of a block

// The row of a voxel, 0 where it has none or lies outside.
__device__ inline int32_t row_of(const texgs_grid& grid, Cell c) {
    const bool inside =
        c.x >= 0 && c.y >= 0 && c.z >= 0 && c.x < grid.size[0] && c.y < grid.size[1] && c.z < grid.size[2];
    if (!inside) return 0;
    const int block = block_of(grid, c);
    const uint64_t mask = grid.masks[block], own = uint64_t(1) << bit_of(c);
    return mask & own ? grid.first[block] + popcount(mask & (own - 1)) : 0;
}

// The voxel of this thread.
__device__ inline Cell own_voxel(const texgs_grid& grid) {
    const int columns = grid.size[1] / 4, depth = grid.size[2] / 4;
    const int block = static_cast<int>(blockIdx.x), bit = static_cast<int>(threadIdx.x);
    return {4 * (block / (columns * depth)) + bit / 16, 4 * (block / depth % columns) + bit / 4 % 4,
            4 * (block % depth) + bit % 4};
}

__device__ inline Cell neighbour(Cell c, int axis, int by) {
    return {c.x + (axis == 0 ? by : 0), c.y + (axis == 1 ? by : 0), c.z + (axis == 2 ? by : 0)};
}

__global__ void count_kernel(const int32_t* blocks, int64_t n, uint32_t* counts) {
    const int64_t i = int64_t(blockIdx.x) * kVoxels + threadIdx.x;
    if (i < n) atomicAdd(counts + blocks[i], 1u);
}

// A voxel and the next ones along the axes: what total variation looks at in one place.
struct Corner {
    int32_t row, next[3];
    float times;  // how often its block was drawn
};
__device__ inline Corner corner_at(const texgs_grid& grid, const uint32_t* counts, Cell c) {
    Corner corner{row_of(grid, c), {0, 0, 0}, 0.0f};
    if (!corner.row) return corner;
    corner.times = static_cast<float>(counts[block_of(grid, c)]);
    for (int a = 0; a < 3; ++a) corner.next[a] = row_of(grid, neighbour(c, a, 1));
    return corner;
}

// Gradients of the variation at a corner, of one float: by the next voxels, and their sum.
struct Slope {
    float by[3], sum;
};
__device__ inline Slope slope_of(const float* rows, int floats, const Corner& c, int k, float weight) {
    Slope s{{0.0f, 0.0f, 0.0f}, 0.0f};
    const float own = rows[int64_t(c.row) * floats + k];
    float squares = 1e-9f;
    for (int a = 0; a < 3; ++a) {
        if (c.next[a]) s.by[a] = rows[int64_t(c.next[a]) * floats + k] - own;
        squares = fma(s.by[a], s.by[a], squares);
    }
    const float scale = c.times * weight / sqrtf(squares);
    for (int a = 0; a < 3; ++a) s.by[a] *= scale, s.sum += s.by[a];
    return s;
}

__global__ __launch_bounds__(kVoxels) void variation_kernel(const texgs_grid grid, int floats, float weight_density,
                                                            float weight_sh, const uint32_t* counts, float* gradient) {
    const Cell voxel = own_voxel(grid);
    const Corner own = corner_at(grid, counts, voxel);
    Corner before[3];
    bool is_reached = own.times > 0.0f;
    for (int a = 0; a < 3; ++a) {
        before[a] = own.row ? corner_at(grid, counts, neighbour(voxel, a, -1)) : Corner{};
        is_reached = is_reached || before[a].times > 0.0f;
    }
    if (is_reached)
        for (int k = 0; k < floats; ++k) {
            const float weight = k == 3 ? weight_density : weight_sh;
            float sum = -slope_of(grid.rows, floats, own, k, weight).sum;
            for (int a = 0; a < 3; ++a)
                if (before[a].times > 0.0f) sum += slope_of(grid.rows, floats, before[a], k, weight).by[a];
            gradient[int64_t(own.row) * floats + k] += sum;
        }
}

// Blocks that were drawn, and those next to them.
__global__ __launch_bounds__(kVoxels) void touch_kernel(const texgs_grid grid, const uint32_t* counts,
                                                        uint8_t* touched) {
    const int depth = grid.size[2] / 4, plane = grid.size[1] / 4 * depth;
    for_blocks<kVoxels>(block_count(grid), [&](int64_t block) {
        const bool is_reached = counts[block] || (block >= plane && counts[block - plane]) ||
                                (block % plane >= depth && counts[block - depth]) ||
                                (block % depth && counts[block - 1]);
        if (is_reached) touched[block] = 1;
    });
}

__device__ inline float running_mean(float mean, bool is_new, float value, float beta) {
    return is_new ? value : fma(beta, mean, (1.0f - beta) * value);
}

__global__ __launch_bounds__(kVoxels) void step_kernel(const texgs_grid grid, int floats, const texgs_rule rule,
                                                       const uint8_t* touched, float* gradient, float* first,
                                                       float* second) {
    if (!touched[blockIdx.x]) return;
    const int64_t row = row_of(grid, own_voxel(grid));
    if (!row) return;
    float* const g = gradient + row * floats;
    bool is_zero = true;
    for (int k = 0; k < floats; ++k) is_zero = is_zero && g[k] == 0.0f;
    if (is_zero) return;
    for (int k = 0; k < floats; ++k) {
        const int64_t i = row * floats + k;
        const float seen = second[i], value = g[k],
                    rate = k == 3  ? rule.rate_density
                           : k < 3 ? rule.rate_base
                                   : rule.rate_sh;
        float towards = value;
        if (first) towards = first[i] = running_mean(first[i], seen <= 0.0f, value, rule.beta1);
        second[i] = running_mean(seen, seen <= 0.0f, value * value, rule.beta2);
        grid.rows[i] -= rate * towards / (sqrtf(second[i]) + rule.epsilon);
        g[k] = 0.0f;
    }
    grid.density[row] = grid.rows[row * floats + 3];
}

}  // namespace

void total_variation(const texgs_grid& grid, int64_t n_blocks, const int32_t* blocks, float weight_density,
                     float weight_sh, float* gradient, uint8_t* touched, uint32_t* counts, cudaStream_t stream) {
    const size_t bytes = static_cast<size_t>(block_count(grid)) * sizeof *counts;
    check(cudaMemsetAsync(counts, 0, bytes, stream), "clearing memory");
    launch(count_kernel, blocks_for(n_blocks, kVoxels), kVoxels, stream, blocks, n_blocks, counts);
    launch(variation_kernel, block_count(grid), kVoxels, stream, grid, floats_of(grid), weight_density, weight_sh,
           counts, gradient);
    launch(touch_kernel, blocks_for(block_count(grid), kBytes * kVoxels), kVoxels, stream, grid, counts, touched);
}

void step_rows(const texgs_grid& grid, const texgs_rule& rule, float* gradient, uint8_t* touched, float* first,
               float* second, cudaStream_t stream) {
    const uint8_t* from = touched;
    launch(step_kernel, block_count(grid), kVoxels, stream, grid, floats_of(grid), rule, from, gradient, first, second);
    check(cudaMemsetAsync(touched, 0, static_cast<size_t>(block_count(grid)), stream), "clearing memory");
}

}  // namespace texgs::cuda
