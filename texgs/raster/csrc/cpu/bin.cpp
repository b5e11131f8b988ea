// SPDX-License-Identifier: Apache-2.0
// Which blocks of which tiles a projected surfel reaches: exact tests of its ellipse and its low-pass disc against
// the rectangles of pixel centres of all blocks of a tile, and of its depths against theirs.
//
// What an ellipse has in common with a row of blocks is as wide as an interval of it, and reaches those blocks of the
// row that meet the interval.
#include "blocks.h"
#include "isa.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kAhead = 12;
constexpr float kWidth = 3.0f, kHeight = kBlockPixels / 4 - 1.0f;  // between the outer pixel centres of a block
// Vectors with a lane for each row of blocks, where they hold no more, and columns of blocks looked at one by one.
constexpr int kRowVectors = kBlocksDown > kLanes ? kBlocksDown / kLanes : 1;
constexpr int kColumns = kBlocks / (kRowVectors * kLanes);

struct BlockCorners {
    vf x[kColumns], y[kRowVectors];  // first pixel centres, from the tile's origin

    BlockCorners() {
        const auto centres = [](auto place, int first) {
            float lanes[kLanes];
            for (int i = 0; i < kLanes; ++i) lanes[i] = 0.5f + place(first + i);
            return load(lanes);
        };
        for (int c = 0; c < kColumns; ++c) x[c] = centres(block_column, c * kBlocksDown);
        for (int v = 0; v < kRowVectors; ++v) y[v] = centres(block_row, v * kLanes);
    }
};

TEXGS_INLINE vf clamp(vf a, vf low, vf high) { return min(max(a, low), high); }

// Constants of a surfel's test, spread over the lanes once.
struct Test {
    vf ex, ey, slope, width, height, per_height, tip, cx, cy, disc;
    TEXGS_INLINE Test(const Footprint& f)
        : ex(f.ex),
          ey(f.ey),
          slope(f.slope),
          width(f.width),
          height(f.height),
          per_height(1.0f / f.height),
          tip(f.tip),
          cx(f.cx),
          cy(f.cy),
          disc(f.disc) {}

    // Where the ellipse ends to the right at height y, to the left at -y.
    TEXGS_INLINE vf end(vf y) const {
        const vf share = y * per_height, rounding = 1e-6f;
        return fma(slope, y, width * sqrt(max(fnma(share, share, vf(1.0f) + rounding), 0.0f)));
    }
};

// What rows of blocks hold of a surfel: of the ellipse its interval, of the disc half of it squared, about cx.
struct Intervals {
    vf left, right, disc;
    vm reached;  // by the ellipse

    TEXGS_INLINE Intervals(const Test& t, vf y) {
        const vf y0 = y - t.ey, y1 = y0 + vf(kHeight);
        right = t.end(clamp(t.tip, y0, y1));
        left = -t.end(clamp(t.tip, -y1, -y0));
        reached = abs(clamp(0.0f, y0, y1)) <= t.height;
        const vf dy = clamp(t.cy, y, y + vf(kHeight)) - t.cy;
        disc = fnma(dy, dy, t.disc);
    }
};

TEXGS_INLINE uint32_t block_mask(const Test& t, bool with_disc, const BlockCorners& corners, float left, float top) {
    uint32_t mask = 0;
    for (int v = 0; v < kRowVectors; ++v) {
        const Intervals in(t, corners.y[v] + vf(top));
        for (int c = 0; c < kColumns; ++c) {
            const vf x = corners.x[c] + vf(left), x0 = x - t.ex;
            vm hit = in.reached & (x0 <= in.right) & (in.left <= x0 + vf(kWidth));
            if (with_disc) {
                const vf dx = clamp(t.cx, x, x + vf(kWidth)) - t.cx;
                hit = hit | (dx * dx <= in.disc);
            }
            mask |= bits(hit) << (c * kBlocksDown + v * kLanes);
        }
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
    const BlockCorners corners;
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
