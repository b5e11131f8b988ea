// SPDX-License-Identifier: Apache-2.0
// The geometry of one 3D Gaussian on one screen (EWA splatting as in 3DGS), see maths.h.
//
// The derivative J of the perspective projection at the mean maps the scaled axes m_k of the Gaussian to vectors t_k on
// screen; its image has the covariance sum t_k t_k^T, dilated by a constant. Its inverse is U^T U with the triangular
//     U = [ux uy; 0 vy],   (u, v) = U (dx, dy),   rho = u^2 + v^2:
// the forms of a surfel with W = 1 everywhere. Determinants are sums of squares of the areas t_j x t_k (Cauchy-Binet),
// and sums over fragments are taken of (u, v): thin Gaussians lose no digits.
#pragma once
#include "maths.h"
#include "slot.h"
#include "texgs.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr float kSlopeMargin = 0.3f;    // of half the field of view, beyond which J is taken at its edge, as in 3DGS
constexpr float kLeastRatio = 2.5e-5f;  // of squared areas without and with the dilation, as in 3DGS

template <class F>
struct Gaussian {
    static constexpr int kScales = 3;
    static constexpr bool kAffine = true;  // W = 1: fragments need no division
    using Sums = GaussianSums;

    Vec3<F> mean;
    F quat[4], scale[3], opacity;
};

template <class F>
struct Vec2 {
    F x, y;
};
template <class F>
TEXGS_MATHS F cross(Vec2<F> a, Vec2<F> b) {
    return a.x * b.y - a.y * b.x;
}

// A Gaussian in camera space and on screen, as far as both forward and backward need it.
template <class F>
struct GaussianProjection {
    Pose<F> pose;
    Vec3<F> axis[3];    // camera, scaled
    Vec2<F> t[3];       // on screen, pixels
    Vec2<F> focal;      // focal lengths / depth
    Vec2<F> slope, at;  // x / z and y / z of the mean, and where J is taken
    F cx, cy;           // mean on screen, from the principal point
    F area, growth;     // determinant of the covariance, and by how much the dilation enlarges it
    F xx, xy, yy;       // covariance, dilated
    F opacity;          // as drawn
    F ux, uy, vy;       // U
};

// One axis of slope and at: at the pixel 0 and at `extent` the field of view ends.
template <class F>
TEXGS_MATHS F limit_slope(F slope, float focal, float principal, float extent) {
    const float margin = kSlopeMargin * extent / (2 * focal);
    return min(max(slope, F(-principal / focal - margin)), F((extent - principal) / focal + margin));
}

template <class F>
TEXGS_MATHS GaussianProjection<F> project(const View& view, const Gaussian<F>& s, const texgs_camera& camera,
                                          const texgs_options& o) {
    GaussianProjection<F> r;
    r.pose = make_pose(view, s.mean, s.quat);
    const F inverse_z = F(1.0f) / r.pose.p.z;
    r.focal = {F(view.fx) * inverse_z, F(view.fy) * inverse_z};
    r.slope = {r.pose.p.x * inverse_z, r.pose.p.y * inverse_z};
    r.at = {limit_slope(r.slope.x, view.fx, view.cx, static_cast<float>(camera.width)),
            limit_slope(r.slope.y, view.fy, view.cy, static_cast<float>(camera.height))};
    r.cx = F(view.fx) * r.slope.x, r.cy = F(view.fy) * r.slope.y;
    const Vec3<F> world[3] = {r.pose.axes.u, r.pose.axes.v, r.pose.axes.n};
    for (int k = 0; k < 3; ++k) {
        const Vec3<F> m = r.axis[k] = s.scale[k] * rotate(view, world[k]);
        r.t[k] = {r.focal.x * (m.x - r.at.x * m.z), r.focal.y * (m.y - r.at.y * m.z)};
    }

    const F a = cross(r.t[0], r.t[1]), b = cross(r.t[1], r.t[2]), c = cross(r.t[2], r.t[0]), dilation = o.dilation;
    const F xx = fma(r.t[0].x, r.t[0].x, fma(r.t[1].x, r.t[1].x, r.t[2].x * r.t[2].x));
    const F yy = fma(r.t[0].y, r.t[0].y, fma(r.t[1].y, r.t[1].y, r.t[2].y * r.t[2].y));
    r.area = fma(a, a, fma(b, b, c * c));
    r.growth = dilation * (xx + yy + dilation);
    r.xx = xx + dilation, r.yy = yy + dilation;
    r.xy = fma(r.t[0].x, r.t[0].y, fma(r.t[1].x, r.t[1].y, r.t[2].x * r.t[2].y));
    const F determinant = r.area + r.growth;
    r.opacity = o.antialiased ? s.opacity * sqrt(max(r.area / determinant, F(kLeastRatio))) : s.opacity;
    r.vy = F(1.0f) / sqrt(r.yy);
    r.ux = sqrt(r.yy / determinant);
    r.uy = -(r.xy * r.vy / sqrt(determinant));
    return r;
}

// The forms that fragments use.
template <class F>
TEXGS_MATHS Forms<F> affine_forms(const GaussianProjection<F>& r) {
    return {r.ux, r.uy, 0.0f, 0.0f, r.vy, 0.0f, 0.0f, 0.0f, r.pose.p.z};
}

// Sums over a Gaussian's fragments from which all gradients of its geometry follow; e = alpha dL/dalpha.
template <class F>
struct GaussianMoments {
    F e, u, v, uu, uv, vv;  // sums of e, e u, e v, e u u, e u v, e v v
    F z;                    // dL/d(depth of the mean), or 0
};

// From the sums s[k] of a slot, which holds that of the depth where it has a gradient.
template <class F, class Slot>
TEXGS_MATHS GaussianMoments<F> read_moments(const Gaussian<F>&, const Slot& s, bool depth) {
    using K = GaussianSums;
    GaussianMoments<F> m{s[K::kE], s[K::kU], s[K::kV], s[K::kUU], s[K::kUV], s[K::kVV], 0.0f};
    if (depth) m.z = s[K::kZ];
    return m;
}

// dL/dt_k of the factor sqrt(area / (area + growth)) on the opacity.
template <class F>
TEXGS_MATHS Vec2<F> ratio_backward(const GaussianProjection<F>& r, int k, F e, float dilation) {
    const F determinant = r.area + r.growth;
    const auto is_free = r.area > F(kLeastRatio) * determinant;
    const F by_area = select(is_free, e * r.growth / (r.area * determinant), 0.0f);  // dL/d(area), twice
    const F by_trace = select(is_free, -(e * F(dilation) / determinant), 0.0f);
    const Vec2<F> t = r.t[k], next = r.t[(k + 1) % 3], last = r.t[(k + 2) % 3];
    const F a = cross(t, next), b = cross(t, last);
    return {fma(by_area, fma(a, next.y, b * last.y), by_trace * t.x),
            fma(by_trace, t.y, -(by_area * fma(a, next.x, b * last.x)))};
}

// dL/dt_k: with the gradient G = U^T E U / 2 of the covariance, E the sums of e times products of u and v, 2 G t_k.
template <class F>
TEXGS_MATHS Vec2<F> axis_backward(const GaussianProjection<F>& r, const GaussianMoments<F>& m, int k,
                                  const texgs_options& o) {
    const F u = fma(r.ux, r.t[k].x, r.uy * r.t[k].y), v = r.vy * r.t[k].y;
    const F gu = fma(m.uu, u, m.uv * v), gv = fma(m.uv, u, m.vv * v);
    const Vec2<F> g{r.ux * gu, fma(r.uy, gu, r.vy * gv)};
    if (!o.antialiased) return g;
    const Vec2<F> more = ratio_backward(r, k, m.e, o.dilation);
    return {g.x + more.x, g.y + more.y};
}

template <class F>
TEXGS_MATHS Gradient<F, 3> project_backward(const View& view, const Gaussian<F>& s, const GaussianProjection<F>& r,
                                            const GaussianMoments<F>& m, const texgs_options& o) {
    Gradient<F, 3> g;
    const Vec3<F> world[3] = {r.pose.axes.u, r.pose.axes.v, r.pose.axes.n};
    Vec3<F> by_axis[3];
    Vec2<F> by_at{0.0f, 0.0f};  // dL/d(r.at)
    F radial = 0.0f;            // -dL/d(log depth) through the focal lengths
    for (int k = 0; k < 3; ++k) {
        const Vec2<F> t = axis_backward(r, m, k, o);
        const F x = r.focal.x * t.x, y = r.focal.y * t.y;
        radial = fma(t.x, r.t[k].x, fma(t.y, r.t[k].y, radial));
        by_at = {by_at.x - x * r.axis[k].z, by_at.y - y * r.axis[k].z};
        const Vec3<F> turned = rotate_back(view, Vec3<F>{x, y, -fma(r.at.x, x, r.at.y * y)});
        g.scale[k] = dot(turned, world[k]);
        by_axis[k] = s.scale[k] * turned;
    }
    axes_backward(r.pose.w, r.pose.x, r.pose.y, r.pose.z, r.pose.inverse_norm,
                  Axes<F>{by_axis[0], by_axis[1], by_axis[2]}, g.quat);

    g.shift_x = r.ux * m.u;
    g.shift_y = fma(r.uy, m.u, r.vy * m.v);
    const F inverse_z = F(1.0f) / r.pose.p.z;
    // Where a slope is limited, it does not follow the mean.
    const F slope_x = select(abs(r.slope.x - r.at.x) > F(0.0f), 0.0f, by_at.x * inverse_z);
    const F slope_y = select(abs(r.slope.y - r.at.y) > F(0.0f), 0.0f, by_at.y * inverse_z);
    const F px = fma(r.focal.x, g.shift_x, slope_x), py = fma(r.focal.y, g.shift_y, slope_y);
    const F pz = m.z - fma(px, r.slope.x, fma(py, r.slope.y, radial * inverse_z));
    g.mean = rotate_back(view, Vec3<F>{px, py, pz});
    g.opacity = m.e / s.opacity;
    return g;
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
