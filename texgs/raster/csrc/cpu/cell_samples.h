// SPDX-License-Identifier: Apache-2.0
// Samples of a volume at the corners of cells and beside them, a vector of cells at a time, as floats.
#pragma once
#include "simd.h"

namespace texgs::TEXGS_ISA {
namespace {

// Columns of samples: those before, at, behind and two behind the lower corner of a cell, none outside of the volume.
struct Columns {
    vi first;     // of four in a row that hold them all
    vi place[4];  // of each among these
};

// One of four values, by numbers 0 to 3.
TEXGS_INLINE vf one_of(const vf (&s)[4], vi place) {
    const vf p = to_float(place);
    return select(p < vf(1.5f), select(p < vf(0.5f), s[0], s[1]), select(p < vf(2.5f), s[2], s[3]));
}

// How samples of a type are loaded: lane by lane, whatever they are.
template <class T>
struct Loader {
    // Those in columns c.first + place of rows that begin at some samples of `base`.
    static TEXGS_INLINE vf one(const T* base, vi row, const Columns& c, int j) {
        int32_t at[kLanes];
        float lanes[kLanes];
        store(at, row + c.first + c.place[j]);
        for (int i = 0; i < kLanes; ++i) lanes[i] = static_cast<float>(base[at[i]]);
        return load(lanes);
    }
    static TEXGS_INLINE void two(const T* base, vi row, const Columns& c, vf& a, vf& b) {
        a = one(base, row, c, 1), b = one(base, row, c, 2);
    }
    static TEXGS_INLINE void four(const T* base, vi row, const Columns& c, vf (&s)[4]) {
        for (int j = 0; j < 4; ++j) s[j] = one(base, row, c, j);
    }
};

template <>
struct Loader<float> {
    static TEXGS_INLINE void two(const float* base, vi row, const Columns& c, vf& a, vf& b) {
        a = gather(base, row + c.first + c.place[1]), b = gather(base, row + c.first + c.place[2]);
    }
    static TEXGS_INLINE void four(const float* base, vi row, const Columns& c, vf (&s)[4]) {
        for (int j = 0; j < 4; ++j) s[j] = gather(base, row + c.first + c.place[j]);
    }
};

// Whole numbers of Bytes bytes, four of which in a row are one or two words.
template <class T, int Bytes>
struct WordLoader {
    static constexpr float kHalf = Bytes == 1 ? 127.5f : 32767.5f, kRange = 2.0f * kHalf + 1.0f;
    static TEXGS_INLINE vf number(vi bits) {
        const vf x = to_float(bits);
        return T(-1) < T(0) ? select(vf(kHalf) < x, x - vf(kRange), x) : x;
    }
    static TEXGS_INLINE void two(const T* base, vi row, const Columns& c, vf& a, vf& b) {
        if constexpr (Bytes == 1) {
            const vi word = gather_bytes(base, row + c.first);
            a = number(byte_of(word, c.place[1])), b = number(byte_of(word, c.place[2]));
        } else {
            const vi word = gather_bytes(base, (row + c.first + c.place[1]) * splat(2));
            a = number(word & splat(0xffff)), b = number(word >> 16);
        }
    }
    static TEXGS_INLINE void four(const T* base, vi row, const Columns& c, vf (&s)[4]) {
        if constexpr (Bytes == 1) {
            const vi word = gather_bytes(base, row + c.first);
            for (int j = 0; j < 4; ++j) s[j] = number(byte_of(word, c.place[j]));
        } else {
            const vi at = (row + c.first) * splat(2);
            const vi low = gather_bytes(base, at), high = gather_bytes(base, at + splat(4));
            const vf all[4] = {number(low & splat(0xffff)), number(low >> 16), number(high & splat(0xffff)),
                               number(high >> 16)};
            for (int j = 0; j < 4; ++j) s[j] = one_of(all, c.place[j]);
        }
    }
};
template <>
struct Loader<uint8_t> : WordLoader<uint8_t, 1> {};
template <>
struct Loader<int8_t> : WordLoader<int8_t, 1> {};
template <>
struct Loader<uint16_t> : WordLoader<uint16_t, 2> {};
template <>
struct Loader<int16_t> : WordLoader<int16_t, 2> {};

// Rows and columns of the samples around some cells, counted from the slice `first` of the volume on.
struct Cells {
    Columns columns;
    vi row[4], slice[4];  // offsets of the four rows and slices that hold a cell and what is beside it

    // Lower corners `at`, as whole numbers.
    TEXGS_INLINE Cells(const int32_t (&size)[3], const vf (&at)[3], int32_t first) {
        vi index[3][4];
        for (int a = 0; a < 3; ++a)
            for (int j = 0; j < 4; ++j)
                index[a][j] = truncate(min(max(at[a] + vf(float(j - 1)), 0.0f), static_cast<float>(size[a] - 1)));
        columns.first = truncate(min(max(at[0] - vf(1.0f), 0.0f), static_cast<float>(size[0] > 4 ? size[0] - 4 : 0)));
        for (int j = 0; j < 4; ++j) {
            columns.place[j] = index[0][j] + columns.first * splat(-1);
            row[j] = index[1][j] * splat(size[0]);
            slice[j] = (index[2][j] + splat(-first)) * splat(size[0] * size[1]);
        }
    }
};

// Values at places f inside of cells.
template <class T>
TEXGS_INLINE vf values_in(const T* base, const Cells& c, const vf (&f)[3]) {
    vf v[8];
    for (int i = 0; i < 4; ++i)
        Loader<T>::two(base, c.row[1 + (i & 1)] + c.slice[1 + (i >> 1)], c.columns, v[2 * i], v[2 * i + 1]);
    return trilinear(v, f);
}

// Differences of values one cell before and behind, along each axis: those of the corners, trilinear.
template <class T>
TEXGS_INLINE void differences_in(const T* base, const Cells& c, const vf (&f)[3], vf (&gradient)[3]) {
    vf x[8], y[8], z[8], inner[4][2];
    for (int i = 0; i < 4; ++i) {
        vf s[4];
        Loader<T>::four(base, c.row[1 + (i & 1)] + c.slice[1 + (i >> 1)], c.columns, s);
        x[2 * i] = s[2] - s[0], x[2 * i + 1] = s[3] - s[1];
        inner[i][0] = s[1], inner[i][1] = s[2];
    }
    for (int i = 0; i < 4; ++i) {  // corner (y, z) of the cell: i & 1, i >> 1
        const bool upper_y = i & 1, upper_z = i >> 1;
        vf beside[2], beyond[2];
        Loader<T>::two(base, c.row[upper_y ? 3 : 0] + c.slice[1 + upper_z], c.columns, beside[0], beside[1]);
        Loader<T>::two(base, c.row[1 + upper_y] + c.slice[upper_z ? 3 : 0], c.columns, beyond[0], beyond[1]);
        for (int e = 0; e < 2; ++e) {
            const vf across_y = inner[i ^ 1][e], across_z = inner[i ^ 2][e];
            y[2 * i + e] = upper_y ? beside[e] - across_y : across_y - beside[e];
            z[2 * i + e] = upper_z ? beyond[e] - across_z : across_z - beyond[e];
        }
    }
    gradient[0] = trilinear(x, f), gradient[1] = trilinear(y, f), gradient[2] = trilinear(z, f);
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
