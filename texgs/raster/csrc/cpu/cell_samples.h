// SPDX-License-Identifier: Apache-2.0
// Samples of a volume around the cells that a ray goes through, as floats. Rays take several samples in a cell, so
// that what surrounds it is loaded once for all of these, and lanes look it up.
#pragma once
#include <type_traits>

#include "simd.h"

#include "../texgs_volume.h"

namespace texgs::TEXGS_ISA {
namespace {

// Calls use(values) with the samples of a volume as what they are.
template <class Use>
TEXGS_INLINE void with_type(const void* values, int32_t type, const Use& use) {
    switch (type) {
        case TEXGS_U8:
            return use(static_cast<const uint8_t*>(values));
        case TEXGS_I8:
            return use(static_cast<const int8_t*>(values));
        case TEXGS_U16:
            return use(static_cast<const uint16_t*>(values));
        case TEXGS_I16:
            return use(static_cast<const int16_t*>(values));
        case TEXGS_U32:
            return use(static_cast<const uint32_t*>(values));
        case TEXGS_I32:
            return use(static_cast<const int32_t*>(values));
        case TEXGS_U64:
            return use(static_cast<const uint64_t*>(values));
        case TEXGS_I64:
            return use(static_cast<const int64_t*>(values));
        case TEXGS_F32:
            return use(static_cast<const float*>(values));
        default:
            return use(static_cast<const double*>(values));
    }
}

// Which rows of a block are loaded: those that hold the cell, or also those beside them.
enum class Rows { of_cell, around };

template <int N>
using Planes = std::integral_constant<int, N>;

// Blocks of four columns, rows and slices of samples, of which the middle two hold a cell. Samples outside of the
// volume are the nearest ones inside.
class Blocks {
public:
    // Loads the blocks of cells on a ray, which are given by their lower corners, in the order of the ray. `ahead`: 1
    // or -1 along each axis, where the ray goes.
    template <class T>
    TEXGS_INLINE void fetch(const T* values, const int32_t (&size)[3], const vf (&cell)[3], const float (&ahead)[3],
                            Rows rows) {
        float crossed[kLanes + 1];  // faces of cells, up to the lane before: more of them mean another cell
        crossed[0] = -1e9f;
        const vf faces = fma(cell[0], ahead[0], fma(cell[1], ahead[1], cell[2] * vf(ahead[2]))),
                 lane = to_float(iota());
        store(crossed + 1, faces);
        const vm is_new = load(crossed) < faces;
        float corner[3][kLanes], begin[kLanes];
        for (int a = 0; a < 3; ++a) store_chosen(corner[a], cell[a], is_new);
        store_chosen(begin, lane, is_new);
        n_ = count(is_new);
        vf first = -4.0f;
        for (int i = 0; i < n_; ++i) {
            first = add_where(vf(begin[i]) <= lane, first, 4.0f);
            const int32_t at[3] = {int32_t(corner[0][i]), int32_t(corner[1][i]), int32_t(corner[2][i])};
            copy(values, size, at, i, rows);
        }
        first_ = truncate(first);
    }

    // Loads a block around each of n cells.
    template <class T>
    TEXGS_INLINE void fetch_each(const T* values, const int32_t (&size)[3], const vf (&cell)[3], int n) {
        float corner[3][kLanes];
        for (int a = 0; a < 3; ++a) store(corner[a], cell[a]);
        for (int i = 0; i < n; ++i)
            copy(values, size, {int32_t(corner[0][i]), int32_t(corner[1][i]), int32_t(corner[2][i])}, i, Rows::around);
        n_ = kLanes;
        first_ = iota() * splat(4);
    }

    // Calls use(planes) with the number of planes of a table in registers that holds a row of all blocks; 0 where
    // none does.
    template <class Use>
    TEXGS_INLINE vf with_planes(Use use) const {
        if (n_ <= 4) return use(Planes<1>());
        if constexpr (kTableTexels >= 32)
            if (n_ <= 8) return use(Planes<2>());
        return use(Planes<kTableTexels >= 4 * kLanes ? 4 * kLanes / 16 : 0>());
    }

    // Column x of row (y, z) of each lane's block.
    template <int N>
    TEXGS_INLINE vf at(Planes<N>, int x, int y, int z) const {
        const vi place = first_ + splat(x);
        if constexpr (N == 0)
            return gather(rows_[z][y], place);
        else
            return table_lookup<N>(rows_[z][y], place);
    }

private:
    template <class T>
    TEXGS_INLINE void copy(const T* values, const int32_t (&size)[3], const int32_t (&at)[3], int block, Rows rows) {
        const bool is_inside =
            at[0] > 0 && at[1] > 0 && at[2] > 0 && at[0] < size[0] - 2 && at[1] < size[1] - 2 && at[2] < size[2] - 2;
        if (!is_inside) return copy_clamped(values, size, at, block);
        const int64_t row = size[0], slice = row * size[1];
        const T* from = values + (at[2] - 1) * slice + (at[1] - 1) * row + at[0] - 1;
        const auto copy_row = [&](int y, int z) { copy_quad(rows_[z][y] + 4 * block, from + z * slice + y * row); };
        for (int z = 1; z < 3; ++z)
            for (int y = 1; y < 3; ++y) copy_row(y, z);
        if (rows == Rows::of_cell) return;
        for (int i = 1; i < 3; ++i) copy_row(0, i), copy_row(3, i), copy_row(i, 0), copy_row(i, 3);
    }

    template <class T>
    void copy_clamped(const T* values, const int32_t (&size)[3], const int32_t (&at)[3], int block) {
        const auto clamped = [&](int axis, int i) {
            const int32_t place = at[axis] + i - 1, last = size[axis] - 1;
            return place < 0 ? 0 : place < last ? place : last;
        };
        for (int z = 0; z < 4; ++z)
            for (int y = 0; y < 4; ++y) {
                const T* row = values + (int64_t(clamped(2, z)) * size[1] + clamped(1, y)) * size[0];
                for (int x = 0; x < 4; ++x) rows_[z][y][4 * block + x] = static_cast<float>(row[clamped(0, x)]);
            }
    }

    float rows_[4][4][4 * kLanes] = {};  // [z][y]: four columns of each block
    int n_ = 0;                          // blocks
    vi first_;                           // place of each lane's block in a row
};

// Values at places f inside of cells.
TEXGS_INLINE vf values_in(const Blocks& blocks, const vf (&f)[3]) {
    return blocks.with_planes([&](auto planes) {
        vf v[8];
        for (int i = 0; i < 8; ++i) v[i] = blocks.at(planes, 1 + (i & 1), 1 + (i >> 1 & 1), 1 + (i >> 2));
        return trilinear(v, f);
    });
}

// Differences of values one cell before and behind, along each axis: those of the corners, trilinear.
TEXGS_INLINE void differences_in(const Blocks& blocks, const vf (&f)[3], vf (&gradient)[3]) {
    for (int a = 0; a < 3; ++a) {
        const int dx = a == 0, dy = a == 1, dz = a == 2;
        gradient[a] = blocks.with_planes([&](auto planes) {
            vf v[8];
            for (int i = 0; i < 8; ++i) {
                const int x = 1 + (i & 1), y = 1 + (i >> 1 & 1), z = 1 + (i >> 2);
                v[i] = blocks.at(planes, x + dx, y + dy, z + dz) - blocks.at(planes, x - dx, y - dy, z - dz);
            }
            return trilinear(v, f);
        });
    }
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
