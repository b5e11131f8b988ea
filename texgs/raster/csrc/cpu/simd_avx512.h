// SPDX-License-Identifier: Apache-2.0
// AVX-512 (F, VL, DQ, BW): sixteen lanes, masks in registers of their own. Included by simd.h alone.
#pragma once

// clang-format off: a table, one operation a line
namespace texgs::TEXGS_ISA {
namespace {

constexpr int kLanes = 16;
constexpr int kRegisters = 32;
struct vm {
    __mmask16 v;
};
struct vi {
    __m512i v;
};
struct vf {
    __m512 v;
    vf() = default;
    TEXGS_INLINE vf(__m512 x) : v(x) {}
    TEXGS_INLINE vf(float x) : v(_mm512_set1_ps(x)) {}
};

TEXGS_INLINE vf load(const float* p) { return _mm512_loadu_ps(p); }
TEXGS_INLINE void store(float* p, vf a) { _mm512_storeu_ps(p, a.v); }
TEXGS_INLINE void stream(float* p, vf a) { _mm512_stream_ps(p, a.v); }  // p: 64-byte aligned
TEXGS_INLINE void stream_fence() { _mm_sfence(); }
TEXGS_INLINE vi load(const int32_t* p) { return {_mm512_loadu_si512(p)}; }
TEXGS_INLINE void store(int32_t* p, vi a) { _mm512_storeu_si512(p, a.v); }
// The first n lanes, 0 to kLanes; the others are loaded as 0.
TEXGS_INLINE vf load_part(const float* p, int n) {
    return _mm512_maskz_loadu_ps(static_cast<__mmask16>((1u << n) - 1), p);
}
TEXGS_INLINE void store_part(float* p, vf a, int n) {
    if (n == 16) return store(p, a);  // masked stores are slow
    _mm512_mask_storeu_ps(p, static_cast<__mmask16>((1u << n) - 1), a.v);
}
// Four floats in the lowest lanes, the others 0; and lane i = p[index[i]] for indices 0 to 3.
TEXGS_INLINE vf load_quad(const float* p) { return _mm512_zextps128_ps512(_mm_loadu_ps(p)); }
TEXGS_INLINE void store_quad(float* p, vf a) { _mm_storeu_ps(p, _mm512_castps512_ps128(a.v)); }
TEXGS_INLINE vf permute_quad(const float* p, const int32_t* index) { return _mm512_permutexvar_ps(load(index).v, load_quad(p).v); }

TEXGS_INLINE vf operator+(vf a, vf b) { return _mm512_add_ps(a.v, b.v); }
TEXGS_INLINE vf operator-(vf a, vf b) { return _mm512_sub_ps(a.v, b.v); }
TEXGS_INLINE vf operator*(vf a, vf b) { return _mm512_mul_ps(a.v, b.v); }
TEXGS_INLINE vf operator/(vf a, vf b) { return _mm512_div_ps(a.v, b.v); }
TEXGS_INLINE vf fma(vf a, vf b, vf c) { return _mm512_fmadd_ps(a.v, b.v, c.v); }    //  a b + c
TEXGS_INLINE vf fnma(vf a, vf b, vf c) { return _mm512_fnmadd_ps(a.v, b.v, c.v); }  // -a b + c
// min and max return b where a is NaN.
TEXGS_INLINE vf min(vf a, vf b) { return _mm512_min_ps(a.v, b.v); }
TEXGS_INLINE vf max(vf a, vf b) { return _mm512_max_ps(a.v, b.v); }
TEXGS_INLINE vf sqrt(vf a) { return _mm512_sqrt_ps(a.v); }
TEXGS_INLINE vf abs(vf a) { return _mm512_abs_ps(a.v); }
TEXGS_INLINE vf floor(vf a) { return _mm512_roundscale_ps(a.v, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC); }

TEXGS_INLINE vm operator<(vf a, vf b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)}; }
TEXGS_INLINE vm operator<=(vf a, vf b) { return {_mm512_cmp_ps_mask(a.v, b.v, _CMP_LE_OQ)}; }
TEXGS_INLINE vm operator&(vm a, vm b) { return {static_cast<__mmask16>(a.v & b.v)}; }
TEXGS_INLINE vm operator|(vm a, vm b) { return {static_cast<__mmask16>(a.v | b.v)}; }
TEXGS_INLINE vm operator~(vm a) { return {static_cast<__mmask16>(~a.v)}; }
TEXGS_INLINE unsigned bits(vm m) { return m.v; }
TEXGS_INLINE vm mask_of(unsigned b) { return {static_cast<__mmask16>(b)}; }  // its lowest bits, one a lane
TEXGS_INLINE int count(vm m) { return static_cast<int>(_mm_popcnt_u32(m.v)); }
TEXGS_INLINE vf select(vm m, vf a, vf b) { return _mm512_mask_mov_ps(b.v, m.v, a.v); }
TEXGS_INLINE vf zero_unless(vm m, vf a) { return _mm512_maskz_mov_ps(m.v, a.v); }
// acc + a where m, acc elsewhere.
TEXGS_INLINE vf add_where(vm m, vf acc, vf a) { return _mm512_mask_add_ps(acc.v, m.v, acc.v, a.v); }
TEXGS_INLINE vf fma_where(vm m, vf a, vf b, vf acc) { return _mm512_mask3_fmadd_ps(a.v, b.v, acc.v, m.v); }

TEXGS_INLINE vi truncate(vf a) { return {_mm512_cvttps_epi32(a.v)}; }
TEXGS_INLINE vf to_float(vi a) { return _mm512_cvtepi32_ps(a.v); }
TEXGS_INLINE vi splat(int32_t a) { return {_mm512_set1_epi32(a)}; }
TEXGS_INLINE vi operator+(vi a, vi b) { return {_mm512_add_epi32(a.v, b.v)}; }
TEXGS_INLINE vi operator*(vi a, vi b) { return {_mm512_mullo_epi32(a.v, b.v)}; }
TEXGS_INLINE vi operator&(vi a, vi b) { return {_mm512_and_si512(a.v, b.v)}; }
TEXGS_INLINE vi operator>>(vi a, int n) { return {_mm512_srli_epi32(a.v, static_cast<unsigned>(n))}; }
// Whether bit 0 to 31 of each integer is set.
TEXGS_INLINE vm is_set(vi a, vi bit) { return {_mm512_test_epi32_mask(a.v, _mm512_sllv_epi32(_mm512_set1_epi32(1), bit.v))}; }
// Byte 0 to 3 of each integer, from the lowest on.
TEXGS_INLINE vi byte_of(vi a, vi place) {
    const __m512i moved = _mm512_srlv_epi32(a.v, _mm512_slli_epi32(place.v, 3));
    return {_mm512_and_si512(moved, _mm512_set1_epi32(255))};
}
TEXGS_INLINE vi gather_bytes(const void* p, vi i) { return {_mm512_i32gather_epi32(i.v, p, 1)}; }  // words at any byte
TEXGS_INLINE vi gather(const int32_t* p, vi i) { return {_mm512_i32gather_epi32(i.v, p, 4)}; }
TEXGS_INLINE vi iota() { return {_mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)}; }
TEXGS_INLINE vf gather(const float* p, vi i) { return _mm512_i32gather_ps(i.v, p, 4); }
TEXGS_INLINE float sum(vf a) { return _mm512_reduce_add_ps(a.v); }
TEXGS_INLINE float largest(vf a) { return _mm512_reduce_max_ps(a.v); }
TEXGS_INLINE vf round(vf a) { return _mm512_roundscale_ps(a.v, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC); }
// x 2^k for whole numbers k in [-126, 127].
TEXGS_INLINE vf scale_by_power(vf x, vf k) { return _mm512_scalef_ps(x.v, k.v); }
TEXGS_INLINE vf exponent(vf a) { return _mm512_getexp_ps(a.v); }
TEXGS_INLINE vf mantissa(vf a) { return _mm512_getmant_ps(a.v, _MM_MANT_NORM_1_2, _MM_MANT_SIGN_src); }

// Writes the lanes of `a` chosen by `m` one after the other; up to kLanes numbers at `p` may be overwritten.
TEXGS_INLINE void store_chosen(float* p, vf a, vm m) { store(p, _mm512_maskz_compress_ps(m.v, a.v)); }
TEXGS_INLINE void store_chosen(int32_t* p, vi a, vm m) { store(p, vi{_mm512_maskz_compress_epi32(m.v, a.v)}); }

// Lane i: the product of lanes 0 to i.
TEXGS_INLINE vf running_product(vf a) {
    const __m512i one = _mm512_castps_si512(_mm512_set1_ps(1.0f));
    a = a * vf(_mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512(a.v), one, 15)));
    a = a * vf(_mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512(a.v), one, 14)));
    a = a * vf(_mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512(a.v), one, 12)));
    return a * vf(_mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512(a.v), one, 8)));
}

// -- Tables in registers: up to kTableTexels floats, 16 to a plane ---------------------------------------------------

constexpr int kTableTexels = 64;
template <int Planes>
TEXGS_INLINE vf table_lookup(const float* p, vi index) {
    if constexpr (Planes == 1) return _mm512_permutexvar_ps(index.v, load(p).v);
    const __m512 low = _mm512_permutex2var_ps(load(p).v, index.v, load(p + 16).v);
    if constexpr (Planes == 2) return low;
    const __m512 high = _mm512_permutex2var_ps(load(p + 32).v, index.v, load(p + 48).v);
    return _mm512_mask_mov_ps(low, _mm512_test_epi32_mask(index.v, _mm512_set1_epi32(32)), high);
}
// Splits n <= 16 interleaved triples into three planes of 16.
TEXGS_INLINE void split_channels(const float* from, int n, float* x, float* y, float* z) {
    const auto part = [&](int first) {
        const int left = 3 * n - first;
        const unsigned mask = left >= 16 ? 0xffffu : left > 0 ? (1u << left) - 1 : 0;
        return _mm512_maskz_loadu_ps(static_cast<__mmask16>(mask), from + first);
    };
    const __m512 a = part(0), b = part(16), c = part(32);
    const __m512i triple = _mm512_mullo_epi32(iota().v, _mm512_set1_epi32(3));
    float* out[3] = {x, y, z};
    for (int k = 0; k < 3; ++k) {
        const __m512i index = _mm512_add_epi32(triple, _mm512_set1_epi32(k));
        const __m512 low = _mm512_permutex2var_ps(a, index, b);  // positions 0 to 31; above, modulo 32
        const __mmask16 high = _mm512_cmpge_epi32_mask(index, _mm512_set1_epi32(32));
        _mm512_storeu_ps(out[k], _mm512_mask_permutexvar_ps(low, high, index, c));
    }
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
// clang-format on
