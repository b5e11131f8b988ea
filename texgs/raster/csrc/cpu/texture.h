// SPDX-License-Identifier: Apache-2.0
// Bilinear lookup in the texture of one surfel for a vector of fragments.
//
// A gather costs a load per lane and channel. With AVX-512, textures of up to 64 texels are looked up in registers
// instead: one permute serves 16 texels of a channel for all lanes. They are brought into planes of 16 when their
// tile is staged; larger textures, and other instruction sets, gather from the atlas.
#pragma once
#include "fragment.h"

namespace texgs::TEXGS_ISA {
namespace {

#if defined(TEXGS_AVX512)
constexpr int kRegisterTexels = 64;
#else
constexpr int kRegisterTexels = 0;
#endif

// Vectors of 16 that a channel of so many texels takes; 0: it is gathered.
TEXGS_INLINE int registers_for(int texels) {
    return texels > kRegisterTexels ? 0 : texels <= 16 ? 1 : texels <= 32 ? 2 : 4;
}

// Coordinates along one side of a texture: clamp(scale * u + offset, 0, last), between texels `cell` and `cell + 1`.
struct Side {
    float scale, offset, last;
    float last_cell;  // of the cells between texel centres; 0 where there is only one texel
    int32_t step;     // to the next texel; 0 where there is only one

    void set(int texels, int stride) {
        scale = static_cast<float>(texels) / 6.0f;  // the texture spans +-3 standard deviations
        last = static_cast<float>(texels - 1);
        offset = 0.5f * last;
        last_cell = static_cast<float>(texels > 1 ? texels - 2 : 0);
        step = texels > 1 ? stride : 0;
    }
};

struct TextureTable {
    const float* texels;  // planes of 16 * registers per channel, or interleaved [n, 3]
    int registers;        // 1, 2 or 4 per channel; 0: gather
    float columns, rows, gain;
    Side x, y;
};

struct alignas(64) TextureTables {
    TextureTable of[kChunk];
    float planes[kChunk * 3 * kRegisterTexels + 16];

    // Sizes and gains of the chunk's first n surfels.
    void stage_layout(const Raster& r, const Chunk& chunk, int n);
    // The same and the texels.
    void stage(const Raster& r, const Chunk& chunk, int n);
};

#if defined(TEXGS_AVX512)
// Splits 16 interleaved texels at `from`, `n` of them real, into three vectors.
TEXGS_INLINE void deinterleave(const float* from, int n, float* x, float* y, float* z) {
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
#endif

inline void TextureTables::stage_layout(const Raster& r, const Chunk& chunk, int n) {
    for (int i = 0; i < n; ++i) {
        const int64_t id = chunk.surfels[i];
        const int columns = r.surfels.sizes[2 * id], rows = r.surfels.sizes[2 * id + 1];
        TextureTable& t = of[i];
        t.texels = r.surfels.texels + 3 * r.surfels.offsets[id];
        t.columns = static_cast<float>(columns), t.rows = static_cast<float>(rows), t.gain = r.surfels.gain[id];
        t.x.set(columns, 1), t.y.set(rows, columns);
        t.registers = registers_for(columns * rows);
    }
}

inline void TextureTables::stage(const Raster& r, const Chunk& chunk, int n) {
    stage_layout(r, chunk, n);
#if defined(TEXGS_AVX512)
    constexpr int ahead = 8;  // texels lie anywhere
    for (int i = 0; i < n; ++i) {
        TextureTable& t = of[i];
        if (i + ahead < n)
            for (int k = 0; k < 3 * of[i + ahead].registers; ++k) prefetch(of[i + ahead].texels + 16 * k);
        if (!t.registers) continue;
        const int count = static_cast<int>(t.columns * t.rows), plane = 16 * t.registers;
        float* to = planes + i * 3 * kRegisterTexels;
        for (int k = 0; k < count; k += 16)
            deinterleave(t.texels + 3 * k, count - k, to + k, to + plane + k, to + 2 * plane + k);
        t.texels = to;
    }
#endif
}

// Where fragments fall in a texture: the first of four texels, and the weights of its neighbours along x and y.
struct TexelCoordinates {
    vf x, y;            // in [0, columns - 1], [0, rows - 1]
    vi first;
    vf fx, fy;
    vm free_x, free_y;  // not clamped at the border: coordinates still move with u and v
};

TEXGS_INLINE TexelCoordinates texel_coordinates(const TextureTable& t, vf u, vf v) {
    TexelCoordinates c;
    const vf raw_x = fma(u, t.x.scale, t.x.offset), raw_y = fma(v, t.y.scale, t.y.offset);
    c.x = min(max(raw_x, 0.0f), t.x.last), c.y = min(max(raw_y, 0.0f), t.y.last);
    c.free_x = (raw_x > vf(0.0f)) & (raw_x < vf(t.x.last));
    c.free_y = (raw_y > vf(0.0f)) & (raw_y < vf(t.y.last));
    const vf i = min(floor(c.x), t.x.last_cell), j = min(floor(c.y), t.y.last_cell);
    c.fx = c.x - i, c.fy = c.y - j;
    c.first = truncate(fma(j, t.columns, i));
    return c;
}

// One channel at texels `index`, from so many registers; 0: gathered.
template <int Registers>
TEXGS_INLINE vf lookup(const TextureTable& t, int channel, vi index) {
#if defined(TEXGS_AVX512)
    const float* plane = t.texels + channel * 16 * Registers;
    if constexpr (Registers == 1) return _mm512_permutexvar_ps(index.v, load(plane).v);
    if constexpr (Registers == 2) return _mm512_permutex2var_ps(load(plane).v, index.v, load(plane + 16).v);
    if constexpr (Registers == 4) {
        const __m512 low = _mm512_permutex2var_ps(load(plane).v, index.v, load(plane + 16).v);
        const __m512 high = _mm512_permutex2var_ps(load(plane + 32).v, index.v, load(plane + 48).v);
        return _mm512_mask_mov_ps(low, _mm512_test_epi32_mask(index.v, _mm512_set1_epi32(32)), high);
    }
#endif
    return gather(t.texels + channel, index * splat(3));
}

struct Taps {
    vf t00, t10, t01, t11;
};
template <int Registers>
TEXGS_INLINE Taps taps(const TextureTable& t, int channel, vi first) {
    const vi right = first + splat(t.x.step);
    return {lookup<Registers>(t, channel, first), lookup<Registers>(t, channel, right),
            lookup<Registers>(t, channel, first + splat(t.y.step)),
            lookup<Registers>(t, channel, right + splat(t.y.step))};
}

TEXGS_INLINE vf mix(vf a, vf b, vf f) { return fma(f, b - a, a); }

// Calls use(channel, taps) for the three channels.
template <class Use>
TEXGS_INLINE void for_taps(const TextureTable& t, vi first, Use use) {
    switch (t.registers) {
#if defined(TEXGS_AVX512)
        case 1:
            for (int c = 0; c < 3; ++c) use(c, taps<1>(t, c, first));
            return;
        case 2:
            for (int c = 0; c < 3; ++c) use(c, taps<2>(t, c, first));
            return;
        case 4:
            for (int c = 0; c < 3; ++c) use(c, taps<4>(t, c, first));
            return;
#endif
        default:
            for (int c = 0; c < 3; ++c) use(c, taps<0>(t, c, first));
    }
}

TEXGS_INLINE void sample(const TextureTable& t, vi first, vf fx, vf fy, vf texel[3]) {
    for_taps(t, first, [&](int c, const Taps& k) { texel[c] = mix(mix(k.t00, k.t10, fx), mix(k.t01, k.t11, fx), fy); });
}

// The same with the derivatives of each channel by u and v.
TEXGS_INLINE void sample_with_slope(const TextureTable& t, const TexelCoordinates& at, vf texel[3], vf by_u[3],
                                    vf by_v[3]) {
    for_taps(t, at.first, [&](int c, const Taps& k) {
        const vf top = mix(k.t00, k.t10, at.fx), bottom = mix(k.t01, k.t11, at.fx);
        texel[c] = mix(top, bottom, at.fy);
        by_u[c] = zero_unless(at.free_x, mix(k.t10 - k.t00, k.t11 - k.t01, at.fy) * vf(t.x.scale));
        by_v[c] = zero_unless(at.free_y, (bottom - top) * vf(t.y.scale));
    });
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
