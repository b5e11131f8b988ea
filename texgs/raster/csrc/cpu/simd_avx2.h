// SPDX-License-Identifier: Apache-2.0
// AVX2 with FMA: eight lanes, masks as vectors. Included by simd.h alone.
#pragma once

// clang-format off: a table, one operation a line
namespace texgs::TEXGS_ISA {
namespace {

constexpr int kLanes = 8;
constexpr int kRegisters = 16;
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
TEXGS_INLINE vf load_quad(const float* p) { return _mm256_zextps128_ps256(_mm_loadu_ps(p)); }
TEXGS_INLINE void store_quad(float* p, vf a) { _mm_storeu_ps(p, _mm256_castps256_ps128(a.v)); }
TEXGS_INLINE vf permute_quad(const float* p, const int32_t* index) { return _mm256_permutevar8x32_ps(load_quad(p).v, load(index).v); }

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
TEXGS_INLINE vm mask_of(unsigned b) {
    const __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    return {_mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(static_cast<int>(b)), bit), bit))};
}
TEXGS_INLINE int count(vm m) { return static_cast<int>(_mm_popcnt_u32(bits(m))); }
TEXGS_INLINE vf select(vm m, vf a, vf b) { return _mm256_blendv_ps(b.v, a.v, m.v); }
TEXGS_INLINE vf zero_unless(vm m, vf a) { return _mm256_and_ps(m.v, a.v); }
TEXGS_INLINE vf add_where(vm m, vf acc, vf a) { return acc + zero_unless(m, a); }
TEXGS_INLINE vf fma_where(vm m, vf a, vf b, vf acc) { return fma(zero_unless(m, a), b, acc); }

TEXGS_INLINE vi truncate(vf a) { return {_mm256_cvttps_epi32(a.v)}; }
TEXGS_INLINE vf to_float(vi a) { return _mm256_cvtepi32_ps(a.v); }
TEXGS_INLINE vi splat(int32_t a) { return {_mm256_set1_epi32(a)}; }
TEXGS_INLINE vi operator+(vi a, vi b) { return {_mm256_add_epi32(a.v, b.v)}; }
TEXGS_INLINE vi operator*(vi a, vi b) { return {_mm256_mullo_epi32(a.v, b.v)}; }
TEXGS_INLINE vi operator&(vi a, vi b) { return {_mm256_and_si256(a.v, b.v)}; }
TEXGS_INLINE vi operator>>(vi a, int n) { return {_mm256_srli_epi32(a.v, n)}; }
TEXGS_INLINE vm is_set(vi a, vi bit) {
    const __m256i sign = _mm256_sllv_epi32(a.v, _mm256_sub_epi32(_mm256_set1_epi32(31), bit.v));
    return {_mm256_castsi256_ps(_mm256_srai_epi32(sign, 31))};
}
TEXGS_INLINE vi byte_of(vi a, vi place) {
    const __m256i moved = _mm256_srlv_epi32(a.v, _mm256_slli_epi32(place.v, 3));
    return {_mm256_and_si256(moved, _mm256_set1_epi32(255))};
}
TEXGS_INLINE vi gather_bytes(const void* p, vi i) { return {_mm256_i32gather_epi32(static_cast<const int*>(p), i.v, 1)}; }  // words at any byte
TEXGS_INLINE vi gather(const int32_t* p, vi i) { return {_mm256_i32gather_epi32(p, i.v, 4)}; }
TEXGS_INLINE vi iota() { return {_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)}; }
TEXGS_INLINE vf gather(const float* p, vi i) { return _mm256_i32gather_ps(p, i.v, 4); }
TEXGS_INLINE float sum(vf a) {
    __m128 s = _mm_add_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
    s = _mm_add_ps(s, _mm_movehl_ps(s, s));
    return _mm_cvtss_f32(_mm_add_ss(s, _mm_movehdup_ps(s)));
}
// Lane k: the sum of a[k]. Rounds of halving add pairs of vectors after interleaving them, so that each keeps its own.
TEXGS_INLINE vf sums_of(const vf a[kLanes]) {
    const auto fold = [](__m256 x, __m256 y) { return _mm256_add_ps(_mm256_unpacklo_ps(x, y), _mm256_unpackhi_ps(x, y)); };
    const auto fold_pairs = [](__m256 x, __m256 y) { return _mm256_add_ps(_mm256_shuffle_ps(x, y, 0x44), _mm256_shuffle_ps(x, y, 0xee)); };
    const __m256 low = fold_pairs(fold(a[0].v, a[1].v), fold(a[2].v, a[3].v));
    const __m256 high = fold_pairs(fold(a[4].v, a[5].v), fold(a[6].v, a[7].v));
    return _mm256_add_ps(_mm256_permute2f128_ps(low, high, 0x20), _mm256_permute2f128_ps(low, high, 0x31));
}
TEXGS_INLINE float largest(vf a) {
    __m128 s = _mm_max_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1));
    s = _mm_max_ps(s, _mm_movehl_ps(s, s));
    return _mm_cvtss_f32(_mm_max_ss(s, _mm_movehdup_ps(s)));
}
TEXGS_INLINE vf scale_by_power(vf x, vf k) {  // adds to the exponent of x: what comes out is normal, too
    const __m256i e = _mm256_slli_epi32(_mm256_cvtps_epi32(k.v), 23);
    return _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(x.v), e));
}
TEXGS_INLINE vf exponent(vf a) {  // a > 0, normal
    const __m256i e = _mm256_srli_epi32(_mm256_castps_si256(a.v), 23);
    return _mm256_cvtepi32_ps(_mm256_sub_epi32(e, _mm256_set1_epi32(127)));
}
TEXGS_INLINE vf mantissa(vf a) {
    const __m256i m = _mm256_and_si256(_mm256_castps_si256(a.v), _mm256_set1_epi32(0x007fffff));
    return _mm256_castsi256_ps(_mm256_or_si256(m, _mm256_set1_epi32(0x3f800000)));
}

// For each mask of eight bits, the places of those set, then of the others.
struct Orders {
    uint8_t of[256][8] = {};
    constexpr Orders() {
        for (int mask = 0; mask < 256; ++mask) {
            int n = 0;
            for (int wanted = 1; wanted >= 0; --wanted)
                for (int i = 0; i < 8; ++i)
                    if ((mask >> i & 1) == wanted) of[mask][n++] = static_cast<uint8_t>(i);
        }
    }
};
constexpr Orders kOrders;
TEXGS_INLINE __m256i chosen_first(vm m) { return _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(kOrders.of[bits(m)]))); }
TEXGS_INLINE void store_chosen(float* p, vf a, vm m) { store(p, _mm256_permutevar8x32_ps(a.v, chosen_first(m))); }
TEXGS_INLINE void store_chosen(int32_t* p, vi a, vm m) { store(p, vi{_mm256_permutevar8x32_epi32(a.v, chosen_first(m))}); }

TEXGS_INLINE vf running_product(vf a) {
    const __m256 one = _mm256_set1_ps(1.0f);
    a = a * vf(_mm256_blend_ps(_mm256_permutevar8x32_ps(a.v, _mm256_setr_epi32(0, 0, 1, 2, 3, 4, 5, 6)), one, 0x01));
    a = a * vf(_mm256_blend_ps(_mm256_permutevar8x32_ps(a.v, _mm256_setr_epi32(0, 0, 0, 1, 2, 3, 4, 5)), one, 0x03));
    return a * vf(_mm256_blend_ps(_mm256_permutevar8x32_ps(a.v, _mm256_setr_epi32(0, 0, 0, 0, 0, 1, 2, 3)), one, 0x0f));
}

// -- Tables in registers: up to kTableTexels floats, 16 to a plane ---------------------------------------------------

constexpr int kTableTexels = 64;
template <int Planes>
TEXGS_INLINE vf table_lookup(const float* p, vi index) {
    if constexpr (Planes > 1) {  // the highest bit of the index picks a half of the table
        constexpr int half = Planes / 2;
        const vf first = table_lookup<half>(p, index), second = table_lookup<half>(p + 16 * half, index);
        return _mm256_blendv_ps(first.v, second.v, _mm256_castsi256_ps(_mm256_slli_epi32(index.v, Planes == 2 ? 27 : 26)));
    }
    const __m256 low = _mm256_permutevar8x32_ps(load(p).v, index.v), high = _mm256_permutevar8x32_ps(load(p + 8).v, index.v);
    return _mm256_blendv_ps(low, high, _mm256_castsi256_ps(_mm256_slli_epi32(index.v, 28)));  // bit 3 to the sign
}
// Splits n <= 16 interleaved triples into three planes of 16.
TEXGS_INLINE void split_channels(const float* from, int n, float* x, float* y, float* z) {
    for (int i = 0; i < n; ++i) x[i] = from[3 * i], y[i] = from[3 * i + 1], z[i] = from[3 * i + 2];
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
// clang-format on
