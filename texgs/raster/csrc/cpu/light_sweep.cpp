// SPDX-License-Identifier: Apache-2.0
// Light through slices of cells: columns run in its direction, and each slice is read and written where they meet it.
// What is between centres is linear, by the same shares all over a slice: extinctions where columns meet a slice, and
// the light in columns where centres are, so that opaque matter darkens what is beside it by its part of this.
#include "simd.h"

#include "../volume_maths.h"
#include "interleaved.h"
#include "light_kernels.h"
#include "light_shares.h"

namespace texgs::TEXGS_ISA {
namespace {

// Four neighbours at p and one row behind, linear.
TEXGS_INLINE vf bilinear(const float* p, const float* next_row, vf fu, vf fv) {
    return mix(mix(load(p), load(p + 1), fu), mix(load(next_row), load(next_row + 1), fu), fv);
}

// Adds a part of what a row V of columns meets in a slice to sums, and half of it to depths.
void add_row(const SweepJob& job, int slice, int V, float part, float* sums, float* depths) {
    const Columns& c = job.columns;
    const Shift u(shift_of(c, 0, slice)), v(shift_of(c, 1, slice));
    const int row = V + v.steps;
    if (row < -1 || row > c.n_v - 1) return;
    const float* from = job.matter + (int64_t(place_of(c, slice)) * (c.n_v + 2) + row + 1) * job.stride + 1 + u.steps;
    const int begin = -1 - u.steps > 0 ? -1 - u.steps : 0, stop = c.n_u - u.steps;
    const int end = stop < c.wide ? stop : c.wide;
    for (int U = begin; U < end; U += kLanes) {
        const vf met = vf(part) * bilinear(from + U, from + job.stride + U, u.rest, v.rest);
        store(sums + U, load(sums + U) + met);
        store(depths + U, fma(met, 0.5f, load(depths + U)));
    }
}

// Turns a row of depths into shares of light, where columns are next to centres.
void to_shares(const Columns& c, int slice, float* depths) {
    const int begin = Shift(-shift_of(c, 0, slice)).steps;
    for (int U = begin; U <= begin + c.n_u; U += kLanes)
        store(depths + U, exp2(vf(0.0f) - max(load(depths + U), 0.0f)));
}

// Adds the shares of a row v of centres to their sums, from those of two rows of columns.
void add_shares(const SweepJob& job, int slice, int v, const float* row, const float* next_row, float fv) {
    const Columns& c = job.columns;
    const Shift u(-shift_of(c, 0, slice));
    float* to = job.sums + (int64_t(place_of(c, slice)) * c.n_v + v) * c.n_u;
    for (int i = 0; i < c.n_u; i += kLanes) {
        const int n = c.n_u - i < kLanes ? c.n_u - i : kLanes;
        const vf share = bilinear(row + u.steps + i, next_row + u.steps + i, u.rest, fv);
        store_part(to + i, load_part(to + i, n) + share, n);
    }
}

void sweep(const SweepJob& job, int first, int end, float* scratch) {
    const Columns& c = job.columns;
    const int64_t width = c.wide + kMargin, rows = end - first + 1;
    float *sums = scratch, *depths = scratch + (kBand + 1) * width;
    std::memset(sums, 0, sizeof(float) * static_cast<size_t>(rows * width));
    for (int slice = 0; slice < c.slices; ++slice) {
        std::memcpy(depths, sums, sizeof(float) * static_cast<size_t>(rows * width));
        for (int r = 0; r < rows; ++r) {
            add_row(job, slice, first + r, job.per_slice, sums + r * width, depths + r * width);
            if (slice >= job.reach)
                add_row(job, slice - job.reach, first + r, -job.per_slice, sums + r * width, depths + r * width);
        }
        const Shift v(-shift_of(c, 1, slice));
        for (int r = 0; r < rows; ++r) {
            const int row = first + r - v.steps;
            if (row >= 0 && row <= c.n_v) to_shares(c, slice, depths + r * width);
        }
        for (int r = 0; r < rows - 1; ++r) {
            const int row = first + r - v.steps;
            if (row >= 0 && row < c.n_v)
                add_shares(job, slice, row, depths + r * width, depths + (r + 1) * width, v.rest);
        }
    }
}

void lookup(const LightLookupJob& job, int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; i += kLanes) {
        const int n = static_cast<int>(end - i < kLanes ? end - i : kLanes);
        vf point[3], place[3];
        load_columns<3>(job.points + 3 * i, n, point);
        for (int a = 0; a < 3; ++a) {
            const float size = static_cast<float>(job.cells.size[a]), half = job.cells.half[a];
            place[a] = fma(point[a], size / (2.0f * half), 0.5f * (size - 1.0f));
        }
        const Shares shares = shares_at(job.light, job.cells.size, place);
        const vf both[2] = {shares.lamp * vf(1.0f / 255.0f), shares.sky * vf(1.0f / 255.0f)};
        store_columns<2>(job.shares + 2 * i, both, n);
    }
}

}  // namespace

void extinction_row(const ExtinctionJob&, int y, int z);

const LightKernels kLightKernels = {extinction_row, sweep, lookup};

}  // namespace texgs::TEXGS_ISA
