// SPDX-License-Identifier: Apache-2.0
// Loads and stores of [N, 3] and [N, 4] arrays, one vector per column.
#pragma once
#include "simd.h"

namespace texgs::TEXGS_ISA {
namespace {

// column[k], lane i = p[K i + k] for the first n rows, 0 in other lanes.
template <int K>
TEXGS_INLINE void load_columns(const float* p, int n, vf column[K]) {
    float lanes[K][kLanes] = {};
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < K; ++k) lanes[k][i] = p[K * i + k];
    for (int k = 0; k < K; ++k) column[k] = load(lanes[k]);
}

// p[K i + k] = column[k], lane i, for the first n rows.
template <int K>
TEXGS_INLINE void store_columns(float* p, const vf column[K], int n) {
    float lanes[K][kLanes];
    for (int k = 0; k < K; ++k) store(lanes[k], column[k]);
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < K; ++k) p[K * i + k] = lanes[k][i];
}

#if defined(TEXGS_AVX512)

// Lane i of column k comes from float K i + k; entries from 16 on name the second operand of a permutation.
struct alignas(64) Lanes {
    int32_t v[16];
};
TEXGS_INLINE __m512i indices(const Lanes& lanes) { return _mm512_load_si512(lanes.v); }

template <>
TEXGS_INLINE void load_columns<3>(const float* p, int n, vf column[3]) {
    // Columns of the first two vectors (lanes beyond 10 or 9 are filled in by the second step), then of the third.
    static constexpr Lanes first[3] = {{{0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30, 0, 0, 0, 0, 0}},
                                       {{1, 4, 7, 10, 13, 16, 19, 22, 25, 28, 31, 0, 0, 0, 0, 0}},
                                       {{2, 5, 8, 11, 14, 17, 20, 23, 26, 29, 0, 0, 0, 0, 0, 0}}};
    static constexpr Lanes second[3] = {{{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 17, 20, 23, 26, 29}},
                                        {{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 18, 21, 24, 27, 30}},
                                        {{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 19, 22, 25, 28, 31}}};
    const int floats = 3 * n;
    const auto part = [&](int begin) {
        const int left = floats - begin;
        return left <= 0 ? vf(0.0f) : load_part(p + begin, left < 16 ? left : 16);
    };
    const vf a = part(0), b = part(16), c = part(32);
    for (int k = 0; k < 3; ++k) {
        const __m512 ab = _mm512_permutex2var_ps(a.v, indices(first[k]), b.v);
        column[k] = _mm512_permutex2var_ps(ab, indices(second[k]), c.v);
    }
}

template <>
TEXGS_INLINE void store_columns<3>(float* p, const vf column[3], int n) {
    // Float 16 m + i of the result is column (16 m + i) mod 3, row (16 m + i) / 3.
    static constexpr Lanes first[3] = {{{0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5}},
                                       {{21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26}},
                                       {{0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0}}};
    static constexpr Lanes second[3] = {{{0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15}},
                                        {{0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15}},
                                        {{26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31}}};
    for (int m = 0; m < 3; ++m) {
        const int left = 3 * n - 16 * m;
        if (left <= 0) return;
        const __m512 xy = _mm512_permutex2var_ps(column[0].v, indices(first[m]), column[1].v);
        const vf xyz = _mm512_permutex2var_ps(xy, indices(second[m]), column[2].v);
        store_part(p + 16 * m, xyz, left < 16 ? left : 16);
    }
}

#endif

}  // namespace
}  // namespace texgs::TEXGS_ISA
