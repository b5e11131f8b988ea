// SPDX-License-Identifier: Apache-2.0
// Where on screen a surfel can reach alpha_min: an ellipse, a disc and their box.
#pragma once
#include "maths.cuh"
#include "raster.cuh"

namespace texgs::cuda {
namespace {

struct Box {
    float x0, y0, x1, y1;  // pixels

    __device__ void include(float x, float y) {
        x0 = fminf(x0, x), y0 = fminf(y0, y), x1 = fmaxf(x1, x), y1 = fmaxf(y1, y);
    }
};

struct Bounds {
    float ex, ey, xx, xy, yy;  // ellipse at level 1
    float disc;                // squared radius of the disc, -1 where the ellipse covers it
    bool behind;               // the ellipse is not one: the surfel reaches behind the camera
    Box box;
};

// Ellipse rho_surfel <= cut and disc rho_filter <= cut around (cx, cy).
__device__ inline Bounds bound(const Projection<float>& r, float cut, float cx, float cy, float low_pass) {
    Bounds b;
    const Conic<float> e = project_conic(cut, r.M);
    b.behind = e.ww > -1e-3f * r.p.z * r.p.z;
    // A thin ellipse has an ill-conditioned inverse; growing it by a fraction of a pixel only adds candidates.
    const float grow = fma(1e-6f, e.xx + e.yy, 1e-2f);
    const bool disc_only = r.scale == 0.0f;
    const float xx = disc_only ? 1e-2f : fmaxf(e.xx, 0.0f) + grow, yy = disc_only ? 1e-2f : fmaxf(e.yy, 0.0f) + grow;
    const float xy = disc_only ? 0.0f : e.xy;
    const float inverse = 1.0f / fmaxf(fma(-xy, xy, xx * yy), 1e-6f);
    b.ex = disc_only ? cx : cx + e.x, b.ey = disc_only ? cy : cy + e.y;
    b.xx = yy * inverse, b.xy = -xy * inverse, b.yy = xx * inverse;

    const float radius2 = cut / low_pass, radius = sqrt(radius2);
    const float split = 0.5f * (xx - yy);
    const float smallest = 0.5f * (xx + yy) - sqrt(fma(split, split, xy * xy)) - grow;
    const float reach = radius + sqrt((b.ex - cx) * (b.ex - cx) + (b.ey - cy) * (b.ey - cy));
    b.disc = reach * reach < smallest ? -1.0f : radius2;
    const float sx = sqrt(xx), sy = sqrt(yy);
    b.box = {fminf(b.ex - sx, cx - radius), fminf(b.ey - sy, cy - radius), fmaxf(b.ex + sx, cx + radius),
             fmaxf(b.ey + sy, cy + radius)};
    return b;
}

// Grows `box` by a surfel cut by the near plane: its square of half-width `side` sigma, clipped, projected around
// the principal point (cx, cy).
__device__ inline void include_clipped(const View& view, float cx, float cy, const Projection<float>& r, float side,
                                       float near_plane, Box& box) {
    const auto depth = [&](float u, float v) { return r.p.z + u * r.a.z + v * r.b.z; };
    const auto include = [&](float u, float v) {
        const float inverse = 1.0f / depth(u, v);
        box.include(view.fx * (r.p.x + u * r.a.x + v * r.b.x) * inverse + cx,
                    view.fy * (r.p.y + u * r.a.y + v * r.b.y) * inverse + cy);
    };
#pragma unroll
    for (int i = 0; i < 4; ++i) {
        const float su = i == 1 || i == 2 ? side : -side, sv = i >= 2 ? side : -side;  // corner i
        const float eu = i < 2 ? side : -side, ev = i == 1 || i == 2 ? side : -side;   // corner i + 1
        const float zs = depth(su, sv) - near_plane, ze = depth(eu, ev) - near_plane;
        if (zs > 0) include(su, sv);
        if ((zs > 0) != (ze > 0)) {
            const float t = zs / (zs - ze);
            include(su + t * (eu - su), sv + t * (ev - sv));
        }
    }
}

// First and one-past-last tile whose pixel centres the interval [low, high] can reach.
__device__ inline uint16_t first_tile(float low, int tiles) {
    const float t = (low - 0.5f) * (1.0f / kTile);
    return static_cast<uint16_t>(!(t > 0) ? 0 : t >= tiles ? tiles : static_cast<int>(t));
}
__device__ inline uint16_t last_tile(float high, int tiles) {
    const float t = (high - 0.5f) * (1.0f / kTile);
    return static_cast<uint16_t>(!(t >= 0) ? 0 : t >= tiles ? tiles : static_cast<int>(t) + 1);
}

}  // namespace
}  // namespace texgs::cuda
