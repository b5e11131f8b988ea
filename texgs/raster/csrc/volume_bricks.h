// SPDX-License-Identifier: Apache-2.0
// What every back end knows of a volume and its bricks, and what the C interface refuses before any work.
#pragma once
#include <cmath>

#include "both.h"
#include "status.h"
#include "texgs_volume.h"

namespace texgs {

inline void check_volume(const texgs_volume& volume) {
    require(volume.type >= TEXGS_U8 && volume.type <= TEXGS_F64, "volume: expected a known type of samples");
    int64_t bricks = 1;
    for (int a = 0; a < 3; ++a) {
        require(volume.size[a] >= 2 && volume.size[a] < 1 << 20,
                "volume: expected 2 to 2^20 - 1 samples along an axis");
        require(volume.half[a] > 0.0f && volume.half[a] < 1e30f, "volume: expected sides above 0");
        bricks *= (volume.size[a] + TEXGS_BRICK - 2) / TEXGS_BRICK;
    }
    require(bricks < int64_t(1) << 30, "volume: expected fewer samples");
}

inline void check_points(const texgs_transfer& transfer) {
    require(transfer.n >= 2 && transfer.n <= 1 << 16, "transfer function: expected 2 to 65536 points");
}

inline void check_channels(const texgs_volume* volumes, const texgs_transfer* transfers, int32_t n) {
    require(n >= 1 && n <= TEXGS_CHANNELS, "volumes: expected 1 to 16 that are shown together");
    for (int c = 0; c < n; ++c) {
        check_volume(volumes[c]);
        check_points(transfers[c]);
        bool is_alike = volumes[c].type == volumes->type;
        for (int a = 0; a < 3; ++a)
            is_alike &= volumes[c].size[a] == volumes->size[a] && volumes[c].half[a] == volumes->half[a];
        require(is_alike, "volumes: expected those that are shown together to have one lattice and type");
    }
}

inline void check_cast(const texgs_cast_view& view) {
    require(view.width >= 1 && view.height >= 1, "view: expected at least one pixel");
    require(view.width <= TEXGS_MAX_SIDE && view.height <= TEXGS_MAX_SIDE, "view: expected fewer pixels");
    require(view.step > 0.0f && view.opacity_unit > 0.0f, "view: expected a step and an opacity unit above 0");
    require(!view.face || (view.depth_range && view.planes), "view: expected depth ranges and planes with faces");
}

inline int64_t count_bricks(const texgs_volume& volume, int32_t size[3]) {
    for (int a = 0; a < 3; ++a) size[a] = (volume.size[a] + TEXGS_BRICK - 2) / TEXGS_BRICK;
    return int64_t(size[0]) * size[1] * size[2];
}

// Whether a transfer function shows anything of values from low to high: opacities are at least 0.
TEXGS_MATHS bool shows(const texgs_transfer& transfer, float low, float high) {
    for (int i = 0; i + 1 < transfer.n; ++i) {
        const float *p = transfer.points + 5 * i, *q = p + 5;
        if (low > q[0] || high < p[0]) continue;
        const float start = q[0] > p[0] ? p[1] : q[1], end = q[1];
        if (start > 0.0f && (end > 0.0f || low < q[0])) return true;
        if (end > 0.0f && high > p[0]) return true;
    }
    return false;
}

// The extremes of values; those of NaN are infinite.
struct Extremes {
    float low = INFINITY, high = -INFINITY;

    TEXGS_MATHS void add(Extremes others) {
        low = others.low < low ? others.low : low;
        high = others.high > high ? others.high : high;
    }
};

// In which cells of a word, half a brick, something may show.
template <class T>
TEXGS_MATHS uint32_t shown_cells(const texgs_volume& volume, const texgs_transfer& transfer, int64_t word) {
    int32_t first[3];
    int64_t brick = word / 2;
    for (int a = 0; a < 3; ++a) {
        const int32_t along = (volume.size[a] + TEXGS_BRICK - 2) / TEXGS_BRICK;
        first[a] = TEXGS_BRICK * static_cast<int32_t>(brick % along);
        brick /= along;
    }
    first[2] += TEXGS_BRICK / 2 * static_cast<int32_t>(word % 2);
    const int64_t row = volume.size[0], slice = row * volume.size[1];
    const int32_t end = first[0] + TEXGS_BRICK < volume.size[0] - 1 ? TEXGS_BRICK : volume.size[0] - 1 - first[0];
    uint32_t cells = 0;
    for (int32_t i = 0; i < 8; ++i) {
        const int32_t y = first[1] + i % 4, z = first[2] + i / 4;
        if (y > volume.size[1] - 2 || z > volume.size[2] - 2) continue;
        const T* from = static_cast<const T*>(volume.values) + z * slice + y * row + first[0];
        Extremes before;
        for (int32_t x = 0; x <= end; ++x, ++from) {
            Extremes face;
            const int64_t corners[4] = {0, row, slice, slice + row};
            for (const int64_t corner : corners) {
                const float value = static_cast<float>(from[corner]);
                face.add({value, value});
            }
            before.add(face);
            if (x && shows(transfer, before.low, before.high)) cells |= uint32_t(1) << (4 * i + x - 1);
            before = face;
        }
    }
    return cells;
}

}  // namespace texgs
