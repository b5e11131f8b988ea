// SPDX-License-Identifier: Apache-2.0
// One vector vocabulary for every instruction set: `vf` (floats), `vi` (32-bit integers), `vm` (lane mask).
//
// A kernel file includes this header, is compiled once per instruction set (see CMakeLists.txt) and puts its code
// in namespace texgs::TEXGS_ISA. Everything here has internal linkage, so that no instance compiled for AVX-512
// can be picked by the linker for a machine without it; for the same reason kernel files use no std:: templates.
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#if defined(TEXGS_AVX512) || defined(TEXGS_AVX2)
#if defined(__GNUC__) && !defined(__clang__)  // GCC 12 takes its own _mm512_undefined_ps() for a mistake
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#include <immintrin.h>
#pragma GCC diagnostic pop
#else
#include <immintrin.h>
#endif
#endif

#if defined(_MSC_VER) && !defined(__clang__)
#define TEXGS_INLINE __forceinline
#else
#define TEXGS_INLINE inline __attribute__((always_inline))
#endif

#if defined(__GNUC__)
#define TEXGS_PREFETCH(p) __builtin_prefetch(p)
#elif defined(TEXGS_AVX2) || defined(TEXGS_AVX512)
#define TEXGS_PREFETCH(p) _mm_prefetch(reinterpret_cast<const char*>(p), _MM_HINT_T0)
#else
#define TEXGS_PREFETCH(p) static_cast<void>(p)
#endif

namespace texgs::TEXGS_ISA {
namespace {

#if defined(TEXGS_AVX512)

constexpr int kLanes = 16;
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
TEXGS_INLINE vi iota() { return {_mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)}; }
TEXGS_INLINE vf gather(const float* p, vi i) { return _mm512_i32gather_ps(i.v, p, 4); }
TEXGS_INLINE float sum(vf a) { return _mm512_reduce_add_ps(a.v); }
TEXGS_INLINE float largest(vf a) { return _mm512_reduce_max_ps(a.v); }
TEXGS_INLINE vf round(vf a) { return _mm512_roundscale_ps(a.v, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC); }
// x 2^k for whole numbers k in [-126, 127].
TEXGS_INLINE vf scale_by_power(vf x, vf k) { return _mm512_scalef_ps(x.v, k.v); }
TEXGS_INLINE vf exponent(vf a) { return _mm512_getexp_ps(a.v); }
TEXGS_INLINE vf mantissa(vf a) { return _mm512_getmant_ps(a.v, _MM_MANT_NORM_1_2, _MM_MANT_SIGN_src); }

#elif defined(TEXGS_AVX2)

constexpr int kLanes = 8;
struct vm {
    __m256 v;
};
struct vi {
    __m256i v;
};
struct vf {
    __m256 v;
    vf() = default;
    TEXGS_INLINE vf(__m256 x) : v(x) {}
    TEXGS_INLINE vf(float x) : v(_mm256_set1_ps(x)) {}
};

TEXGS_INLINE vf load(const float* p) { return _mm256_loadu_ps(p); }
TEXGS_INLINE void store(float* p, vf a) { _mm256_storeu_ps(p, a.v); }
TEXGS_INLINE void stream(float* p, vf a) { _mm256_stream_ps(p, a.v); }  // p: 32-byte aligned
TEXGS_INLINE void stream_fence() { _mm_sfence(); }
TEXGS_INLINE vi load(const int32_t* p) { return {_mm256_loadu_si256(reinterpret_cast<const __m256i*>(p))}; }
TEXGS_INLINE void store(int32_t* p, vi a) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), a.v); }
TEXGS_INLINE __m256i first_lanes(int n) {
    return _mm256_cmpgt_epi32(_mm256_set1_epi32(n), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
}
TEXGS_INLINE vf load_part(const float* p, int n) { return _mm256_maskload_ps(p, first_lanes(n)); }
TEXGS_INLINE void store_part(float* p, vf a, int n) {
    if (n == 8) return store(p, a);  // masked stores are slow
    _mm256_maskstore_ps(p, first_lanes(n), a.v);
}

TEXGS_INLINE vf operator+(vf a, vf b) { return _mm256_add_ps(a.v, b.v); }
TEXGS_INLINE vf operator-(vf a, vf b) { return _mm256_sub_ps(a.v, b.v); }
TEXGS_INLINE vf operator*(vf a, vf b) { return _mm256_mul_ps(a.v, b.v); }
TEXGS_INLINE vf operator/(vf a, vf b) { return _mm256_div_ps(a.v, b.v); }
TEXGS_INLINE vf fma(vf a, vf b, vf c) { return _mm256_fmadd_ps(a.v, b.v, c.v); }
TEXGS_INLINE vf fnma(vf a, vf b, vf c) { return _mm256_fnmadd_ps(a.v, b.v, c.v); }
TEXGS_INLINE vf min(vf a, vf b) { return _mm256_min_ps(a.v, b.v); }
TEXGS_INLINE vf max(vf a, vf b) { return _mm256_max_ps(a.v, b.v); }
TEXGS_INLINE vf sqrt(vf a) { return _mm256_sqrt_ps(a.v); }
TEXGS_INLINE vf abs(vf a) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a.v); }
TEXGS_INLINE vf floor(vf a) { return _mm256_floor_ps(a.v); }
TEXGS_INLINE vf round(vf a) { return _mm256_round_ps(a.v, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC); }

TEXGS_INLINE vm operator<(vf a, vf b) { return {_mm256_cmp_ps(a.v, b.v, _CMP_LT_OQ)}; }
TEXGS_INLINE vm operator<=(vf a, vf b) { return {_mm256_cmp_ps(a.v, b.v, _CMP_LE_OQ)}; }
TEXGS_INLINE vm operator&(vm a, vm b) { return {_mm256_and_ps(a.v, b.v)}; }
TEXGS_INLINE vm operator|(vm a, vm b) { return {_mm256_or_ps(a.v, b.v)}; }
TEXGS_INLINE vm operator~(vm a) { return {_mm256_xor_ps(a.v, _mm256_castsi256_ps(_mm256_set1_epi32(-1)))}; }
TEXGS_INLINE unsigned bits(vm m) { return static_cast<unsigned>(_mm256_movemask_ps(m.v)); }
TEXGS_INLINE vf select(vm m, vf a, vf b) { return _mm256_blendv_ps(b.v, a.v, m.v); }
TEXGS_INLINE vf zero_unless(vm m, vf a) { return _mm256_and_ps(m.v, a.v); }
TEXGS_INLINE vf add_where(vm m, vf acc, vf a) { return acc + zero_unless(m, a); }
TEXGS_INLINE vf fma_where(vm m, vf a, vf b, vf acc) { return fma(zero_unless(m, a), b, acc); }

TEXGS_INLINE vi truncate(vf a) { return {_mm256_cvttps_epi32(a.v)}; }
TEXGS_INLINE vf to_float(vi a) { return _mm256_cvtepi32_ps(a.v); }
TEXGS_INLINE vi splat(int32_t a) { return {_mm256_set1_epi32(a)}; }
TEXGS_INLINE vi operator+(vi a, vi b) { return {_mm256_add_epi32(a.v, b.v)}; }
TEXGS_INLINE vi operator*(vi a, vi b) { return {_mm256_mullo_epi32(a.v, b.v)}; }
TEXGS_INLINE vi iota() { return {_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)}; }
TEXGS_INLINE vf gather(const float* p, vi i) { return _mm256_i32gather_ps(p, i.v, 4); }
TEXGS_INLINE float sum(vf a) {
    __m128 s = _mm_add_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
    s = _mm_add_ps(s, _mm_movehl_ps(s, s));
    return _mm_cvtss_f32(_mm_add_ss(s, _mm_movehdup_ps(s)));
}
TEXGS_INLINE float largest(vf a) {
    __m128 s = _mm_max_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
    s = _mm_max_ps(s, _mm_movehl_ps(s, s));
    return _mm_cvtss_f32(_mm_max_ss(s, _mm_movehdup_ps(s)));
}
TEXGS_INLINE vf scale_by_power(vf x, vf k) {  // k in [-126, 127]
    const __m256i e = _mm256_slli_epi32(_mm256_add_epi32(_mm256_cvtps_epi32(k.v), _mm256_set1_epi32(127)), 23);
    return _mm256_mul_ps(x.v, _mm256_castsi256_ps(e));
}
TEXGS_INLINE vf exponent(vf a) {  // a > 0, normal
    const __m256i e = _mm256_srli_epi32(_mm256_castps_si256(a.v), 23);
    return _mm256_cvtepi32_ps(_mm256_sub_epi32(e, _mm256_set1_epi32(127)));
}
TEXGS_INLINE vf mantissa(vf a) {
    const __m256i m = _mm256_and_si256(_mm256_castps_si256(a.v), _mm256_set1_epi32(0x007fffff));
    return _mm256_castsi256_ps(_mm256_or_si256(m, _mm256_set1_epi32(0x3f800000)));
}

#else  // Portable: four lanes, SSE2 or NEON by way of the vector extension of GCC and Clang.

constexpr int kLanes = 4;
#define TEXGS_EACH for (int i = 0; i < kLanes; ++i)

#if defined(__GNUC__)
typedef float float4 __attribute__((vector_size(16)));
typedef int32_t int4 __attribute__((vector_size(16)));
TEXGS_INLINE float4 choose(int4 m, float4 a, float4 b) { return (float4)((m & (int4)a) | (~m & (int4)b)); }
#else  // plain arrays for other compilers
template <class T>
struct Four {
    T e[4];
    TEXGS_INLINE T& operator[](int i) { return e[i]; }
    TEXGS_INLINE T operator[](int i) const { return e[i]; }
};
using float4 = Four<float>;
using int4 = Four<int32_t>;
#define TEXGS_OPERATOR(T, R, op) \
    TEXGS_INLINE R operator op(T a, T b) { R r; TEXGS_EACH r[i] = a[i] op b[i]; return r; }
#define TEXGS_COMPARISON(op) \
    TEXGS_INLINE int4 operator op(float4 a, float4 b) { int4 r; TEXGS_EACH r[i] = -(a[i] op b[i]); return r; }
TEXGS_OPERATOR(float4, float4, +) TEXGS_OPERATOR(float4, float4, -) TEXGS_OPERATOR(float4, float4, *)
TEXGS_OPERATOR(float4, float4, /) TEXGS_OPERATOR(int4, int4, +) TEXGS_OPERATOR(int4, int4, *)
TEXGS_OPERATOR(int4, int4, &) TEXGS_OPERATOR(int4, int4, |) TEXGS_COMPARISON(<) TEXGS_COMPARISON(<=)
TEXGS_INLINE int4 operator~(int4 a) { TEXGS_EACH a[i] = ~a[i]; return a; }
TEXGS_INLINE float4 choose(int4 m, float4 a, float4 b) { TEXGS_EACH a[i] = m[i] ? a[i] : b[i]; return a; }
#undef TEXGS_OPERATOR
#undef TEXGS_COMPARISON
#endif

struct vm {
    int4 v;
};
struct vi {
    int4 v;
};
struct vf {
    float4 v;
    vf() = default;
    TEXGS_INLINE vf(float4 x) : v(x) {}
    TEXGS_INLINE vf(float x) : v{x, x, x, x} {}
};

TEXGS_INLINE vf load(const float* p) { vf r; std::memcpy(&r.v, p, sizeof r.v); return r; }
TEXGS_INLINE void store(float* p, vf a) { std::memcpy(p, &a.v, sizeof a.v); }
TEXGS_INLINE void stream(float* p, vf a) { store(p, a); }
TEXGS_INLINE void stream_fence() {}
TEXGS_INLINE vi load(const int32_t* p) { vi r; std::memcpy(&r.v, p, sizeof r.v); return r; }
TEXGS_INLINE void store(int32_t* p, vi a) { std::memcpy(p, &a.v, sizeof a.v); }
// The first n lanes, 0 <= n <= kLanes; the rest of the vector is 0.
TEXGS_INLINE vf load_part(const float* p, int n) { vf r = 0.0f; std::memcpy(&r.v, p, n * sizeof(float)); return r; }
TEXGS_INLINE void store_part(float* p, vf a, int n) { std::memcpy(p, &a.v, n * sizeof(float)); }

TEXGS_INLINE vf operator+(vf a, vf b) { return a.v + b.v; }
TEXGS_INLINE vf operator-(vf a, vf b) { return a.v - b.v; }
TEXGS_INLINE vf operator*(vf a, vf b) { return a.v * b.v; }
TEXGS_INLINE vf operator/(vf a, vf b) { return a.v / b.v; }
TEXGS_INLINE vf fma(vf a, vf b, vf c) { return a.v * b.v + c.v; }
TEXGS_INLINE vf fnma(vf a, vf b, vf c) { return c.v - a.v * b.v; }
TEXGS_INLINE vm operator<(vf a, vf b) { return {a.v < b.v}; }
TEXGS_INLINE vm operator<=(vf a, vf b) { return {a.v <= b.v}; }
TEXGS_INLINE vm operator&(vm a, vm b) { return {a.v & b.v}; }
TEXGS_INLINE vm operator|(vm a, vm b) { return {a.v | b.v}; }
TEXGS_INLINE vm operator~(vm a) { return {~a.v}; }
TEXGS_INLINE unsigned bits(vm m) {
    return (m.v[0] & 1u) | (m.v[1] & 2u) | (m.v[2] & 4u) | (m.v[3] & 8u);
}
TEXGS_INLINE vf select(vm m, vf a, vf b) { return choose(m.v, a.v, b.v); }
TEXGS_INLINE vf min(vf a, vf b) { return select(a < b, a, b); }
TEXGS_INLINE vf max(vf a, vf b) { return select(b < a, a, b); }
TEXGS_INLINE vf sqrt(vf a) { TEXGS_EACH a.v[i] = std::sqrt(a.v[i]); return a; }
TEXGS_INLINE vf abs(vf a) { return max(a, vf(0.0f) - a); }
// Adding and taking away 1.5 2^23 rounds to the nearest whole number for |a| < 2^22.
TEXGS_INLINE vf round(vf a) { const vf big = 12582912.0f; return (a + big) - big; }
TEXGS_INLINE vf floor(vf a) { TEXGS_EACH a.v[i] = std::floor(a.v[i]); return a; }
TEXGS_INLINE vf zero_unless(vm m, vf a) { return select(m, a, 0.0f); }
TEXGS_INLINE vf add_where(vm m, vf acc, vf a) { return acc + zero_unless(m, a); }
TEXGS_INLINE vf fma_where(vm m, vf a, vf b, vf acc) { return fma(zero_unless(m, a), b, acc); }

TEXGS_INLINE vi truncate(vf a) { vi r; TEXGS_EACH r.v[i] = static_cast<int32_t>(a.v[i]); return r; }
TEXGS_INLINE vf to_float(vi a) { vf r; TEXGS_EACH r.v[i] = static_cast<float>(a.v[i]); return r; }
TEXGS_INLINE vi splat(int32_t a) { return {int4{a, a, a, a}}; }
TEXGS_INLINE vi operator+(vi a, vi b) { return {a.v + b.v}; }
TEXGS_INLINE vi operator*(vi a, vi b) { return {a.v * b.v}; }
TEXGS_INLINE vi iota() { return {int4{0, 1, 2, 3}}; }
TEXGS_INLINE vf gather(const float* p, vi k) { vf r; TEXGS_EACH r.v[i] = p[k.v[i]]; return r; }
TEXGS_INLINE float sum(vf a) { return (a.v[0] + a.v[2]) + (a.v[1] + a.v[3]); }
TEXGS_INLINE float largest(vf a) {
    float r = a.v[0];
    TEXGS_EACH r = a.v[i] > r ? a.v[i] : r;
    return r;
}
// Lanes as integers of the same bits, and back.
TEXGS_INLINE int4 as_int(vf a) { int4 r; std::memcpy(&r, &a.v, sizeof r); return r; }
TEXGS_INLINE vf as_float(int4 a) { vf r; std::memcpy(&r.v, &a, sizeof a); return r; }
TEXGS_INLINE vf scale_by_power(vf x, vf k) {  // k in [-126, 127]
    const vi e = (truncate(k) + splat(127)) * splat(1 << 23);
    return x * as_float(e.v);
}
TEXGS_INLINE vf exponent(vf a) {  // a > 0, normal
    int4 e = as_int(a);
    TEXGS_EACH e[i] = (e[i] >> 23) - 127;
    return to_float({e});
}
TEXGS_INLINE vf mantissa(vf a) {
    return as_float((as_int(a) & splat(0x007fffff).v) | splat(0x3f800000).v);
}
#undef TEXGS_EACH

#endif

// Writes the lanes of `a` chosen by `m` one after the other; up to kLanes floats at `p` may be overwritten.
TEXGS_INLINE void store_chosen(float* p, vf a, vm m) {
#if defined(TEXGS_AVX512)
    _mm512_storeu_ps(p, _mm512_maskz_compress_ps(m.v, a.v));
#else
    float lanes[kLanes];
    store(lanes, a);
    const unsigned chosen = bits(m);
    for (int i = 0; i < kLanes; ++i) {
        *p = lanes[i];
        p += chosen >> i & 1;
    }
#endif
}
TEXGS_INLINE int count(vm m) { return std::popcount(bits(m)); }

TEXGS_INLINE void prefetch(const void* p) { TEXGS_PREFETCH(p); }

TEXGS_INLINE vf operator-(vf a) { return vf(0.0f) - a; }
TEXGS_INLINE vf& operator+=(vf& a, vf b) { return a = a + b; }
TEXGS_INLINE vf& operator-=(vf& a, vf b) { return a = a - b; }
TEXGS_INLINE vf& operator*=(vf& a, vf b) { return a = a * b; }
TEXGS_INLINE vm operator>(vf a, vf b) { return b < a; }
TEXGS_INLINE vm operator>=(vf a, vf b) { return b <= a; }
TEXGS_INLINE bool any(vm m) { return bits(m) != 0; }

// 2^x, relative error below 3e-7 for x in [-126, 127]; below that 2^-126. The polynomial (degree 5, least relative error on
// an interval of length 1) is evaluated in pairs: its latency, not its operations, is what a loop waits for.
TEXGS_INLINE vf polynomial(vf x, vf c0, vf c1, vf c2, vf c3, vf c4, vf c5) {
    const vf x2 = x * x;
    return fma(fma(fma(c5, x, c4), x2, fma(c3, x, c2)), x2, fma(c1, x, c0));
}
TEXGS_INLINE vf exp2(vf x) {
    x = max(x, -126.0f);
    const vf k = round(x), f = x - k;  // f in [-0.5, 0.5]
    const vf p = polynomial(f, 1.0000000716546849f, 6.931469670647613e-1f, 2.402211972384010e-1f,
                            5.550713273496898e-2f, 9.675541334449414e-3f, 1.327647199285195e-3f);
    return scale_by_power(p, k);
}

// log2(x) for normal x > 0, absolute error below 4e-7.
TEXGS_INLINE vf log2(vf x) {
    vf e = exponent(x), m = mantissa(x);
    const vm upper = m > vf(1.41421356f);
    m = select(upper, m * vf(0.5f), m);
    e = select(upper, e + vf(1.0f), e);
    const vf s = (m - vf(1.0f)) / (m + vf(1.0f)), s2 = s * s;  // log2(m) = 2/ln2 atanh(s), |s| < 0.172
    vf p = 0.412198583f;
    p = fma(p, s2, 0.577078016f);
    p = fma(p, s2, 0.961796694f);
    p = fma(p, s2, 2.885390082f);
    return fma(p, s, e);
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
