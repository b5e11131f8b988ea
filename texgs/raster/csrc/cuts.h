// SPDX-License-Identifier: Apache-2.0
// The planes of a cut as rays meet them, shared by every back end.
#pragma once
#include <cmath>

#include "both.h"
#include "checks.h"

namespace texgs {

// A plane before a camera: a ray whose pixel centre is (x, y) meets it at camera z height / slope, slope = x_slope x +
// y_slope y + constant, and is behind it where slope * z <= height.
struct SeenPlane {
    float x_slope, y_slope, constant, height;

    TEXGS_MATHS float slope(float x, float y) const { return x_slope * x + (y_slope * y + constant); }
};

TEXGS_MATHS SeenPlane seen_plane(const texgs_camera& camera, const float* plane) {
    const float *m = camera.viewmat, *K = camera.K;
    double normal[3], height = plane[3];
    for (int i = 0; i < 3; ++i) {
        normal[i] = 0.0;
        for (int a = 0; a < 3; ++a) normal[i] += double(m[4 * i + a]) * plane[a];
        height += normal[i] * m[4 * i + 3];
    }
    const float x = static_cast<float>(normal[0]) / K[0], y = static_cast<float>(normal[1]) / K[4];
    const double constant = normal[2] - double(x) * K[2] - double(y) * K[5];
    return {x, y, static_cast<float>(constant), static_cast<float>(height)};
}

// What counts of a ray, from the camera on, and the plane through which it enters.
TEXGS_MATHS void cut(int32_t plane, float slope, float height, float& near, float& far, int32_t& face) {
    const float z = height / ::fabsf(slope);  // 0 / 0 in the plane itself: all counts
    const bool enters = slope < 0.0f && near < -z;
    near = enters ? -z : near;
    face = enters ? plane : face;
    far = slope >= 0.0f && z < far ? z : far;
}

inline void check_planes(int32_t n) { require(n >= 0 && n <= TEXGS_MAX_PLANES, "planes: expected 12 at most"); }

}  // namespace texgs
