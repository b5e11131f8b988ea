// SPDX-License-Identifier: Apache-2.0
// The geometry of a sparse voxel grid, shared by every back end: rays through the lattice, the rows around a point,
// spherical harmonics. Plain floats; each instance has internal linkage in namespace texgs::TEXGS_ISA.
//
// Lattice coordinates: voxel (0, 0, 0) is the origin and spacing 1. A cell is the cube between eight voxels, named by
// its lowest one.
#pragma once
#include <cmath>
#include <cstdint>

#include "texgs_grid.h"

#if defined(_MSC_VER) && !defined(__clang__) && !defined(__CUDACC__)
#include <intrin.h>
#endif
#ifndef TEXGS_MATHS
#ifdef __CUDACC__
#define TEXGS_MATHS __host__ __device__ inline
#else
#define TEXGS_MATHS inline
#endif
#endif

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kBlockSide = 4;

TEXGS_MATHS int popcount(uint64_t bits) {
#if defined(__CUDA_ARCH__)
    return __popcll(bits);
#elif defined(_MSC_VER) && !defined(__clang__)
    return static_cast<int>(__popcnt64(bits));
#else
    return __builtin_popcountll(bits);
#endif
}

// -- Voxels and cells ------------------------------------------------------------------------------------------------

struct Cell {
    int x, y, z;
};
TEXGS_MATHS uint32_t pack(Cell c) { return static_cast<uint32_t>(c.x << 20 | c.y << 10 | c.z); }
TEXGS_MATHS Cell unpack(uint32_t p) {
    return {static_cast<int>(p >> 20), static_cast<int>(p >> 10 & 1023), static_cast<int>(p & 1023)};
}

TEXGS_MATHS int block_of(const texgs_grid& g, Cell c) {
    return ((c.x >> 2) * (g.size[1] >> 2) + (c.y >> 2)) * (g.size[2] >> 2) + (c.z >> 2);
}
TEXGS_MATHS int bit_of(Cell c) { return (c.x & 3) << 4 | (c.y & 3) << 2 | (c.z & 3); }

// The blocks and rows of a cell's eight corners, in the order of corner_weights(); row 0 where there is none.
struct Corners {
    int block[8];
    int32_t row[8];
};
TEXGS_MATHS Corners corners_of(const texgs_grid& g, Cell c) {
    const int depth = g.size[2] >> 2, plane = (g.size[1] >> 2) * depth, z = c.z & 3;
    Corners corners;
    for (int i = 0; i < 8; i += 2) {  // two corners along z at a time: mostly of one block
        const int x = c.x + (i >> 2), y = c.y + (i >> 1 & 1), column = (x & 3) << 4 | (y & 3) << 2;
        const int block = (x >> 2) * plane + (y >> 2) * depth + (c.z >> 2);
        const uint64_t from = g.masks[block] >> (column | z);
        const int32_t row = g.first[block] + popcount(g.masks[block]) - popcount(from);
        corners.block[i] = corners.block[i + 1] = block;
        corners.row[i] = from & 1 ? row : 0;
        if (z < 3) {
            corners.row[i + 1] = from & 2 ? row + static_cast<int32_t>(from & 1) : 0;
        } else {
            const uint64_t next = g.masks[block + 1];
            const uint64_t own = uint64_t(1) << column;
            corners.block[i + 1] = block + 1;
            corners.row[i + 1] = next & own ? g.first[block + 1] + popcount(next & (own - 1)) : 0;
        }
    }
    return corners;
}

// Trilinear weights of a point's eight corners; the last axis is the fastest.
TEXGS_MATHS void corner_weights(const float f[3], float w[8]) {
    const float x0 = 1.0f - f[0], y0 = 1.0f - f[1], z0 = 1.0f - f[2];
    const float a = x0 * y0, b = x0 * f[1], c = f[0] * y0, d = f[0] * f[1];
    w[0] = a * z0, w[1] = a * f[2], w[2] = b * z0, w[3] = b * f[2];
    w[4] = c * z0, w[5] = c * f[2], w[6] = d * z0, w[7] = d * f[2];
}

// -- Rays ------------------------------------------------------------------------------------------------------------

// The part of a ray inside the lattice; sample k lies at entry + (k + 0.5) step direction. Those from `first` on and
// before `samples` count.
struct Ray {
    float entry[3], direction[3];  // lattice coordinates; unit length
    float samples_per[3];          // samples on which it moves by one along an axis, with the direction's sign; finite
    float near;                    // distance of the entry from the origin, spacings
    int first, samples;
};

// The first of `samples` samples that lies no nearer than a place, in steps from the entry.
TEXGS_MATHS int first_sample(float place, int samples) {
    const float k = std::ceil(place - 0.5f);
    return k > 0.0f ? k < static_cast<float>(samples) ? static_cast<int>(k) : samples : 0;
}

// Ray i.
TEXGS_MATHS Ray enter(const texgs_grid& g, const texgs_march& how, int64_t i) {
    Ray ray;
    const float *given = how.rays + 6 * i, *d = given + 3, step = how.step;
    const float over = 1.0f / std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    float near = 0.0f, far = 1e30f;
    for (int a = 0; a < 3; ++a) {
        const float direction = d[a] * over, origin = (given[a] - g.lower[a]) / g.spacing;
        const float high = static_cast<float>(g.size[a] - 1);
        ray.direction[a] = direction;
        ray.entry[a] = origin;
        const bool is_across = std::fabs(direction) < 1e-12f;
        const float inverse = is_across ? 1e12f : 1.0f / direction;
        ray.samples_per[a] = inverse / step;
        if (is_across) {
            if (!(origin >= 0.0f && origin <= high)) far = -1.0f;
            continue;
        }
        const float t0 = -origin * inverse, t1 = (high - origin) * inverse;
        const float first = t0 < t1 ? t0 : t1, last = t0 < t1 ? t1 : t0;
        if (!(first <= last)) far = -1.0f;  // not a number
        near = first > near ? first : near;
        far = last < far ? last : far;
    }
    for (int a = 0; a < 3; ++a) ray.entry[a] += near * ray.direction[a];
    ray.near = near;
    const float length = far - near, longest = static_cast<float>(g.size[0] + g.size[1] + g.size[2]);
    ray.samples = length > 0.0f && length <= longest ? static_cast<int>(length / step + 0.5f) : 0;
    ray.first = 0;
    if (how.depth_range) {
        const float per = 1.0f / (over * g.spacing);
        ray.first = first_sample((how.depth_range[i] * per - near) / step, ray.samples);
        ray.samples = first_sample((how.depth_range[how.n + i] * per - near) / step, ray.samples);
    }
    return ray;
}

struct Point {
    Cell cell;
    float f[3];  // place inside the cell, 0 to 1
};
TEXGS_MATHS Point sample_point(const texgs_grid& g, const Ray& ray, int k, float step) {
    const float t = (static_cast<float>(k) + 0.5f) * step;
    Point p;
    int c[3];
    for (int a = 0; a < 3; ++a) {
        // Rounding may lead out of the lattice, and far out for an origin that is far away.
        const int last = g.size[a] - 2;
        const float at = ray.entry[a] + t * ray.direction[a], most = static_cast<float>(last) + 1.0f;
        const float inside = at > 0.0f ? at < most ? at : most : 0.0f;
        const int cell = static_cast<int>(inside);
        c[a] = cell < last ? cell : last;
        p.f[a] = inside - static_cast<float>(c[a]);
    }
    p.cell = {c[0], c[1], c[2]};
    return p;
}

// How many samples on the first one lies that leaves the empty blocks around a point: those nearer than `distance`.
TEXGS_MATHS int skipped(const Ray& ray, const Point& p, int distance) {
    const int c[3] = {p.cell.x, p.cell.y, p.cell.z};
    float leave = 1e6f;
    for (int a = 0; a < 3; ++a) {
        const int face = (c[a] & ~3) + kBlockSide * (ray.samples_per[a] > 0.0f ? distance : 1 - distance);
        const float samples = (static_cast<float>(face - c[a]) - p.f[a]) * ray.samples_per[a];
        leave = samples < leave ? samples : leave;
    }
    return static_cast<int>(leave > 0.0f ? leave : 0.0f) + 1;  // rounding may have gone too far
}

// Below 0 as well: nothing is there.
TEXGS_MATHS float density_at(const texgs_grid& grid, const Corners& corners, const float f[3]) {
    float w[8], density = 0.0f;
    corner_weights(f, w);
    for (int i = 0; i < 8; ++i) density += w[i] * grid.density[corners.row[i]];
    return density;
}

struct Sample {
    const Point& point;
    const Corners& corners;
    float weight, behind;  // in the ray's colour; light that passes on
    float distance;        // from the origin, spacings
};

// -- Spherical harmonics ---------------------------------------------------------------------------------------------

// The values that the floats of a row are multiplied with in the direction of a ray; those of extras are 0 but for the
// ninth coefficient's, and that of density, which is 1. Order and signs are those of 3DGS.
TEXGS_MATHS void row_basis(int degree, const float d[3], float* out) {
    constexpr float y0 = 0.28209479f, y1 = 0.48860251f, y2[3] = {1.09254843f, 0.31539157f, 0.54627422f};
    const float x = d[0], y = d[1], z = d[2];
    const float basis[8] = {y0,
                            -y1 * y,
                            y1 * z,
                            -y1 * x,
                            y2[0] * x * y,
                            -y2[0] * y * z,
                            y2[1] * (2.0f * z * z - x * x - y * y),
                            -y2[0] * x * z};
    const float ninth = degree == 2 ? y2[2] * (x * x - y * y) : 0.0f;
    const int quads = degree == 2 ? 8 : degree == 1 ? 4 : 1;
    for (int k = 0; k < quads; ++k) {
        for (int c = 0; c < 3; ++c) out[4 * k + c] = basis[k];
        out[4 * k + 3] = k == 0 ? 1.0f : k < 4 ? ninth : 0.0f;
    }
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
