// SPDX-License-Identifier: Apache-2.0
// L1 and D-SSIM of one tile, with the gradient, in a single sweep over its rows.
//
// With the sum p = x + y and the difference d = x - y of image and target, their blurs mp, md and the variances vp, vd,
// the two factors of SSIM (Wang et al. 2004) are
//     r = (A - a) / (A + a),  A = mp^2 / 2 + C1,  a = md^2 / 2      (luminance)
//     q = (B - b) / (B + b),  B = vp / 2 + C2,    b = vd / 2        (contrast and structure),
// so that 1 - r q = 2 (A b + a B) / ((A + a) (B + b)). This takes four blurs instead of five, does not cancel where
// the images are alike, and is exactly 0, with a gradient of exactly 0, where d = 0 all over the window. Such windows
// are therefore skipped: `Columns` tracks, row by row, the interval that holds all others. Variances are those of
// p - 1, which for values in [0, 1] loses less to cancellation; the zeros outside the image are then -1.
#include "loss_kernels.h"
#include "simd.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kRadius = 5, kTaps = 2 * kRadius + 1;
constexpr float kC1 = 0.01f * 0.01f, kC2 = 0.03f * 0.03f;
// exp(-k^2 / (2 1.5^2)), k = 0 to 5, normalised over the window.
constexpr float kWindow[kRadius + 1] = {0.266011725f,  0.213005538f,   0.10936069f,
                                        0.0360007721f, 0.00759875814f, 0.00102838008f};

// A row of the workspace: zeros | halo | the tile | halo | zeros. Pixels reach two radii beyond the tile, derivatives
// one; the outer zeros are read by the taps of halo columns, whose results nobody uses.
constexpr int kHalo = 16;
constexpr int kTileStart = 2 * kHalo, kRow = kLossTileWidth + 4 * kHalo;
constexpr int kReach = (kRadius + kLanes - 1) / kLanes * kLanes;
static_assert(2 * kRadius <= kHalo && kHalo % kLanes == 0);

// Columns [begin, end) of a workspace row, whole vectors; empty where begin >= end.
struct Columns {
    int begin = kRow, end = 0;

    bool empty() const { return begin >= end; }
    void include(Columns other) {
        begin = other.begin < begin ? other.begin : begin;
        end = other.end > end ? other.end : end;
    }
    // Grown by the radius of the window, but not beyond `limit`.
    Columns reach(Columns limit) const {
        if (empty()) return {};
        const int b = begin - kReach, e = end + kReach;
        return {b < limit.begin ? limit.begin : b, e > limit.end ? limit.end : e};
    }
};

using Row = float[kRow];

// Rings hold row r at r mod kTaps.
struct Workspace {
    alignas(64) Row sum[kTaps], difference[kTaps];  // p - 1 and d
    Row column_blur[4];                             // both and their squares, of one row, blurred vertically
    Row derivatives[3];                             // of 1 - SSIM of one row by mp and md together, by the squares
    Row row_blur[3][kTaps];                         // the same, blurred horizontally
    Row inside;                                     // 1 in columns of the image, 0 elsewhere
    Columns differs[kTaps], active[kTaps];          // where d, where the derivatives are not all 0
    Columns cleared;                                // `derivatives` is 0 outside
};

int slot(int row) { return (row + 2 * kTaps) % kTaps; }

struct Sweep {
    const SsimJob& job;
    const LossTile& tile;
    Workspace& w;
    Columns strip;  // the tile's own columns
    Columns wide;   // and the halo
    SsimSums sums;
};

// Index, in an image, of workspace column 0 of row y.
int64_t origin(const Sweep& s, int y) {
    return (static_cast<int64_t>(s.tile.plane) * s.job.height + y) * s.job.width + s.tile.x0 - kTileStart;
}

TEXGS_INLINE vf blur_row(const float* p) {
    vf total = vf(kWindow[0]) * load(p);
    for (int k = 1; k <= kRadius; ++k) total = fma(kWindow[k], load(p - k) + load(p + k), total);
    return total;
}

TEXGS_INLINE vf blur_column(const float* const rows[kTaps], int c) {
    vf total = vf(kWindow[0]) * load(rows[kRadius] + c);
    for (int k = 1; k <= kRadius; ++k)
        total = fma(kWindow[k], load(rows[kRadius - k] + c) + load(rows[kRadius + k] + c), total);
    return total;
}

// Blurs of the rows and of their squares.
TEXGS_INLINE void blur_column_squares(const float* const rows[kTaps], int c, float* mean, float* square) {
    const vf centre = load(rows[kRadius] + c);
    vf first = vf(kWindow[0]) * centre, second = first * centre;
    for (int k = 1; k <= kRadius; ++k) {
        const vf above = load(rows[kRadius - k] + c), below = load(rows[kRadius + k] + c);
        first = fma(kWindow[k], above + below, first);
        second = fma(kWindow[k], fma(above, above, below * below), second);
    }
    store(mean + c, first);
    store(square + c, second);
}

Columns rows_around(const Row* ring, const Columns* columns, int row, const float* rows[kTaps]) {
    Columns all;
    for (int k = 0; k < kTaps; ++k) {
        rows[k] = ring[slot(row - kRadius + k)];
        all.include(columns[slot(row - kRadius + k)]);
    }
    return all;
}

// Reads row y of both images into the rings.
void read_row(Sweep& s, int y) {
    Row &p = s.w.sum[slot(y)], &d = s.w.difference[slot(y)];
    Columns& differs = s.w.differs[slot(y)] = {};
    if (y < 0 || y >= s.job.height) {
        for (float& value : p) value = -1.0f;
        std::memset(d, 0, sizeof d);
        return;
    }
    const int64_t row = origin(s, y);
    const int first = s.tile.x0 == 0 ? kTileStart : s.wide.begin;
    const int end = kTileStart + s.job.width - s.tile.x0, last = end < s.wide.end ? end : s.wide.end;
    vf l1 = 0.0f;
    for (int c = first; c < last; c += kLanes) {
        const int n = last - c;
        const float *image = s.job.image + (row + c), *target = s.job.target + (row + c);
        const vf x = n < kLanes ? load_part(image, n) : load(image);
        const vf t = n < kLanes ? load_part(target, n) : load(target);
        store(p + c, x + t - vf(1.0f));
        store(d + c, x - t);
        const vf distance = abs(x - t);
        if (any(~(distance <= vf(0.0f)))) differs.include({c, c + kLanes});  // NaN differs
        if (c >= s.strip.begin && c < s.strip.end) l1 += distance;
    }
    if (y >= s.tile.y0 && y < s.tile.y1) s.sums.l1 += sum(l1);
}

// 1 - SSIM of the windows centred at column c, and its derivatives.
TEXGS_INLINE vf dissimilarity(Workspace& w, int c) {
    const vf shifted = blur_row(w.column_blur[0] + c), pp = blur_row(w.column_blur[1] + c);
    const vf md = blur_row(w.column_blur[2] + c), dd = blur_row(w.column_blur[3] + c);
    const vf half = 0.5f, mp = shifted + vf(1.0f);
    const vf A = fma(half * mp, mp, kC1), a = half * md * md;
    const vf B = fma(half, fnma(shifted, shifted, pp), kC2), b = half * fnma(md, md, dd);
    const vf inside = load(w.inside + c);
    const vf over_A = inside / (A + a), over_B = inside / (B + b);
    const vf r = (A - a) * over_A, q = (B - b) * over_B;
    const vf r_B = r * over_B * over_B;             // by the blur of (p - 1)^2: -b r_B, of d^2: B r_B
    const vf q_A = vf(2.0f) * q * over_A * over_A;  // by A: -a q_A, by a: A q_A
    const vf by_pp = -(b * r_B), by_dd = B * r_B;
    const vf by_mp = -(a * q_A * mp + vf(2.0f) * by_pp * shifted);
    const vf by_md = (A * q_A - vf(2.0f) * by_dd) * md;
    store(w.derivatives[0] + c, by_mp + by_md);
    store(w.derivatives[1] + c, by_pp);
    store(w.derivatives[2] + c, by_dd);
    return vf(2.0f) * fma(A, b, a * B) * over_A * over_B;
}

// 1 - SSIM of the windows centred in row y; leaves its derivatives, blurred horizontally, in the ring.
void compare_row(Sweep& s, int y) {
    Workspace& w = s.w;
    const float *p[kTaps], *d[kTaps];
    rows_around(w.difference, w.differs, y, d);
    const Columns active = rows_around(w.sum, w.differs, y, p).reach(s.wide);
    Columns& kept = w.active[slot(y)] = {};
    const bool skip = y < 0 || y >= s.job.height || active.empty();
    if (!skip && s.job.gradient) kept = active.reach(s.strip);
    if (kept.begin > s.strip.begin || kept.end < s.strip.end)
        for (auto& ring : w.row_blur) std::memset(ring[slot(y)], 0, sizeof(Row));
    if (skip) return;

    const Columns needed = active.reach(s.wide);
    for (int c = needed.begin; c < needed.end; c += kLanes) {
        blur_column_squares(p, c, w.column_blur[0], w.column_blur[1]);
        blur_column_squares(d, c, w.column_blur[2], w.column_blur[3]);
    }
    if (active.begin > w.cleared.begin || active.end < w.cleared.end)
        std::memset(w.derivatives, 0, sizeof w.derivatives);
    w.cleared = active;
    vf dssim = 0.0f;
    for (int c = active.begin; c < active.end; c += kLanes) {
        const vf here = dissimilarity(w, c);
        if (c >= s.strip.begin && c < s.strip.end) dssim += here;
    }
    if (y >= s.tile.y0 && y < s.tile.y1) s.sums.dssim += sum(dssim);

    for (int k = 0; k < 3; ++k) {
        float* out = w.row_blur[k][slot(y)];
        for (int c = kept.begin; c < kept.end; c += kLanes) store(out + c, blur_row(w.derivatives[k] + c));
    }
}

// The gradient of row y, from the derivatives of the windows that hold its pixels.
void differentiate_row(Sweep& s, int y) {
    Workspace& w = s.w;
    const float *means[kTaps], *sums[kTaps], *differences[kTaps];
    const Columns active = rows_around(w.row_blur[0], w.active, y, means);
    rows_around(w.row_blur[1], w.active, y, sums);
    rows_around(w.row_blur[2], w.active, y, differences);
    const int64_t row = origin(s, y);
    const int end = kTileStart + s.tile.x1 - s.tile.x0;
    if (active.begin > s.strip.begin || active.end < s.strip.end)
        std::memset(s.job.gradient + (row + kTileStart), 0, sizeof(float) * (end - kTileStart));

    const vf dssim = s.job.dssim_scale, l1 = s.job.l1_scale, zero = 0.0f;
    for (int c = active.begin; c < active.end && c < end; c += kLanes) {
        const vf p = load(w.sum[slot(y)] + c), d = load(w.difference[slot(y)] + c);
        const vf inner = fma(p, blur_column(sums, c), d * blur_column(differences, c));
        const vf outer = fma(2.0f, inner, blur_column(means, c));
        const vf sign = select(d > zero, l1, zero) - select(d < zero, l1, zero);
        const vf gradient = fma(dssim, outer, sign);
        float* out = s.job.gradient + (row + c);
        if (c + kLanes <= end)
            store(out, gradient);
        else
            store_part(out, gradient, end - c);
    }
}

}  // namespace

SsimSums ssim_tile(const SsimJob& job, const LossTile& tile) {
    Workspace w = {};
    for (Row& row : w.sum)
        for (float& value : row) value = -1.0f;
    const int width = (tile.x1 - tile.x0 + kHalo - 1) / kHalo * kHalo;
    const Columns strip = {kTileStart, kTileStart + width}, wide = {kHalo, kTileStart + width + kHalo};
    for (int c = wide.begin; c < wide.end; ++c) {
        const int x = tile.x0 + c - kTileStart;
        w.inside[c] = x >= 0 && x < job.width ? 1.0f : 0.0f;
    }
    Sweep s{job, tile, w, strip, wide, {0.0, 0.0}};
    const int halo = job.gradient ? 2 * kRadius : kRadius;
    for (int y = tile.y0 - halo; y < tile.y1 + halo; ++y) {
        read_row(s, y);
        const int compared = y - kRadius, differentiated = y - 2 * kRadius;
        if (compared >= tile.y0 - halo + kRadius) compare_row(s, compared);
        if (job.gradient && differentiated >= tile.y0) differentiate_row(s, differentiated);
    }
    return s.sums;
}

}  // namespace texgs::TEXGS_ISA
