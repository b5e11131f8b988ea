// SPDX-License-Identifier: Apache-2.0
// Bilateral smoothness of one tile of an attribute map, with its gradient:
//     alpha exp(-g(grey)) g(attribute),  g = |d/dx| + |d/dy| by Sobel's 3x3 kernels, zeros outside the image.
#include "loss_kernels.h"
#include "simd.h"

namespace texgs::TEXGS_ISA {
namespace {

// The tile is worked off in bands of kBand rows. A band holds two more rows and columns on every side: the gradient
// of a pixel needs the edges of its neighbours, and those the values of theirs.
constexpr int kBand = 16, kHalo = 2, kRows = kBand + 2 * kHalo;
constexpr int kStart = 16 + kLanes, kRow = kLossTileWidth + 2 * kStart;  // kStart: the tile's first column
using Plane = float[kRows][kRow];

struct Band {
    const SmoothnessJob& job;
    int x0, x1, y0, y1;        // pixels of the image
    alignas(64) Plane values;  // grey, then one channel
    Plane weight;              // alpha exp(-g(grey)), 0 outside the image
    Plane edge_x, edge_y;      // weight times the sign of the Sobel derivatives

    int64_t pixel(int row, int column) const {
        return static_cast<int64_t>(y0 - kHalo + row) * job.width + x0 - kStart + column;
    }
};

// Calls body(row, column, n, index) for whole vectors, n of them pixels, that cover the band and its halo as far as
// they lie in the image.
template <class Body>
void for_pixels(const Band& b, const Body& body) {
    const int first = b.x0 == 0 ? kStart : kStart - kLanes;  // tiles begin at multiples of 16
    const int right = b.x1 + kHalo < b.job.width ? b.x1 + kHalo : b.job.width;
    const int last = kStart + right - b.x0;
    for (int row = 0; row < b.y1 - b.y0 + 2 * kHalo; ++row) {
        const int y = b.y0 - kHalo + row;
        if (y < 0 || y >= b.job.height) continue;
        for (int c = first; c < last; c += kLanes) body(row, c, last - c < kLanes ? last - c : kLanes, b.pixel(row, c));
    }
}

// Sobel's sums at column c of the row between rows[0] and rows[2], kSobelSum times the derivatives.
TEXGS_INLINE void sobel(const float (*rows)[kRow], int c, vf& x, vf& y) {
    const auto smooth_row = [&](const float* p) { return fma(2.0f, load(p), load(p - 1) + load(p + 1)); };
    const auto smooth_column = [&](int k) {
        return fma(2.0f, load(rows[1] + k), load(rows[0] + k) + load(rows[2] + k));
    };
    x = smooth_column(c + 1) - smooth_column(c - 1);
    y = smooth_row(rows[2] + c) - smooth_row(rows[0] + c);
}

TEXGS_INLINE vf sign(vf a) { return select(a > vf(0.0f), 1.0f, select(a < vf(0.0f), -1.0f, 0.0f)); }

void find_weights(Band& b) {
    const int64_t plane = static_cast<int64_t>(b.job.height) * b.job.width;
    for_pixels(b, [&](int row, int c, int n, int64_t i) {
        const float* guide = b.job.guide + i;
        const vf total = load_part(guide, n) + load_part(guide + plane, n) + load_part(guide + 2 * plane, n);
        store(b.values[row] + c, total * vf(1.0f / 3.0f));
        store(b.weight[row] + c, load_part(b.job.alpha + i, n));
    });
    for (int row = 1; row < b.y1 - b.y0 + 2 * kHalo - 1; ++row) {
        for (int c = kStart - kLanes; c < kStart + b.x1 - b.x0 + kLanes; c += kLanes) {
            vf x, y;
            sobel(b.values + row - 1, c, x, y);
            store(b.weight[row] + c,
                  load(b.weight[row] + c) * exp2_or_nan(vf(-1.44269504f / kSobelSum) * (abs(x) + abs(y))));
        }
    }
}

// Sum over the band's own pixels; leaves the edges in the band.
double find_edges(Band& b, const float* channel) {
    for_pixels(b, [&](int row, int c, int n, int64_t i) { store(b.values[row] + c, load_part(channel + i, n)); });
    double total = 0.0;
    for (int row = 1; row < b.y1 - b.y0 + 2 * kHalo - 1; ++row) {
        vf terms = 0.0f;
        for (int c = kStart - kLanes; c < kStart + b.x1 - b.x0 + kLanes; c += kLanes) {
            vf x, y;
            sobel(b.values + row - 1, c, x, y);
            const vf weight = load(b.weight[row] + c);
            store(b.edge_x[row] + c, weight * sign(x));
            store(b.edge_y[row] + c, weight * sign(y));
            const int own = kStart + b.x1 - b.x0 - c;
            const vf term = weight * (abs(x) + abs(y));
            if (c >= kStart && own > 0) terms += own < kLanes ? zero_unless(to_float(iota()) < vf(own), term) : term;
        }
        if (row >= kHalo && row < b.y1 - b.y0 + kHalo) total += sum(terms);
    }
    return total;
}

// The adjoint of the Sobel derivatives: the same kernels, turned by half a turn.
void gather_gradient(const Band& b, float* gradient) {
    for (int row = kHalo; row < b.y1 - b.y0 + kHalo; ++row) {
        for (int c = kStart; c < kStart + b.x1 - b.x0; c += kLanes) {
            vf x, y, unused;
            sobel(b.edge_x + row - 1, c, x, unused);
            sobel(b.edge_y + row - 1, c, unused, y);
            const int n = kStart + b.x1 - b.x0 - c;
            store_part(gradient + b.pixel(row, c), vf(-b.job.scale) * (x + y), n < kLanes ? n : kLanes);
        }
    }
}

}  // namespace

double smoothness_tile(const SmoothnessJob& job, const LossTile& tile) {
    const int64_t plane = static_cast<int64_t>(job.height) * job.width;
    double total = 0.0;
    for (int y = tile.y0; y < tile.y1; y += kBand) {
        Band b = {job, tile.x0, tile.x1, y, y + kBand < tile.y1 ? y + kBand : tile.y1, {}, {}, {}, {}};
        find_weights(b);
        for (int channel = 0; channel < job.channels; ++channel) {
            total += find_edges(b, job.attribute + channel * plane);
            if (job.gradient) gather_gradient(b, job.gradient + channel * plane);
        }
    }
    return total;
}

}  // namespace texgs::TEXGS_ISA
