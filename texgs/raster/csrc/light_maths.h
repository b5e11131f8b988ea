// SPDX-License-Identifier: Apache-2.0
// The maths of light inside of volumes, shared by every back end.
#pragma once
#include <cmath>

#include "both.h"
#include "status.h"
#include "texgs_light.h"

namespace texgs {

// Of a place, in a cell's edges: 2^-16 of the light is none. Cells that opaque matter only touches stay bright.
constexpr float kMostExtinction = 16.0f;

// Columns of light through slices of cells. Slice 0 is the nearest to the light. Along the axis w from it the
// direction has its largest part, in cells; u and v are the others. At slice i the column (U, V) is at the place
// (U + shift(u, i), V + shift(v, i)) of centres.
struct Columns {
    int u, v, w;
    int n_u, n_v, slices;  // cells
    int wide, high;        // columns along U and V
    bool is_from_end;      // whether slice 0 is the last one of the axis
    double slope[2], base[2];
    float length;  // of a column in a slice, world units
};

namespace {  // for kernels are compiled several times

inline void check_cells(const texgs_cells& cells) {
    for (int a = 0; a < 3; ++a) {
        require(cells.size[a] >= 2 && cells.size[a] <= TEXGS_LIGHT_SIDE,
                "light: expected 2 to 256 cells along an axis");
        require(cells.half[a] > 0.0f && cells.half[a] < 1e30f, "light: expected sides above 0");
    }
}

inline int64_t count_cells(const texgs_cells& cells) { return int64_t(cells.size[0]) * cells.size[1] * cells.size[2]; }

inline float edge_of(const texgs_cells& cells, int axis) {
    return 2.0f * cells.half[axis] / static_cast<float>(cells.size[axis]);
}

inline float shortest_edge(const texgs_cells& cells) {
    float least = edge_of(cells, 0);
    for (int a = 1; a < 3; ++a) least = edge_of(cells, a) < least ? edge_of(cells, a) : least;
    return least;
}

// Places in a cell along an axis.
inline int places_per_cell(const texgs_volume& volume, const texgs_cells& cells, int axis) {
    const int places = (volume.size[axis] + cells.size[axis] - 2) / cells.size[axis];
    return places < 2 ? 2 : places > 8 ? 8 : places;
}

// The distance of places along an axis, in samples: place i is at (i + 0.5) times it.
inline float spacing_of(const texgs_volume& volume, const texgs_cells& cells, int axis) {
    const int places = places_per_cell(volume, cells, axis) * cells.size[axis];
    return static_cast<float>(volume.size[axis] - 1) / static_cast<float>(places);
}

// How far columns are at a slice from where they count, along U or V, in cells.
TEXGS_MATHS double shift_of(const Columns& c, int axis, int slice) { return c.slope[axis] * slice - c.base[axis]; }
// The place of a slice along w.
TEXGS_MATHS int place_of(const Columns& c, int slice) { return c.is_from_end ? c.slices - 1 - slice : slice; }

// How many more columns it takes to reach `far` cells beyond the others, also where rounding makes that a little more.
inline double columns_beyond(double far) { return far > 0.0 ? ::ceil(far + 1e-9) : 0.0; }

inline Columns columns_of(const texgs_cells& cells, const float (&to_light)[3]) {
    double along[3], length = 0.0;  // in cells
    for (int a = 0; a < 3; ++a) {
        along[a] = to_light[a] / double(edge_of(cells, a));
        length += double(to_light[a]) * to_light[a];
    }
    require(length > 1e-12 && length < 1e30, "light: expected a direction");
    Columns c;
    c.w = 0;
    for (int a = 1; a < 3; ++a)
        if (::fabs(along[a]) > ::fabs(along[c.w])) c.w = a;
    c.u = c.w == 0 ? 1 : 0, c.v = c.w == 2 ? 1 : 2;  // rows along x stay rows where that can be
    c.n_u = cells.size[c.u], c.n_v = cells.size[c.v], c.slices = cells.size[c.w];
    c.is_from_end = along[c.w] > 0.0;
    c.length = static_cast<float>(::sqrt(length) / ::fabs(along[c.w]));
    int count[2];
    for (int i = 0; i < 2; ++i) {
        c.slope[i] = -along[i ? c.v : c.u] / ::fabs(along[c.w]);
        const double far = c.slope[i] * (c.slices - 1);
        c.base[i] = columns_beyond(far);
        count[i] = (i ? c.n_v : c.n_u) + static_cast<int>(c.base[i] + columns_beyond(-far)) + 1;
    }
    c.wide = count[0], c.high = count[1];
    return c;
}

// A whole number of steps, and the rest below 1.
struct Shift {
    int steps;
    float rest;
    TEXGS_MATHS Shift(double shift)
        : steps(static_cast<int>(::floor(shift))), rest(static_cast<float>(shift - ::floor(shift))) {}
};

// What lights of n directions leave of a share: their mean, doubled.
inline float share_of(int n) { return 2.0f / static_cast<float>(n); }

// How many slices before its own hide a place.
inline int reach_in_slices(const Columns& columns, float reach) {
    const double slices = reach / double(columns.length) + 0.5;
    return slices < columns.slices ? static_cast<int>(slices < 1.0 ? 1.0 : slices) : columns.slices;
}

}  // namespace
}  // namespace texgs
