// SPDX-License-Identifier: Apache-2.0
// Four lanes for any machine: SSE2 or NEON by way of the vector extension of GCC and Clang, else plain arrays. Included
// by simd.h alone.
#pragma once

// clang-format off: a table, one operation a line
namespace texgs::TEXGS_ISA {
namespace {

constexpr int kLanes = 4;
constexpr int kRegisters = 16;
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
TEXGS_INLINE vf load_quad(const float* p) { return load(p); }
TEXGS_INLINE void store_quad(float* p, vf a) { store(p, a); }
TEXGS_INLINE vf permute_quad(const float* p, const int32_t* index) { vf r; TEXGS_EACH r.v[i] = p[index[i]]; return r; }

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
TEXGS_INLINE vm mask_of(unsigned b) { vm m; TEXGS_EACH m.v[i] = -int32_t(b >> i & 1); return m; }
TEXGS_INLINE int count(vm m) { return -(m.v[0] + m.v[1] + m.v[2] + m.v[3]); }
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
TEXGS_INLINE vi operator&(vi a, vi b) { return {a.v & b.v}; }
TEXGS_INLINE vi operator>>(vi a, int n) { TEXGS_EACH a.v[i] = static_cast<int32_t>(static_cast<uint32_t>(a.v[i]) >> n); return a; }
TEXGS_INLINE vm is_set(vi a, vi bit) { vm r; TEXGS_EACH r.v[i] = -(a.v[i] >> bit.v[i] & 1); return r; }
TEXGS_INLINE vi byte_of(vi a, vi place) { TEXGS_EACH a.v[i] = a.v[i] >> 8 * place.v[i] & 255; return a; }
TEXGS_INLINE vi gather_bytes(const void* p, vi k) {  // words at any byte
    vi r;
    TEXGS_EACH { int32_t word; std::memcpy(&word, static_cast<const char*>(p) + k.v[i], 4); r.v[i] = word; }
    return r;
}
TEXGS_INLINE vi gather(const int32_t* p, vi k) { vi r; TEXGS_EACH r.v[i] = p[k.v[i]]; return r; }
TEXGS_INLINE vi iota() { return {int4{0, 1, 2, 3}}; }
TEXGS_INLINE vf gather(const float* p, vi k) { vf r; TEXGS_EACH r.v[i] = p[k.v[i]]; return r; }
TEXGS_INLINE float sum(vf a) { return (a.v[0] + a.v[2]) + (a.v[1] + a.v[3]); }
TEXGS_INLINE vf sums_of(const vf a[kLanes]) { vf r; TEXGS_EACH r.v[i] = sum(a[i]); return r; }
TEXGS_INLINE float largest(vf a) {
    float r = a.v[0];
    TEXGS_EACH r = a.v[i] > r ? a.v[i] : r;
    return r;
}
TEXGS_INLINE void store_chosen(float* p, vf a, vm m) { TEXGS_EACH *p = a.v[i], p -= m.v[i]; }
TEXGS_INLINE void store_chosen(int32_t* p, vi a, vm m) { TEXGS_EACH *p = a.v[i], p -= m.v[i]; }
TEXGS_INLINE vf running_product(vf a) { for (int i = 1; i < kLanes; ++i) a.v[i] = a.v[i] * a.v[i - 1]; return a; }
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

// There are no tables in registers: kTableTexels is 0.
constexpr int kTableTexels = 0;
template <int Planes>
TEXGS_INLINE vf table_lookup(const float* p, vi index) { return gather(p, index); }
TEXGS_INLINE void split_channels(const float*, int, float*, float*, float*) {}
#undef TEXGS_EACH

}  // namespace
}  // namespace texgs::TEXGS_ISA
// clang-format on
