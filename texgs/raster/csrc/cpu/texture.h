// SPDX-License-Identifier: Apache-2.0
// Bilinear lookup in the texture of one surfel for a vector of fragments.
//
// A gather costs a load per lane and channel. Small textures (kTableTexels of simd.h) are looked up in registers
// instead: one permute serves a register of texels for all lanes. They are brought into planes of 16 when their tile is
// staged; larger textures gather from the atlas.
#pragma once
#include "fragment.h"

namespace texgs::TEXGS_ISA {
namespace {

// Planes of 16 that a channel of so many texels takes; 0: it is gathered.
TEXGS_INLINE int planes_for(int texels) { return texels > kTableTexels ? 0 : texels <= 16 ? 1 : texels <= 32 ? 2 : 4; }

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
    const float* texels;  // [channel][16 * planes], or interleaved [n, 3]
    int planes;           // of 16 per channel: 1, 2 or 4; 0: gather
    float columns, rows, gain;
    Side x, y;
};

struct alignas(64) TextureTables {
    TextureTable of[kChunk];
    float planes[kChunk * 3 * kTableTexels + 16];

    // Sizes and gains of the chunk's first n surfels.
    void stage_layout(const Raster& r, const Chunk& chunk, int n);
    // The same and the texels.
    void stage(const Raster& r, const Chunk& chunk, int n);
};

inline void TextureTables::stage_layout(const Raster& r, const Chunk& chunk, int n) {
    for (int i = 0; i < n; ++i) {
        const int64_t id = chunk.surfels[i];
        const int columns = r.surfels.sizes[2 * id], rows = r.surfels.sizes[2 * id + 1];
        TextureTable& t = of[i];
        t.texels = r.surfels.texels + 3 * r.surfels.offsets[id];
        t.columns = static_cast<float>(columns), t.rows = static_cast<float>(rows), t.gain = r.surfels.gain[id];
        t.x.set(columns, 1), t.y.set(rows, columns);
        t.planes = planes_for(columns * rows);
    }
}

inline void TextureTables::stage(const Raster& r, const Chunk& chunk, int n) {
    stage_layout(r, chunk, n);
    constexpr int ahead = 8;  // texels lie anywhere
    for (int i = 0; i < n; ++i) {
        TextureTable& t = of[i];
        if (i + ahead < n)
            for (int k = 0; k < 3 * of[i + ahead].planes; ++k) prefetch(of[i + ahead].texels + 16 * k);
        if (!t.planes) continue;
        const int count = static_cast<int>(t.columns * t.rows), plane = 16 * t.planes;
        float* to = planes + i * 3 * kTableTexels;
        for (int k = 0; k < count; k += 16)
            split_channels(t.texels + 3 * k, count - k < 16 ? count - k : 16, to + k, to + plane + k,
                           to + 2 * plane + k);
        t.texels = to;
    }
}

// Where fragments fall in a texture: the first of four texels, and the weights of its neighbours along x and y.
struct TexelCoordinates {
    vf x, y;  // in [0, columns - 1], [0, rows - 1]
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

// One channel at texels `index`, from so many planes; 0: gathered.
template <int Planes>
TEXGS_INLINE vf lookup(const TextureTable& t, int channel, vi index) {
    if constexpr (Planes > 0) return table_lookup<Planes>(t.texels + channel * 16 * Planes, index);
    return gather(t.texels + channel, index * splat(3));
}

struct Taps {
    vf t00, t10, t01, t11;
};
template <int Planes>
TEXGS_INLINE Taps taps(const TextureTable& t, int channel, vi first) {
    const vi right = first + splat(t.x.step);
    return {lookup<Planes>(t, channel, first), lookup<Planes>(t, channel, right),
            lookup<Planes>(t, channel, first + splat(t.y.step)), lookup<Planes>(t, channel, right + splat(t.y.step))};
}

TEXGS_INLINE vf mix(vf a, vf b, vf f) { return fma(f, b - a, a); }

// Calls use(channel, taps) for the three channels.
template <class Use>
TEXGS_INLINE void for_taps(const TextureTable& t, vi first, Use use) {
    const auto visit = [&](auto planes) {
        constexpr int n = decltype(planes)::value <= kTableTexels / 16 ? decltype(planes)::value : 0;
        for (int c = 0; c < 3; ++c) use(c, taps<n>(t, c, first));
    };
    if (t.planes == 1) return visit(Constant<1>{});
    if (t.planes == 2) return visit(Constant<2>{});
    if (t.planes == 4) return visit(Constant<4>{});
    visit(Constant<0>{});
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
