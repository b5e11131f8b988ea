// SPDX-License-Identifier: Apache-2.0
// Rays through a sparse voxel grid, a vector of rays or of samples at a time: where a ray first and last comes near
// anything is searched for several rays together; on the way, samples are looked up in the blocks' bits together.
#pragma once
#include "simd.h"

#include "../grid_maths.h"

namespace texgs::TEXGS_ISA {
namespace {

// Cells of some points, and the places of their blocks.
struct Cells {
    vi at[3], block;
};
TEXGS_INLINE Cells cells_of(const texgs_grid& g, const vf points[3]) {
    Cells c;
    for (int a = 0; a < 3; ++a)  // lanes that are not used may lie outside
        c.at[a] = truncate(max(min(points[a], static_cast<float>(g.size[a] - 2)), 0.0f));
    const int columns = g.size[1] >> 2, depth = g.size[2] >> 2;
    c.block = ((c.at[0] >> 2) * splat(columns) + (c.at[1] >> 2)) * splat(depth) + (c.at[2] >> 2);
    return c;
}

// Whether the cells of some samples of a ray can show anything.
TEXGS_INLINE vm are_occupied(const texgs_grid& g, const Ray& ray, vf k, float step) {
    const vf t = (k + vf(0.5f)) * vf(step);
    vf points[3];
    for (int a = 0; a < 3; ++a) points[a] = fma(t, ray.direction[a], ray.entry[a]);
    const Cells c = cells_of(g, points);
    const vi half = c.at[0] >> 1 & splat(1);  // of the block's 64 bits
    const vi bit = (c.at[0] & splat(1)) * splat(16) + (c.at[1] & splat(3)) * splat(4) + (c.at[2] & splat(3));
    return is_set(gather(reinterpret_cast<const int32_t*>(g.occupied), c.block + c.block + half), bit);
}

// Some rays, and the samples between which they come near anything.
struct Bundle {
    Ray rays[kLanes];
    int32_t first[kLanes], end[kLanes];
};

// The number of samples, from the first one or backwards from the last one, that are in empty blocks.
TEXGS_INLINE vf empty_samples(const texgs_grid& g, const Bundle& bundle, float step, bool backwards) {
    float entry[3][kLanes], direction[3][kLanes], per[3][kLanes], counts[kLanes];
    for (int i = 0; i < kLanes; ++i) {
        const Ray& ray = bundle.rays[i];
        for (int a = 0; a < 3; ++a) {
            entry[a][i] = ray.entry[a], direction[a][i] = ray.direction[a];
            per[a][i] = backwards ? -ray.samples_per[a] : ray.samples_per[a];
        }
        counts[i] = static_cast<float>(ray.samples);
    }
    const vf count = load(counts);
    vf passed = 0.0f;
    for (;;) {
        const vf k = backwards ? count - vf(1.0f) - passed : passed;
        vf points[3], leave = 1e6f;
        for (int a = 0; a < 3; ++a) points[a] = fma((k + vf(0.5f)) * vf(step), load(direction[a]), load(entry[a]));
        const Cells c = cells_of(g, points);
        const vi word = truncate(max(to_float(c.block) - vf(3.0f), 0.0f));  // whose last byte is no later
        const vf distance = to_float(byte_of(gather_bytes(g.distance, word), c.block + word * splat(-1)));
        const vm empty = (distance > vf(0.0f)) & (passed < count);
        if (!any(empty)) return passed;
        for (int a = 0; a < 3; ++a) {
            const vf samples_per = load(per[a]), corner = to_float(c.at[a] >> 2) * vf(4.0f);
            const vf side = select(samples_per > vf(0.0f), distance, vf(1.0f) - distance);
            leave = min(leave, (fma(4.0f, side, corner) - points[a]) * samples_per);
        }
        passed = add_where(empty, passed, floor(max(leave, 0.0f)) + vf(1.0f));  // rounding may have gone too far
    }
}

TEXGS_INLINE void enter_all(const texgs_grid& g, const texgs_march& how, int64_t begin, int n, Bundle& bundle) {
    for (int i = 0; i < kLanes; ++i) {
        bundle.rays[i] = enter(g, how, begin + (i < n ? i : 0));
        bundle.end[i] = bundle.rays[i].samples;
    }
    float before[kLanes], after[kLanes];
    store(before, empty_samples(g, bundle, how.step, false));
    store(after, empty_samples(g, bundle, how.step, true));
    for (int i = 0; i < kLanes; ++i) {
        const int32_t first = static_cast<int32_t>(before[i]);
        bundle.first[i] = first > bundle.rays[i].first ? first : bundle.rays[i].first;
        bundle.end[i] -= static_cast<int32_t>(after[i]);
    }
}

// Samples k of a ray in occupied cells, and the density there. All densities come before the first one is used: it
// takes long until one is known, and a wrong guess about it throws away all that was begun meanwhile.
struct Looks {
    int n;
    float k[kLanes];
    Point points[kLanes];
    Corners cells[kLanes];
    const Corners* corners[kLanes];  // of these, as neighbours are often in one cell
    float density[kLanes];
};

// Looks at samples [first, end), kLanes of them at most.
TEXGS_INLINE void look(const texgs_grid& grid, const Ray& ray, float step, int first, int end, Looks& looks) {
    const vf next = to_float(splat(first) + iota());
    const vm chosen = are_occupied(grid, ray, next, step) & (next < vf(static_cast<float>(end)));
    store_chosen(looks.k, next, chosen);
    looks.n = count(chosen);
    int cell = -1;
    for (int i = 0; i < looks.n; ++i) {
        Point& p = looks.points[i];
        p = sample_point(grid, ray, static_cast<int>(looks.k[i]), step);
        if (i == 0 || pack(p.cell) != pack(looks.points[i - 1].cell)) looks.cells[++cell] = corners_of(grid, p.cell);
        looks.corners[i] = &looks.cells[cell];
        looks.density[i] = density_at(grid, looks.cells[cell], p.f);
    }
}

// Calls body(sample) where there is any density between two samples of a ray, front to back; returns the light that is
// left.
template <class Body>
TEXGS_INLINE float march(const texgs_grid& grid, const texgs_march& how, const Ray& ray, int first, int end,
                         const Body& body) {
    const float step = how.step;
    float light = 1.0f;
    Looks looks;
    for (int k = first; k < end;) {
        const Point p = sample_point(grid, ray, k, step);
        if (const int distance = grid.distance[block_of(grid, p.cell)]) {
            k += skipped(ray, p, distance);
            continue;
        }
        look(grid, ray, step, k, end, looks);
        for (int i = 0; i < looks.n; ++i) {
            if (!(looks.density[i] > 0.0f)) continue;
            const float behind = light * ::expf(-looks.density[i] * step * grid.spacing);
            body(Sample{looks.points[i], *looks.corners[i], light - behind, behind,
                        ray.near + (looks.k[i] + 0.5f) * step});
            light = behind;
            if (light < how.transmittance_min) return light;
        }
        k += kLanes;
    }
    return light;
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
