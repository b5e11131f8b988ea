// SPDX-License-Identifier: Apache-2.0
// What changes rows: the step of the optimiser, and the gradient of total variation.
#include "grid_kernels.h"
#include "grid_row.h"

#include "../grid_maths.h"

namespace texgs::TEXGS_ISA {
namespace {

// A running mean that starts at its first value: 0 in every lane that has had none.
template <int K>
TEXGS_INLINE Row<K> running_mean(const Row<K>& mean, const Row<K>& is_new, const Row<K>& value, float beta) {
    return each<K>(
        [&](vf m, vf fresh, vf x) {
            const vm unseen = fresh <= vf(0.0f);  // a mean of squares is never negative
            return select(unseen, x, fma(beta, m, vf(1.0f - beta) * x));
        },
        mean, is_new, value);
}

template <int K>
void step_row(const GridStep& job, const Row<K>& rates, int64_t row) {
    float* const at = job.gradient + row * K;
    const Row<K> g = load_row<K>(at);
    if (is_zero<K>(g)) return;
    store_row<K>(at, zero_row<K>());
    const Row<K> seen = load_row<K>(job.second + row * K);
    Row<K> first = g;
    if (job.first) {
        first = running_mean<K>(load_row<K>(job.first + row * K), seen, g, job.rule.beta1);
        store_row<K>(job.first + row * K, first);
    }
    const Row<K> second = running_mean<K>(seen, seen, each<K>([](vf a) { return a * a; }, g), job.rule.beta2);
    store_row<K>(job.second + row * K, second);
    float* const value = job.grid.rows + row * K;
    const vf epsilon = job.rule.epsilon;
    store_row<K>(value, each<K>([&](vf x, vf rate, vf a, vf b) { return x - rate * a / (sqrt(b) + epsilon); },
                                load_row<K>(value), rates, first, second));
    job.grid.density[row] = value[3];
}

// The next voxel of a cell's lowest corner along an axis (2: z), or 0 where it has no row.
TEXGS_INLINE int32_t next_row(const texgs_grid& grid, Cell c, int axis, int* block) {
    int at[3] = {c.x, c.y, c.z};
    if (++at[axis] >= grid.size[axis]) return 0;
    const Cell next{at[0], at[1], at[2]};
    *block = block_of(grid, next);
    const uint64_t mask = grid.masks[*block], own = uint64_t(1) << bit_of(next);
    return mask & own ? grid.first[*block] + popcount(mask & (own - 1)) : 0;
}

template <int K>
void vary_voxel(const GridVariation& job, const Row<K>& weight, Cell cell, int64_t row) {
    const float* rows = job.grid.rows;
    const Row<K> value = load_row<K>(rows + row * K);
    Row<K> difference[3], squares = each<K>([] { return vf(1e-9f); });
    int32_t next[3];
    for (int a = 0; a < 3; ++a) {
        int block = 0;
        next[a] = next_row(job.grid, cell, a, &block);
        if (next[a]) job.touched[block] = 1;
        const Row<K> other = next[a] ? load_row<K>(rows + int64_t(next[a]) * K) : value;
        difference[a] = each<K>([](vf x, vf y) { return x - y; }, other, value);
        squares = each<K>([](vf d, vf s) { return fma(d, d, s); }, difference[a], squares);
    }
    const Row<K> scale = each<K>([](vf w, vf s) { return w / sqrt(s); }, weight, squares);
    float* const own = job.gradient + row * K;
    Row<K> sum = load_row<K>(own);
    for (int a = 0; a < 3; ++a) {
        if (!next[a]) continue;
        const Row<K> g = each<K>([](vf s, vf d) { return s * d; }, scale, difference[a]);
        float* const other = job.gradient + int64_t(next[a]) * K;
        store_row<K>(other, each<K>([](vf x, vf y) { return x + y; }, load_row<K>(other), g));
        sum = each<K>([](vf x, vf y) { return x - y; }, sum, g);
    }
    store_row<K>(own, sum);
}

template <int K>
void vary_blocks(const GridVariation& job, const int32_t* blocks, int64_t n) {
    const Row<K> weight = row_of_kinds<K>(job.weight_density, job.weight_sh, job.weight_sh);
    const int columns = job.grid.size[1] >> 2, depth = job.grid.size[2] >> 2;
    for (int64_t i = 0; i < n; ++i) {
        const int block = blocks[i];
        const Cell corner{4 * (block / (columns * depth)), 4 * (block / depth % columns), 4 * (block % depth)};
        int64_t row = job.grid.first[block];
        job.touched[block] = 1;
        for (int bit = 0; bit < 64; ++bit) {
            if (!(job.grid.masks[block] >> bit & 1)) continue;
            vary_voxel<K>(job, weight, {corner.x + (bit >> 4), corner.y + (bit >> 2 & 3), corner.z + (bit & 3)}, row);
            ++row;
        }
    }
}

template <int K>
void step_rows(const GridStep& job, int64_t first_block, int64_t end_block) {
    const Row<K> rates = row_of_kinds<K>(job.rule.rate_density, job.rule.rate_base, job.rule.rate_sh);
    for (int64_t block = first_block; block < end_block; ++block) {
        if (!job.touched[block]) continue;
        job.touched[block] = 0;
        const int64_t first = job.grid.first[block], end = first + popcount(job.grid.masks[block]);
        for (int64_t row = first; row < end; ++row) step_row<K>(job, rates, row);
    }
}

}  // namespace

void step_blocks(const GridStep& job, int64_t first_block, int64_t end_block) {
    for_degree(job.grid.degree, [&](auto k) { step_rows<k.value>(job, first_block, end_block); });
}

void total_variation_blocks(const GridVariation& job, const int32_t* blocks, int64_t n) {
    for_degree(job.grid.degree, [&](auto k) { vary_blocks<k.value>(job, blocks, n); });
}

}  // namespace texgs::TEXGS_ISA
