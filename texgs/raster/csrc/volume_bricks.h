// SPDX-License-Identifier: Apache-2.0
// What every back end knows of a volume and its bricks, and what the C interface refuses before any work.
#pragma once
#include "both.h"
#include "status.h"
#include "texgs_light.h"

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
        bool is_alike = true;
        for (int a = 0; a < 3; ++a)
            is_alike &= volumes[c].size[a] == volumes->size[a] && volumes[c].half[a] == volumes->half[a];
        require(is_alike, "volumes: expected those that are shown together to have one lattice");
    }
}

inline void check_cast(const texgs_cast_view& view) {
    require(view.width >= 1 && view.height >= 1, "view: expected at least one pixel");
    require(view.width <= TEXGS_MAX_SIDE && view.height <= TEXGS_MAX_SIDE, "view: expected fewer pixels");
    require(view.step > 0.0f && view.opacity_unit > 0.0f, "view: expected a step and an opacity unit above 0");
    require(!view.face || (view.depth_range && (view.planes || !view.n_planes)),
            "view: expected depth ranges and planes with faces");
    for (int a = 0; view.light && a < 3; ++a)
        require(view.light_size[a] >= 2 && view.light_size[a] <= TEXGS_LIGHT_SIDE,
                "light: expected 2 to 256 cells along an axis");
    for (int a = 0; view.light && a < 3; ++a)
        require(view.light_half[a] > 0.0f && view.light_half[a] < 1e30f, "light: expected sides above 0");
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

}  // namespace texgs
