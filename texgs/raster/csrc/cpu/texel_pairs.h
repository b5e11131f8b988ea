// SPDX-License-Identifier: Apache-2.0
// Bilinear lookup in textures too large for registers, pixel by pixel: the four texels of a fragment are two rows of
// six floats, and one multiply-add weighs all of them. Gathers take a load for each of the twelve floats instead.
#pragma once
#include "texture.h"

#if defined(TEXGS_AVX512)
namespace texgs::TEXGS_ISA {
namespace {

struct alignas(64) TexelPairs {
    float sums[kLanes][16];    // of each pixel: two rows of (left RGB, right RGB, 0, 0)
    float weights[4][kLanes];  // of one vector of fragments: quads of pixel 4 q + p at [p][4 q]
    int32_t first[kLanes];     // their first texels
    bool is_used;

    TEXGS_INLINE void clear() {
        is_used = false;
        std::memset(sums, 0, sizeof sums);
    }

    // Adds a surfel's texels times `w`.
    TEXGS_INLINE void add(const TextureTable& t, vi texel, vf fx, vf fy, vf w) {
        is_used = true;
        const vf below = w * fy, above = w - below, above_right = above * fx, below_right = below * fx;
        store_quads(above - above_right, above_right, below - below_right, below_right);
        store(first, texel);
        const auto row = static_cast<__mmask8>(t.x.step ? 0x3f : 0x07);
        const __m512i spread = _mm512_setr_epi32(0, 0, 0, 1, 1, 1, 0, 0, 2, 2, 2, 3, 3, 3, 0, 0);
        for (int i = 0; i < kLanes; ++i) {
            const float* upper = t.texels + 3 * int64_t(first[i]);
            const __m256 a = _mm256_maskz_loadu_ps(row, upper), b = _mm256_maskz_loadu_ps(row, upper + 3 * t.y.step);
            const __m512 texels = _mm512_insertf32x8(_mm512_castps256_ps512(a), b, 1);
            const __m512 quad = _mm512_broadcast_f32x4(_mm_load_ps(weights[i & 3] + (i & ~3)));
            store(sums[i], fma(_mm512_permutevar_ps(quad, spread), texels, load(sums[i])));
        }
    }

    // What a channel adds up to.
    TEXGS_INLINE vf sum_of(int channel) const {
        const vi at = iota() * splat(16);
        const float* from = sums[0] + channel;
        return gather(from, at) + gather(from + 3, at) + gather(from + 8, at) + gather(from + 11, at);
    }

private:
    TEXGS_INLINE void store_quads(vf a, vf b, vf c, vf d) {
        const __m512d low = _mm512_castps_pd(_mm512_unpacklo_ps(a.v, b.v)),
                      high = _mm512_castps_pd(_mm512_unpackhi_ps(a.v, b.v));
        const __m512d low2 = _mm512_castps_pd(_mm512_unpacklo_ps(c.v, d.v)),
                      high2 = _mm512_castps_pd(_mm512_unpackhi_ps(c.v, d.v));
        store(weights[0], _mm512_castpd_ps(_mm512_unpacklo_pd(low, low2)));
        store(weights[1], _mm512_castpd_ps(_mm512_unpackhi_pd(low, low2)));
        store(weights[2], _mm512_castpd_ps(_mm512_unpacklo_pd(high, high2)));
        store(weights[3], _mm512_castpd_ps(_mm512_unpackhi_pd(high, high2)));
    }
};

}  // namespace
}  // namespace texgs::TEXGS_ISA
#endif
