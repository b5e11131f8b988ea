// SPDX-License-Identifier: Apache-2.0
// One vector vocabulary for every instruction set: `vf` (floats), `vi` (32-bit integers), `vm` (lane mask).
//
// A kernel file includes this header, is compiled once per instruction set (see CMakeLists.txt) and puts its code
// in namespace texgs::TEXGS_ISA. Everything here has internal linkage, so that no instance compiled for AVX-512
// can be picked by the linker for a machine without it; for the same reason kernel files use no std:: templates.
#pragma once
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

#if defined(TEXGS_AVX512)
#include "simd_avx512.h"
#elif defined(TEXGS_AVX2)
#include "simd_avx2.h"
#else
#include "simd_portable.h"
#endif

namespace texgs::TEXGS_ISA {
namespace {

// Copies four numbers as floats.
template <class T>
TEXGS_INLINE void copy_quad(float* to, const T* from) {
    const float quad[4] = {float(from[0]), float(from[1]), float(from[2]), float(from[3])};
    std::memcpy(to, quad, sizeof quad);
}
#if defined(TEXGS_AVX512) || defined(TEXGS_AVX2)  // compilers convert small numbers one by one
TEXGS_INLINE __m128i load_word(const void* p) {
    int32_t word;
    std::memcpy(&word, p, sizeof word);
    return _mm_cvtsi32_si128(word);
}
TEXGS_INLINE __m128i load_two_words(const void* p) { return _mm_loadl_epi64(static_cast<const __m128i*>(p)); }
TEXGS_INLINE void copy_quad(float* to, const uint8_t* from) {
    _mm_storeu_ps(to, _mm_cvtepi32_ps(_mm_cvtepu8_epi32(load_word(from))));
}
TEXGS_INLINE void copy_quad(float* to, const int8_t* from) {
    _mm_storeu_ps(to, _mm_cvtepi32_ps(_mm_cvtepi8_epi32(load_word(from))));
}
TEXGS_INLINE void copy_quad(float* to, const uint16_t* from) {
    _mm_storeu_ps(to, _mm_cvtepi32_ps(_mm_cvtepu16_epi32(load_two_words(from))));
}
TEXGS_INLINE void copy_quad(float* to, const int16_t* from) {
    _mm_storeu_ps(to, _mm_cvtepi32_ps(_mm_cvtepi16_epi32(load_two_words(from))));
}
#endif

TEXGS_INLINE void prefetch(const void* p) { TEXGS_PREFETCH(p); }

TEXGS_INLINE vf operator-(vf a) { return vf(0.0f) - a; }
TEXGS_INLINE vf& operator+=(vf& a, vf b) { return a = a + b; }
TEXGS_INLINE vf& operator-=(vf& a, vf b) { return a = a - b; }
TEXGS_INLINE vf& operator*=(vf& a, vf b) { return a = a * b; }
TEXGS_INLINE vm operator>(vf a, vf b) { return b < a; }
TEXGS_INLINE vm operator>=(vf a, vf b) { return b <= a; }
TEXGS_INLINE bool any(vm m) { return bits(m) != 0; }

// 2^x, relative error below 3e-7 for x in [-126, 127]; below that and for NaN 2^-126. The polynomial (degree 5, least
// relative error on an interval of length 1) is evaluated in pairs: its latency, not its operations, is what a loop
// waits for.
TEXGS_INLINE vf polynomial(vf x, vf c0, vf c1, vf c2, vf c3, vf c4, vf c5) {
    const vf x2 = x * x;
    return fma(fma(fma(c5, x, c4), x2, fma(c3, x, c2)), x2, fma(c1, x, c0));
}
TEXGS_INLINE vf exp2(vf x) {
    x = max(x, -126.0f);
    const vf k = round(x), f = x - k;  // f in [-0.5, 0.5]
    const vf p = polynomial(f, 1.0000000716546849f, 6.931469670647613e-1f, 2.402211972384010e-1f, 5.550713273496898e-2f,
                            9.675541334449414e-3f, 1.327647199285195e-3f);
    return scale_by_power(p, k);
}
TEXGS_INLINE vf exp2_or_nan(vf x) { return select(x <= x, exp2(x), x); }

TEXGS_INLINE vf exp(vf x) { return exp2_or_nan(min(vf(127.0f), vf(1.44269504f) * x)); }  // at most 2^127
TEXGS_INLINE vf sigmoid(vf x) { return vf(1.0f) / (vf(1.0f) + exp(-x)); }

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
