// SPDX-License-Identifier: Apache-2.0
// What forward, backward and contribute share: the records of a tile brought close, and a surfel's fragments in one
// block.
#pragma once
#include "blocks.h"
#include "primitives.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kChunk = 128;  // surfels of a tile worked on at a time; their records stay in L1
constexpr int kMaxChannels = TEXGS_MAX_CHANNELS + 3;

// Calls body with n, 1 to Most, as a constant: loops over channels unroll, and their sums stay in registers.
template <int N>
struct Constant {
    static constexpr int value = N;
};
template <int Most, class Body>
TEXGS_INLINE void with_constant(int n, Body body) {
    if (n == Most) return body(Constant<Most>{});
    if constexpr (Most > 1) with_constant<Most - 1>(n, body);
}

// By which depths in normalised device coordinates, 0 at the near and 1 at the far plane, differ: scale (1/z - 1/z').
inline float ndc_scale(const Raster& r) {
    return r.options.far_plane / (r.options.far_plane - r.options.near_plane) * r.options.near_plane;
}

// Depth z in them less that of a depth `origin`, without cancellation.
TEXGS_INLINE vf centred_ndc(const Raster& r, vf z, vf origin) { return vf(ndc_scale(r)) * (z - origin) / (z * origin); }

inline void load_plane(const Raster& r, int tile, const float* image, float* plane);
inline void prefetch_planes(const Raster& r, int tile, const float* image, int planes);

// Pixel centres of a vector of pixels, and their depth ranges, if any.
struct Pixels {
    vf x, y;
    bool is_cut;
    vf near, far;
};
struct TilePixels {
    vf lane_x[kParts], lane_y[kParts];
    float block_x[kBlocks], block_y[kBlocks];
    float range[2 * kTilePixels];
    bool is_cut;

    TilePixels(const Raster& r, int tile)
        : is_cut(r.camera.depth_range && r.tile_begin[tile] < r.tile_begin[tile + 1]) {
        const int left = tile % r.tiles_x * kTile, top = tile / r.tiles_x * kTile;
        for (int b = 0; b < kBlocks; ++b) {
            block_x[b] = static_cast<float>(left + block_column(b));
            block_y[b] = static_cast<float>(top + block_row(b));
        }
        for (int p = 0; p < kParts; ++p) {
            float x[kLanes], y[kLanes];
            for (int i = 0; i < kLanes; ++i) {
                const int pixel = p * kLanes + i;
                x[i] = 0.5f + (pixel & 3), y[i] = 0.5f + (pixel >> 2);
            }
            lane_x[p] = load(x), lane_y[p] = load(y);
        }
        if (!is_cut) return;
        const int64_t plane = int64_t(r.camera.width) * r.camera.height;
        std::memset(range, 0, sizeof range);  // outside of the image nothing counts
        for (int i = 0; i < 2; ++i) load_plane(r, tile, r.camera.depth_range + i * plane, range + i * kTilePixels);
        prefetch_planes(r, tile + 1, r.camera.depth_range, 2);
    }
    TEXGS_INLINE Pixels of(int block, int part) const {
        const vf x = lane_x[part] + vf(block_x[block]), y = lane_y[part] + vf(block_y[block]);
        if (!is_cut) return {x, y, false, 0.0f, 0.0f};
        const float* own = range + block * kBlockPixels + part * kLanes;
        return {x, y, true, load(own), load(own + kTilePixels)};
    }
};

// Options spread over the lanes. Kept by value: the compiler cannot know that no store changes them.
struct Limits {
    vf low_pass, alpha_min, transmittance_min, near_plane;

    explicit Limits(const texgs_options& o)
        : low_pass(o.low_pass),
          alpha_min(o.alpha_min),
          transmittance_min(o.transmittance_min),
          near_plane(o.near_plane) {}
};

// A primitive's fragments in a vector of pixels, before blending. Where they are, what alpha that gives and what is
// blended are computed in loops of their own, the second by take_alphas: in one, the chain of operations is too long
// for the machine to overlap enough of them, and the whole takes 1.4 times as long.
struct Fragments {
    vf log2_alpha;  // before take_alphas
    vf u, v;        // intersection, standard deviations
    vf inverse_w;   // 1 / W
    vf rho_surfel, rho;
};

// As if there were no depth ranges.
template <class P>
TEXGS_INLINE Fragments evaluate_all(const Record& s, unsigned flags, Pixels at, const Limits& limits) {
    const vf dx = at.x - vf(s.cx), dy = at.y - vf(s.cy);
    if constexpr (P::kAffine) {
        const vf u = fma(s.ux, dx, s.uy * dy), v = s.vy * dy, rho = fma(u, u, v * v);
        return {fma(rho, -0.5f * kLog2E, s.log2_opacity), u, v, 1.0f, rho, rho};
    }
    const vf W = fma(s.wx, dx, fma(s.wy, dy, 1.0f)), inverse_w = vf(1.0f) / W;
    const vf u = fma(s.ux, dx, fma(s.uy, dy, s.u)) * inverse_w;
    const vf v = fma(s.vx, dx, fma(s.vy, dy, s.v)) * inverse_w;
    vf rho_surfel = fma(u, u, v * v);
    if (flags & kClipped) {  // rare, and the same for all of the surfel's fragments
        const vm in_front = (W > vf(0.0f)) & (W * limits.near_plane < vf(s.zc));
        rho_surfel = select(in_front, rho_surfel, 1e30f);
    }
    vf rho = rho_surfel;
    if (flags & kFiltered) rho = min(rho, limits.low_pass * fma(dx, dx, dy * dy));
    return {fma(rho, -0.5f * kLog2E, s.log2_opacity), u, v, inverse_w, rho_surfel, rho};
}

// Camera depth of fragments: of the ray-splat intersection, or of the mean where the low-pass filter rules, and of
// Gaussians.
template <class P>
TEXGS_INLINE vf depth_of(const Record& s, const Fragments& f) {
    if constexpr (P::kAffine) return s.zp;
    return select(f.rho_surfel <= f.rho, vf(s.zc) * f.inverse_w, s.zp);
}

template <class P>
TEXGS_INLINE Fragments evaluate(const Record& s, unsigned flags, Pixels at, const Limits& limits) {
    Fragments f = evaluate_all<P>(s, flags, at, limits);
    if (at.is_cut) {
        vf z = P::kAffine ? vf(s.zp) : vf(s.zc) * f.inverse_w;
        if (flags & kFiltered) z = depth_of<P>(s, f);
        const vm counts = (at.near <= z) & (z < at.far);
        f.log2_alpha = select(counts, f.log2_alpha, -1e30f);
    }
    return f;
}

// Opacity of n vectors of fragments in place of its logarithm: 0 where below alpha_min.
TEXGS_INLINE void take_alphas(float (*fragments)[kLanes], int n, const Limits& limits) {
    for (int i = 0; i < n; ++i) {
        const vf alpha = min(exp2(load(fragments[i])), kLargestAlpha);
        store(fragments[i], zero_unless(alpha >= limits.alpha_min, alpha));
    }
}

// What is blended of each primitive, constant over it: base and features, then the normal.
struct ChannelSources {
    const float *base, *features, *normals;
    int textured, plain, all;  // channels of the base, of base and features, and with the normal

    explicit ChannelSources(const Raster& r)
        : base(r.surfels.base),
          features(r.surfels.features),
          normals(r.normals),
          textured(r.surfels.base ? 3 : 0),
          plain(r.surfels.channels),
          all(r.channels) {}

    const float* features_of(int64_t id) const { return features + id * (plain - textured); }
    TEXGS_INLINE void copy(int64_t id, float* to) const {
        for (int c = 0; c < textured; ++c) to[c] = base[3 * id + c];
        for (int c = textured; c < plain; ++c) to[c] = features_of(id)[c - textured];
        for (int c = plain; c < all; ++c) to[c] = normals[3 * id + c - plain];
    }
    TEXGS_INLINE void ask_for(int64_t id) const {
        if (textured) prefetch(base + 3 * id);
        if (plain > textured) prefetch(features_of(id));
        if (all > plain) prefetch(normals + 3 * id);
    }
};

// A part of a tile's list, copied so that the passes over its blocks read a few contiguous kilobytes.
struct alignas(64) Chunk {
    Record records[kChunk];
    uint32_t masks[kChunk];  // 0 beyond the pairs loaded
    uint32_t slots[kChunk];
    uint32_t surfels[kChunk];
    uint8_t flags[kChunk];
    const float* channels;  // of the first surfel; the next one's follow at `stride`
    int stride;             // kRecordStride where the records hold them
    static constexpr int kRecordStride = sizeof(Record) / sizeof(float);
    float many_channels[kChunk * kMaxChannels];

    // Loads pairs [begin, begin + n).
    void stage(const Raster& r, uint32_t begin, int n) {
        const uint32_t all = r.tile_begin[r.tiles_x * r.tiles_y];
        for (int i = 0; i < n; ++i) {
            // Records lie anywhere. Those of the next chunk, or of the next tile, are asked for now.
            if (begin + i + kChunk < all) prefetch(&r.records[r.pairs[begin + i + kChunk].surfel]);
            const Pair& pair = r.pairs[begin + i];
            records[i] = r.records[pair.surfel];
            masks[i] = pair.mask;
            slots[i] = pair.slot;
            surfels[i] = pair.surfel;
            flags[i] = r.flags[pair.surfel];
        }
        for (int i = n; i < kChunk && i % 16; ++i) masks[i] = 0;
        channels = records[0].color;
        stride = kRecordStride;
        if (r.channels > kRecordChannels) stage_channels(r, begin, n);
    }

private:
    void stage_channels(const Raster& r, uint32_t begin, int n) {
        const ChannelSources from(r);
        const uint32_t all = r.tile_begin[r.tiles_x * r.tiles_y];
        channels = many_channels;
        stride = r.channels;
        for (int i = 0; i < n; ++i) {
            if (begin + i + kChunk < all) from.ask_for(r.pairs[begin + i + kChunk].surfel);
            from.copy(surfels[i], many_channels + i * stride);
        }
    }
};

// Indices of the surfels whose mask has the bit of `block`; `masks` is padded with zeros to a multiple of 16.
TEXGS_INLINE int list_block(const uint32_t* masks, int n, int block, int32_t* list) {
    int listed = 0;
    for (int i = 0; i < n; i += kLanes) {
        const vm hit = is_set(load(reinterpret_cast<const int32_t*>(masks + i)), splat(block));
        store_chosen(list + listed, splat(i) + iota(), hit);
        listed += count(hit);
    }
    return listed;
}

// Pixels of a block that lie inside the image and in whose depth range something may lie, as 1 and 0.
TEXGS_INLINE vf open_pixels(const Raster& r, Pixels at) {
    vm open = (at.x < vf(float(r.camera.width))) & (at.y < vf(float(r.camera.height)));
    if (at.is_cut) open = open & (at.near < at.far);
    return zero_unless(open, 1.0f);
}

// Visits the rows of a tile's blocks that lie inside the image: pixel in the image plane [H, W], index in the
// block-linear plane, number of pixels.
template <class Visit>
TEXGS_INLINE void for_rows(const Raster& r, int tile, Visit visit) {
    const int left = tile % r.tiles_x * kTile, top = tile / r.tiles_x * kTile, width = r.camera.width;
    const int columns = width - left < kTile ? width - left : kTile;
    const int rows = r.camera.height - top < kTile ? r.camera.height - top : kTile;
    const auto index = [](int x, int y) { return kBlockPixels * block_of(x, y) + 4 * y % kBlockPixels; };
    if (columns == kTile && rows == kTile) {
        for (int y = 0; y < kTile; ++y)
            for (int x = 0; x < kTile; x += 4) visit(int64_t(top + y) * width + left + x, index(x, y), 4);
        return;
    }
    for (int y = 0; y < rows; ++y)
        for (int x = 0; x < columns; x += 4)
            visit(int64_t(top + y) * width + left + x, index(x, y), columns - x < 4 ? columns - x : 4);
}
TEXGS_INLINE void copy_row(float* to, const float* from, int n) {
    if (n == 4)
        std::memcpy(to, from, 4 * sizeof(float));
    else
        for (int i = 0; i < n; ++i) to[i] = from[i];
}
inline void save_plane(const Raster& r, int tile, const float* plane, float* image) {
    for_rows(r, tile, [&](int64_t pixel, int index, int n) { copy_row(image + pixel, plane + index, n); });
}
inline void load_plane(const Raster& r, int tile, const float* image, float* plane) {
    for_rows(r, tile, [&](int64_t pixel, int index, int n) { copy_row(plane + index, image + pixel, n); });
}
// Asks for a tile's part of `planes` image planes [H, W], so that it is there when the tile's turn comes.
inline void prefetch_planes(const Raster& r, int tile, const float* image, int planes) {
    if (!image || tile >= r.tiles_x * r.tiles_y) return;
    const int left = tile % r.tiles_x * kTile, top = tile / r.tiles_x * kTile;
    const int64_t plane = int64_t(r.camera.width) * r.camera.height;
    for (int c = 0; c < planes; ++c)
        for (int y = top; y < top + kTile && y < r.camera.height; ++y)
            prefetch(image + c * plane + int64_t(y) * r.camera.width + left);
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
