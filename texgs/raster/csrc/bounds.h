// SPDX-License-Identifier: Apache-2.0
// Where on screen a surfel or a Gaussian can reach alpha_min: an ellipse, a disc, their box and its tiles. Shared by
// every back end, as maths.h is.
//
// Include it after a header that declares, besides what maths.h needs, fnma and log2 for F, and kTile.
#pragma once
#include <cmath>
#include <cstdint>

#include "primitive.h"

namespace texgs::TEXGS_ISA {
namespace {

// What comparing F gives: bool, or a mask of lanes.
template <class F>
using Mask = decltype(F() < F());

template <class F>
struct Box {
    F x0, y0, x1, y1;  // pixels
};

template <class F>
struct Bounds {
    F ex, ey, xx, xy, yy;  // ellipse at level 1
    F disc;                // squared radius of the disc, -1 where the ellipse covers it
    Mask<F> behind;        // the ellipse is not one: the surfel reaches behind the camera
    Box<F> box;            // of ellipse and disc
    F sx, sy;              // half the sides of the ellipse's box
};

// What of a projected primitive is on screen, and what its fragments have to look out for.
template <class F>
struct Outline {
    Forms<F> forms;
    F log2_opacity, cut;  // of rho: beyond it alpha is below alpha_min
    F reach;              // largest difference of depth between a fragment and the mean
    Bounds<F> bounds;
    Mask<F> visible;         // drawn at all
    Mask<F> clipped;         // the near plane may cut it
    Mask<F> never_filtered;  // the low-pass filter rules none of its fragments
};

// Whether something around (cx, cy) is drawn at all, where its box meets the image.
template <class F>
TEXGS_MATHS Mask<F> is_visible(const Pose<F>& pose, F opacity, F cx, F cy, const texgs_options& o) {
    return (pose.p.z > F(o.near_plane)) & (opacity >= F(o.alpha_min)) & (abs(cx) < F(1e7f)) & (abs(cy) < F(1e7f)) &
           (pose.inverse_norm < F(1e18f));
}

// Fragments at this rho have alpha = alpha_min; a little more covers rounding.
template <class F>
TEXGS_MATHS F largest_rho(F log2_opacity, F log2_alpha_min) {
    return max(fma(2.0f * kLn2 * 1.0001f, log2_opacity - log2_alpha_min, 1e-3f), 1e-3f);
}

template <class F>
TEXGS_MATHS Mask<F> is_edge_on(const SurfelProjection<F>& r) {
    return abs(r.scale) <= F(0.0f);
}

// Forms of a surfel seen edge-on are so steep that rho_surfel never wins: it is its disc.
template <class F>
TEXGS_MATHS Forms<F> visible_forms(const SurfelProjection<F>& r, float low_pass) {
    const Mask<F> edge_on = is_edge_on(r);
    const F steep = F(1e4f) * sqrt(F(low_pass));
    Forms<F> f = affine_forms(r);
    f.ux = select(edge_on, steep, f.ux);
    f.vy = select(edge_on, steep, f.vy);
    f.zc = select(edge_on, r.pose.p.z, f.zc);
    return f;
}

// Ellipse rho_surfel <= cut and disc rho_filter <= cut around (cx, cy), in pixels.
template <class F>
TEXGS_MATHS Bounds<F> bound(const SurfelProjection<F>& r, F cut, F cx, F cy, float low_pass) {
    Bounds<F> b;
    const Conic<F> e = project_conic(cut, r.M);
    // Nearer to the camera's plane than a tenth of the depth, the ellipse is a difference of large numbers.
    b.behind = e.ww > F(-0.2f) * r.pose.p.z * r.pose.p.z;
    // A thin ellipse has an ill-conditioned inverse; growing it by a fraction of a pixel only adds candidates.
    const F grow = fma(1e-6f, e.xx + e.yy, 1e-2f);
    const Mask<F> disc_only = is_edge_on(r);
    const F xx = select(disc_only, 1e-2f, max(e.xx, 0.0f) + grow);
    const F yy = select(disc_only, 1e-2f, max(e.yy, 0.0f) + grow);
    const F xy = select(disc_only, 0.0f, e.xy);
    const F inverse = F(1.0f) / max(fnma(xy, xy, xx * yy), 1e-6f);
    b.ex = cx + select(disc_only, 0.0f, e.x), b.ey = cy + select(disc_only, 0.0f, e.y);
    b.xx = yy * inverse, b.xy = -(xy * inverse), b.yy = xx * inverse;

    const F radius2 = cut / F(low_pass), radius = sqrt(radius2);
    const F half_trace = F(0.5f) * (xx + yy);
    const F split = F(0.5f) * (xx - yy);
    const F smallest = half_trace - sqrt(fma(split, split, xy * xy)) - grow;
    const F reach = radius + sqrt((b.ex - cx) * (b.ex - cx) + (b.ey - cy) * (b.ey - cy));
    b.disc = select(reach * reach < smallest, -1.0f, radius2);
    b.sx = sqrt(xx), b.sy = sqrt(yy);
    b.box = {min(b.ex - b.sx, cx - radius), min(b.ey - b.sy, cy - radius), max(b.ex + b.sx, cx + radius),
             max(b.ey + b.sy, cy + radius)};
    return b;
}

// Whether rho_surfel rules every fragment with rho <= cut. Along a ray from the centre, where both vanish,
// rho_surfel / rho_filter is monotonous: it is enough to look at the two ends, the centre and the contour of the disc.
template <class F>
TEXGS_MATHS Mask<F> is_never_filtered(const Bounds<F>& b, const Forms<F>& f, const texgs_options& o) {
    if (o.filter_sigma > 0) return F(0.0f) < F(0.0f);
    const F xx = fma(f.ux, f.ux, f.vx * f.vx), yy = fma(f.uy, f.uy, f.vy * f.vy), xy = fma(f.ux, f.uy, f.vx * f.vy);
    const F split = F(0.5f) * (xx - yy);
    const F steepest = F(0.5f) * (xx + yy) + sqrt(fma(split, split, xy * xy));
    return (b.disc < F(0.0f)) & (steepest < F(0.999f * o.low_pass));
}

template <class F>
TEXGS_MATHS Outline<F> outline(const Surfel<F>& s, const SurfelProjection<F>& r, F cx, F cy, const texgs_options& o) {
    Outline<F> out;
    out.forms = visible_forms(r, o.low_pass);
    out.log2_opacity = log2(max(s.opacity, 1e-30f));
    out.cut = largest_rho(out.log2_opacity, log2(F(o.alpha_min)));
    out.reach = sqrt(out.cut * fma(r.a.z, r.a.z, r.b.z * r.b.z));
    out.clipped = r.pose.p.z - out.reach <= F(o.near_plane);
    out.bounds = bound(r, out.cut, cx, cy, o.low_pass);
    out.visible = is_visible(r.pose, s.opacity, cx, cy, o);
    out.never_filtered = is_never_filtered(out.bounds, out.forms, o);
    return out;
}

// The ellipse rho <= cut alone, grown like that of a surfel.
template <class F>
TEXGS_MATHS Outline<F> outline(const Gaussian<F>&, const GaussianProjection<F>& r, F cx, F cy, const texgs_options& o) {
    Outline<F> out;
    out.forms = affine_forms(r);
    out.log2_opacity = log2(max(r.opacity, 1e-30f));
    out.cut = largest_rho(out.log2_opacity, log2(F(o.alpha_min)));
    const F grow = fma(F(1e-6f) * out.cut, r.xx + r.yy, 1e-2f);
    const F xx = fma(out.cut, r.xx, grow), yy = fma(out.cut, r.yy, grow), xy = out.cut * r.xy;
    const F determinant = fma(out.cut * out.cut, r.area + r.growth, grow * (out.cut * (r.xx + r.yy) + grow));
    const F inverse = F(1.0f) / determinant, sx = sqrt(xx), sy = sqrt(yy);
    const Mask<F> none = F(0.0f) < F(0.0f), all = F(0.0f) <= F(0.0f);
    out.bounds = {
        cx, cy, yy * inverse, -(xy * inverse), xx * inverse, -1.0f, none, {cx - sx, cy - sy, cx + sx, cy + sy}, sx, sy};
    out.visible = is_visible(r.pose, r.opacity, cx, cy, o) & (determinant < F(1e30f));
    out.clipped = none, out.never_filtered = all, out.reach = 0.0f;
    return out;
}

// The plane p + u a + v b of one surfel, in the camera.
struct Plane {
    Vec3<float> p, a, b;
};

TEXGS_MATHS void include(Box<float>& box, float x, float y) {
    box.x0 = x < box.x0 ? x : box.x0, box.y0 = y < box.y0 ? y : box.y0;
    box.x1 = x > box.x1 ? x : box.x1, box.y1 = y > box.y1 ? y : box.y1;
}

// Grows `box` by a surfel cut by the near plane: its square of half-width `side` sigma, clipped, projected around
// the principal point (x, y).
TEXGS_MATHS void include_clipped(const View& view, float x, float y, const Plane& s, float side, float near_plane,
                                 Box<float>& box) {
    const float corner[4][2] = {{-side, -side}, {side, -side}, {side, side}, {-side, side}};
    const auto depth = [&](float u, float v) { return s.p.z + u * s.a.z + v * s.b.z; };
    const auto include_point = [&](float u, float v) {
        const float z = ::fmaxf(depth(u, v), near_plane);  // rounding may bring the crossing to either side of 0
        include(box, view.fx * (s.p.x + u * s.a.x + v * s.b.x) / z + x,
                view.fy * (s.p.y + u * s.a.y + v * s.b.y) / z + y);
    };
    for (int i = 0; i < 4; ++i) {
        const float *from = corner[i], *to = corner[(i + 1) % 4];
        const float z_from = depth(from[0], from[1]) - near_plane, z_to = depth(to[0], to[1]) - near_plane;
        if (z_from > 0) include_point(from[0], from[1]);
        if ((z_from > 0) != (z_to > 0)) {
            const float t = z_from / (z_from - z_to);
            include_point(from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1]));
        }
    }
}

// The box of a surfel that reaches behind the camera: of its disc around (cx, cy), and of its part beyond the near
// plane where rho_surfel <= cut.
TEXGS_MATHS Box<float> clipped_box(const View& view, float x, float y, const Plane& s, float cx, float cy, float cut,
                                   const texgs_options& o) {
    const float radius = ::sqrtf(cut / o.low_pass);
    Box<float> box = {cx - radius, cy - radius, cx + radius, cy + radius};
    include_clipped(view, x, y, s, ::sqrtf(cut), o.near_plane, box);
    return box;
}

// First and one-past-last tile whose pixel centres the interval [low, high] can reach.
TEXGS_MATHS uint16_t first_tile(float low, int tiles) {
    const float t = (low - 0.5f) * (1.0f / kTile);
    return static_cast<uint16_t>(!(t > 0) ? 0 : t >= tiles ? tiles : static_cast<int>(t));
}
TEXGS_MATHS uint16_t last_tile(float high, int tiles) {
    const float t = (high - 0.5f) * (1.0f / kTile);
    return static_cast<uint16_t>(!(t >= 0) ? 0 : t >= tiles ? tiles : static_cast<int>(t) + 1);
}

// The footprint's tiles; false where there are none.
template <class Footprint>
TEXGS_MATHS bool cover_tiles(const Box<float>& box, int tiles_x, int tiles_y, Footprint& foot) {
    foot.x0 = first_tile(box.x0, tiles_x), foot.x1 = last_tile(box.x1, tiles_x);
    foot.y0 = first_tile(box.y0, tiles_y), foot.y1 = last_tile(box.y1, tiles_y);
    return foot.x0 < foot.x1 && foot.y0 < foot.y1;
}

// Half of the box's longer side, at most the image's diagonal.
TEXGS_MATHS float half_extent(const Box<float>& box, float diagonal) {
    const float width = box.x1 - box.x0, height = box.y1 - box.y0, longer = width > height ? width : height;
    return 0.5f * (longer < 2 * diagonal ? longer : 2 * diagonal);
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
