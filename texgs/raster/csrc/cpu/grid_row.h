// SPDX-License-Identifier: Apache-2.0
// The K floats of a voxel in vectors (texgs_grid.h says what they are). Where a vector is longer than a row, its upper
// lanes are 0.
#pragma once
#include "simd.h"

namespace texgs::TEXGS_ISA {
namespace {

template <int K>
struct Row {
    static constexpr int kVectors = K < kLanes ? 1 : K / kLanes;
    static_assert(K == 4 || K % kLanes == 0);
    vf v[kVectors];
};

template <int K>
TEXGS_INLINE Row<K> load_row(const float* p) {
    Row<K> row;
    if constexpr (K < kLanes)
        row.v[0] = load_quad(p);
    else
        for (int i = 0; i < Row<K>::kVectors; ++i) row.v[i] = load(p + i * kLanes);
    return row;
}
template <int K>
TEXGS_INLINE void store_row(float* p, const Row<K>& row) {
    if constexpr (K < kLanes)
        store_quad(p, row.v[0]);
    else
        for (int i = 0; i < Row<K>::kVectors; ++i) store(p + i * kLanes, row.v[i]);
}

template <int K>
TEXGS_INLINE void prefetch_row(const float* p) {
    for (int i = 0; i < K; i += 16) prefetch(p + i);
}

// The row whose floats are body(the floats of other rows).
template <int K, class Body, class... Rows>
TEXGS_INLINE Row<K> each(const Body& body, const Rows&... rows) {
    Row<K> out;
    for (int i = 0; i < Row<K>::kVectors; ++i) out.v[i] = body(rows.v[i]...);
    return out;
}

template <int K>
TEXGS_INLINE Row<K> zero_row() {
    return each<K>([] { return vf(0.0f); });
}

// Whether all is 0; not where there is a NaN.
template <int K>
TEXGS_INLINE bool is_zero(const Row<K>& row) {
    unsigned other = 0;
    for (const vf v : row.v) other |= bits(~((v <= vf(0.0f)) & (vf(0.0f) <= v)));
    return other == 0;
}

// One value for the density, one for the zeroth coefficient, one for the others.
template <int K>
TEXGS_INLINE Row<K> row_of_kinds(float density, float base, float sh) {
    float values[32];
    for (int i = 0; i < K; ++i) values[i] = i == 3 ? density : i < 3 ? base : sh;
    return load_row<K>(values);
}

// Calls body with the row's length as a type.
template <int K>
struct Floats {
    static constexpr int value = K;
};
template <class Body>
TEXGS_INLINE auto for_degree(int degree, const Body& body) {
    return degree == 2 ? body(Floats<32>()) : degree == 1 ? body(Floats<16>()) : body(Floats<4>());
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
