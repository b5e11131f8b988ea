// SPDX-License-Identifier: Apache-2.0
// Which blocks of which tiles a projected surfel reaches: exact tests of its ellipse and its low-pass disc against
// the rectangles of pixel centres of all blocks of a tile, and of its depths against theirs.
#include "blocks.h"
#include "isa.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kGroups = kBlocks / kLanes;  // of blocks, a lane for each
constexpr int kAhead = 12;
constexpr float kWidth = 3.0f, kHeight = kBlockPixels / 4 - 1.0f;  // between the outer pixel centres of a block

struct BlockCorners {
    vf x[kGroups], y[kGroups];  // first pixel centre of each block, from the tile's origin
};

BlockCorners block_corners() {
    BlockCorners c;
    for (int p = 0; p < kGroups; ++p) {
        float x[kLanes], y[kLanes];
        for (int i = 0; i < kLanes; ++i) {
            const int block = p * kLanes + i;
            x[i] = block_column(block) + 0.5f, y[i] = block_row(block) + 0.5f;
        }
        c.x[p] = load(x), c.y[p] = load(y);
    }
    return c;
}

TEXGS_INLINE vf clamp(vf a, vf low, vf high) { return min(max(a, low), high); }

// Constants of a surfel's test, spread over the lanes once.
struct Test {
    vf ex, ey, xx, xy, yy, slope_x, slope_y, cx, cy, disc;
    TEXGS_INLINE Test(const Footprint& f)
        : ex(f.ex),
          ey(f.ey),
          xx(f.xx),
          xy(f.xy),
          yy(f.yy),
          slope_x(f.xx > 0 ? -f.xy / f.xx : 0),
          slope_y(f.yy > 0 ? -f.xy / f.yy : 0),
          cx(f.cx),
          cy(f.cy),
          disc(f.disc) {}

    // The smallest value of the ellipse's form over a rectangle is on the edges that face its centre: on each, the
    // unconstrained minimum along the edge, clamped to it.
    TEXGS_INLINE vm ellipse(vf x0, vf y0, vf x1, vf y1) const {
        const vf near_x = clamp(0.0f, x0, x1), near_y = clamp(0.0f, y0, y1);
        const vf on_x = clamp(slope_y * near_x, y0, y1), on_y = clamp(slope_x * near_y, x0, x1);
        const vf first = value(near_x, on_x), second = value(on_y, near_y);
        return min(first, second) <= vf(1.0f);
    }
    TEXGS_INLINE vf value(vf x, vf y) const { return fma(x, fma(xx, x, vf(2.0f) * xy * y), yy * y * y); }
};

TEXGS_INLINE uint32_t block_mask(const Test& t, bool with_disc, const BlockCorners& corners, float left, float top) {
    uint32_t mask = 0;
    for (int p = 0; p < kGroups; ++p) {
        const vf x = corners.x[p] + vf(left), y = corners.y[p] + vf(top);
        const vf x0 = x - t.ex, y0 = y - t.ey;
        vm hit = t.ellipse(x0, y0, x0 + vf(kWidth), y0 + vf(kHeight));
        if (with_disc) {
            const vf dx = clamp(t.cx, x, x + vf(kWidth)) - t.cx, dy = clamp(t.cy, y, y + vf(kHeight)) - t.cy;
            hit = hit | (fma(dx, dx, dy * dy) <= t.disc);
        }
        mask |= bits(hit) << (p * kLanes);
    }
    return mask;
}

// Blocks of a tile in which some depth counts that the surfel has.
TEXGS_INLINE uint32_t depth_mask(const Raster& r, uint32_t tile, const Footprint& foot) {
    const float* nearest = r.square_ranges + int64_t(tile) * 2 * kSquares;
    uint32_t squares = 0;
    for (int i = 0; i < kSquares; i += kLanes) {
        const vm counts = (load(nearest + i) <= vf(foot.farthest)) & (vf(foot.nearest) <= load(nearest + kSquares + i));
        squares |= bits(counts) << i;
    }
    return blocks_of(squares);
}

}  // namespace

int64_t bin_surfels(const Raster& r, const uint32_t* order, int64_t begin, int64_t end, Candidate* out,
                    uint32_t* per_tile, uint32_t* per_surfel) {
    const BlockCorners corners = block_corners();
    Candidate* next = out;
    for (int64_t i = begin; i < end; ++i) {
        const uint32_t id = order[i];
        prefetch(&r.footprints[order[i + kAhead < end ? i + kAhead : i]]);  // in the order of depth they lie anywhere
        const Footprint& foot = r.footprints[id];
        const Test test(foot);
        uint32_t rank = 0;
        for (int y = foot.y0; y < foot.y1; ++y) {
            for (int x = foot.x0; x < foot.x1; ++x) {
                const uint32_t tile = static_cast<uint32_t>(y * r.tiles_x + x);
                uint32_t mask = block_mask(test, foot.disc >= 0, corners, float(x * kTile), float(y * kTile));
                if (r.square_ranges) mask &= depth_mask(r, tile, foot);
                *next = {tile, id, rank, mask};
                const uint32_t hit = mask != 0;  // no branch: misses are overwritten
                next += hit, rank += hit, per_tile[tile] += hit;
            }
        }
        per_surfel[id] = rank;
    }
    return next - out;
}

}  // namespace texgs::TEXGS_ISA
