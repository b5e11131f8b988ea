// SPDX-License-Identifier: Apache-2.0
// What is known of a volume's bricks and cells on CPUs: extremes of values, and where a transfer function shows some.
#include "../volume_bricks.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "chebyshev.h"
#include "dispatch.h"
#include "parallel.h"
#include "volume_kernels.h"

namespace texgs {

void check_transfer(const texgs_transfer& transfer) {
    check_points(transfer);
    for (int i = 1; i < transfer.n; ++i)
        require(transfer.points[5 * i] >= transfer.points[5 * i - 5], "transfer function: expected ascending values");
    require(transfer.points[5 * transfer.n - 5] > transfer.points[0], "transfer function: expected a range of values");
}

namespace {

constexpr int kBrick = TEXGS_BRICK;

// Extremes of a row of bricks (by, bz), and how many of the samples that are no other row's are NaN.
template <class T>
int64_t row_extremes(const texgs_volume& volume, const int32_t bricks[3], int by, int bz, float* extremes) {
    const T* values = static_cast<const T*>(volume.values);
    const int32_t nx = volume.size[0], ny = volume.size[1], nz = volume.size[2];
    for (int b = 0; b < bricks[0]; ++b)
        extremes[2 * b] = std::numeric_limits<float>::infinity(), extremes[2 * b + 1] = -extremes[2 * b];
    const int z_end = std::min(kBrick * bz + kBrick, nz - 1), y_end = std::min(kBrick * by + kBrick, ny - 1);
    int64_t missing = 0;
    for (int z = kBrick * bz; z <= z_end; ++z)
        for (int y = kBrick * by; y <= y_end; ++y) {
            const T* row = values + (int64_t(z) * ny + y) * nx;
            const bool is_own = (z < kBrick * bz + kBrick || z == nz - 1) && (y < kBrick * by + kBrick || y == ny - 1);
            for (int b = 0; b < bricks[0]; ++b) {
                float low = extremes[2 * b], high = extremes[2 * b + 1];
                for (int x = kBrick * b, end = std::min(x + kBrick, nx - 1); x <= end; ++x) {
                    const float value = static_cast<float>(row[x]);
                    low = value < low ? value : low;
                    high = value > high ? value : high;
                    missing += value != value && is_own && (x < kBrick * b + kBrick || x == nx - 1);
                }
                extremes[2 * b] = low, extremes[2 * b + 1] = high;
            }
        }
    return missing;
}

using RowExtremes = int64_t (*)(const texgs_volume&, const int32_t[3], int, int, float*);
constexpr RowExtremes kRowExtremes[] = {
    row_extremes<uint8_t>,  row_extremes<int8_t>,  row_extremes<uint16_t>, row_extremes<int16_t>,
    row_extremes<uint32_t>, row_extremes<int32_t>, row_extremes<uint64_t>, row_extremes<int64_t>,
    row_extremes<float>,    row_extremes<double>,
};

// Values that a transfer function shows, ends included.
struct Range {
    float low, high;
};

// The fewest ranges, so that `shows` holds of values that reach into one of them.
std::vector<Range> shown_ranges(const texgs_transfer& transfer) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    std::vector<Range> ranges;
    for (int i = 0; i + 1 < transfer.n; ++i) {
        const float *p = transfer.points + 5 * i, *q = p + 5;
        const float start = q[0] > p[0] ? p[1] : q[1], end = q[1];
        if (!(start > 0.0f || end > 0.0f)) continue;
        const Range range{start > 0.0f ? p[0] : std::nextafter(p[0], kInfinity),
                          end > 0.0f ? q[0] : std::nextafter(q[0], -kInfinity)};
        if (!ranges.empty() && range.low <= ranges.back().high)
            ranges.back().high = range.high;
        else
            ranges.push_back(range);
    }
    return ranges;
}

// The smaller and the larger ones of neighbouring values: n values from and n values `away` behind these.
struct Extremes {
    float low[5 * 20], high[5 * 20];

    void merge(const Extremes& from, int to, int first, int away, int n) {
        for (int i = 0; i < n; ++i) {
            const float *l = from.low + first + i, *h = from.high + first + i;
            low[to + i] = l[away] < l[0] ? l[away] : l[0];
            high[to + i] = h[away] > h[0] ? h[away] : h[0];
        }
    }
};

// Sets a bit for each cell of a brick in which something may show.
template <class T>
void set_cells(const texgs_volume& volume, const std::vector<Range>& ranges, const int32_t (&brick)[3],
               uint32_t (&words)[2]) {
    int64_t at[3][kBrick + 1];
    int cells[3];
    for (int a = 0; a < 3; ++a) {
        cells[a] = std::min(kBrick, volume.size[a] - 1 - kBrick * brick[a]);
        for (int i = 0; i <= kBrick; ++i) at[a][i] = kBrick * brick[a] + std::min(i, cells[a]);
    }
    Extremes x, y, z;
    for (int k = 0; k <= kBrick; ++k)
        for (int j = 0; j <= kBrick; ++j) {
            const T* row =
                static_cast<const T*>(volume.values) + (at[2][k] * volume.size[1] + at[1][j]) * volume.size[0];
            float value[kBrick + 1];
            for (int i = 0; i <= kBrick; ++i) value[i] = static_cast<float>(row[at[0][i]]);
            for (int i = 0; i < kBrick; ++i) {
                x.low[20 * k + 4 * j + i] = std::min(value[i], value[i + 1]);
                x.high[20 * k + 4 * j + i] = std::max(value[i], value[i + 1]);
            }
        }
    for (int k = 0; k <= kBrick; ++k) y.merge(x, 16 * k, 20 * k, kBrick, 16);
    z.merge(y, 0, 0, 16, 64);
    uint8_t shown[64] = {};
    for (const Range& range : ranges)
        for (int i = 0; i < 64; ++i) shown[i] |= (z.low[i] <= range.high) & (z.high[i] >= range.low);
    for (int i = 0; i < 64; ++i) {
        const bool is_inside = i % 4 < cells[0] && i / 4 % 4 < cells[1] && i / 16 < cells[2];
        words[i / 32] |= uint32_t(is_inside && shown[i]) << i % 32;
    }
}

using SetCells = void (*)(const texgs_volume&, const std::vector<Range>&, const int32_t (&)[3], uint32_t (&)[2]);
constexpr SetCells kSetCells[] = {
    set_cells<uint8_t>, set_cells<int8_t>,   set_cells<uint16_t>, set_cells<int16_t>, set_cells<uint32_t>,
    set_cells<int32_t>, set_cells<uint64_t>, set_cells<int64_t>,  set_cells<float>,   set_cells<double>,
};

}  // namespace
}  // namespace texgs

using namespace texgs;

int64_t texgs_volume_bricks(const texgs_volume* volume, int32_t size[3]) { return count_bricks(*volume, size); }

int32_t texgs_volume_extremes(const texgs_volume* volume, float* extremes, int64_t* missing, void*) {
    return guarded([&] {
        check_volume(*volume);
        int32_t size[3];
        count_bricks(*volume, size);
        std::atomic<int64_t> all{0};
        parallel_for(int64_t(size[1]) * size[2], 1, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i)
                all += kRowExtremes[volume->type](*volume, size, static_cast<int>(i % size[1]),
                                                  static_cast<int>(i / size[1]), extremes + 2 * i * size[0]);
        });
        *missing = all;
    });
}

int32_t texgs_volume_distance(const texgs_volume* volume, const float* extremes, const texgs_transfer* transfer,
                              uint8_t* distance, void*) {
    return guarded([&] {
        check_volume(*volume);
        check_transfer(*transfer);
        int32_t size[3];
        count_bricks(*volume, size);
        const int64_t count = int64_t(size[0]) * size[1] * size[2];
        parallel_for(count, 1024, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i)
                distance[i] = shows(*transfer, extremes[2 * i], extremes[2 * i + 1]) ? 0 : 255;
        });
        spread_distances({size[2], size[1], size[0]}, distance);
    });
}

int32_t texgs_volume_cells(const texgs_volume* volume, const uint8_t* distance, const texgs_transfer* transfer,
                           uint32_t* cells, void*) {
    return guarded([&] {
        check_volume(*volume);
        check_transfer(*transfer);
        const std::vector<Range> ranges = shown_ranges(*transfer), in_mask{{TEXGS_INSIDE, 255.0f}};
        texgs_volume mask = *volume;
        mask.values = transfer->within;
        int32_t size[3];
        parallel_for(count_bricks(*volume, size), 64, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i) {
                uint32_t words[2] = {};
                const int32_t row = static_cast<int32_t>(i / size[0]);
                const int32_t brick[3] = {static_cast<int32_t>(i % size[0]), row % size[1], row / size[1]};
                if (!distance[i]) kSetCells[volume->type](*volume, ranges, brick, words);
                if (transfer->within && (words[0] | words[1])) {
                    uint32_t inside[2] = {};
                    set_cells<uint8_t>(mask, in_mask, brick, inside);
                    words[0] &= inside[0], words[1] &= inside[1];
                }
                cells[2 * i] = words[0], cells[2 * i + 1] = words[1];
            }
        });
    });
}
