// SPDX-License-Identifier: Apache-2.0
// The geometry of one surfel on one screen, see maths.h.
//
// A surfel is the plane p + u a + v b (camera space, u and v in standard deviations). With the homography M, whose
// rows u, v, w map (u, v, 1) to homogeneous pixels, its adjugate maps a pixel back to the plane:
//     (U, V, W) = adj(M) (x, y, 1),   u = U / W,   v = V / W,   depth z = det(M) / W.
// All three forms are affine in the pixel: a fragment costs three of them and one division. The origin of the pixel
// coordinates is moved to the surfel's low-pass centre, which avoids cancellation, and the forms are scaled so that
// W = 1 there.
#pragma once
#include "maths.h"
#include "slot.h"
#include "texgs.h"

namespace texgs::TEXGS_ISA {
namespace {

template <class F>
struct Surfel {
    static constexpr int kScales = 2;
    static constexpr bool kAffine = false;  // fragments divide by W
    using Sums = SurfelSums;

    Vec3<F> mean;
    F quat[4], scale[2], opacity;
};

// Rows of M, pixels counted from the principal point.
template <class F>
struct Homography {
    Vec3<F> u, v, w;
};

// Projected box of `sigma2` = sigma^2: its centre, and the covariance-like matrix of the ellipse at that level.
// Valid where `ww` < 0; otherwise the surfel reaches behind the camera.
template <class F>
struct Conic {
    F x, y, xx, xy, yy, ww;
};
template <class F>
TEXGS_MATHS F conic_entry(F sigma2, Vec3<F> a, Vec3<F> b) {
    return sigma2 * fma(a.x, b.x, a.y * b.y) - a.z * b.z;
}
template <class F>
TEXGS_MATHS Conic<F> project_conic(F sigma2, const Homography<F>& M) {
    Conic<F> c;
    c.ww = conic_entry(sigma2, M.w, M.w);
    const F inverse = F(1.0f) / c.ww;
    c.x = conic_entry(sigma2, M.u, M.w) * inverse;
    c.y = conic_entry(sigma2, M.v, M.w) * inverse;
    c.xx = c.x * c.x - conic_entry(sigma2, M.u, M.u) * inverse;
    c.xy = c.x * c.y - conic_entry(sigma2, M.u, M.v) * inverse;
    c.yy = c.y * c.y - conic_entry(sigma2, M.v, M.v) * inverse;
    return c;
}

// A surfel in camera space and on screen, as far as both forward and backward need it.
template <class F>
struct SurfelProjection {
    Pose<F> pose;
    Vec3<F> a, b;     // camera: scaled tangents
    Homography<F> M;  // about the low-pass centre
    F cx, cy;         // low-pass centre, from the principal point
    F filter_sigma2;  // 0 where the box of filter_sigma is not in front of the camera
    Vec3<F> A, B, C;  // adj(M) = [A B C]
    F scale;          // 1 / W at the centre; 0 for a surfel seen edge-on
};

template <class F>
TEXGS_MATHS SurfelProjection<F> project(const View& view, const Surfel<F>& s, const texgs_camera&,
                                        const texgs_options& o) {
    SurfelProjection<F> r;
    r.pose = make_pose(view, s.mean, s.quat);
    const Vec3<F> p = r.pose.p;
    r.a = s.scale[0] * rotate(view, r.pose.axes.u);
    r.b = s.scale[1] * rotate(view, r.pose.axes.v);

    const F fx = view.fx, fy = view.fy;
    Homography<F> M{{fx * r.a.x, fx * r.b.x, fx * p.x}, {fy * r.a.y, fy * r.b.y, fy * p.y}, {r.a.z, r.b.z, p.z}};
    const F sigma2 = o.filter_sigma * o.filter_sigma;
    const auto in_front = conic_entry(sigma2, M.w, M.w) < F(-1e-6f) * p.z * p.z;
    r.filter_sigma2 = select(in_front, sigma2, F(0.0f));
    const Conic<F> box = project_conic(r.filter_sigma2, M);
    r.cx = box.x, r.cy = box.y;
    r.M = {M.u - r.cx * M.w, M.v - r.cy * M.w, M.w};

    r.A = cross(r.M.v, r.M.w);
    r.B = cross(r.M.w, r.M.u);
    r.C = cross(r.M.u, r.M.v);
    // Below this ratio of the sides of its image, W is rounding error: only the low-pass disc is left of the surfel.
    const F sides = r.M.u.x * r.M.u.x + r.M.u.y * r.M.u.y + r.M.v.x * r.M.v.x + r.M.v.y * r.M.v.y;
    const auto edge_on = abs(r.C.z) <= max(F(1e-6f) * sides, F(1e-36f));  // 1 / C.z stays finite
    r.scale = select(edge_on, F(0.0f), F(1.0f) / r.C.z);
    return r;
}

// +1 or -1: the sign that turns the surfel's normal towards the camera.
template <class F>
TEXGS_MATHS F facing(const View& view, const Surfel<F>& s, const Axes<F>& axes) {
    const Vec3<F> ray = s.mean - Vec3<F>{F(view.position[0]), F(view.position[1]), F(view.position[2])};
    return select(dot(axes.n, ray) > F(0.0f), F(-1.0f), F(1.0f));
}

// Sums over a surfel's fragments from which all gradients of its geometry follow. gU, gV, gW are the derivatives of
// the loss with respect to the affine forms, e = alpha dL/dalpha, (dx, dy) the pixel from the low-pass centre.
// The sum of gW is missing: scaling U, V, W and zc together changes nothing, which gives it.
template <class F>
struct SurfelMoments {
    F u_dx, u_dy, u, v_dx, v_dy, v, w_dx, w_dy;
    F disc_dx, disc_dy;  // sum of e (dx, dy) over filtered fragments
    F e;                 // over all fragments
    F zc, zp;            // dL/d(depth of the plane at the centre), dL/d(depth of the mean), or 0
    Vec3<F> normal;      // dL/d(normal facing the camera), or 0
};

// From the sums s[k] of a slot, which holds those of the depth where they have gradients.
template <class F, class Slot>
TEXGS_MATHS SurfelMoments<F> read_moments(const Surfel<F>&, const Slot& s, bool depth) {
    using K = SurfelSums;
    SurfelMoments<F> m{s[K::kUdx], s[K::kUdy],    s[K::kU],      s[K::kVdx], s[K::kVdy], s[K::kV], s[K::kWdx],
                       s[K::kWdy], s[K::kDiscDx], s[K::kDiscDy], s[K::kE],   0.0f,       0.0f,     {0.0f, 0.0f, 0.0f}};
    if (depth) m.zc = s[K::kZc], m.zp = s[K::kZp];
    return m;
}

// The forms that fragments use.
template <class F>
TEXGS_MATHS Forms<F> affine_forms(const SurfelProjection<F>& r) {
    const F s = r.scale;
    return {s * r.A.x, s * r.B.x, s * r.C.x, s * r.A.y,          s * r.B.y,
            s * r.C.y, s * r.A.z, s * r.B.z, s * dot(r.M.w, r.C)};
}

// Adjoint of the low-pass centre c = (D_uw, D_vw) / D_ww, D = conic_entry; added to the gradient of M.
// M here counts pixels from c, where the quotient is 0 and its derivative simplest.
template <class F>
TEXGS_MATHS void centre_backward(const SurfelProjection<F>& r, F gx, F gy, Homography<F>& gM) {
    const F inverse = F(1.0f) / conic_entry(r.filter_sigma2, r.M.w, r.M.w);
    const auto weigh = [&](F g, Vec3<F> a) -> Vec3<F> {
        return {g * r.filter_sigma2 * a.x, g * r.filter_sigma2 * a.y, -(g * a.z)};
    };
    gx = gx * inverse, gy = gy * inverse;
    gM.u = gM.u + weigh(gx, r.M.w);
    gM.v = gM.v + weigh(gy, r.M.w);
    gM.w = gM.w + weigh(gx, r.M.u) + weigh(gy, r.M.v);
}

// Gradient of M (pixels from the low-pass centre) through adj(M) and det(M).
template <class F>
TEXGS_MATHS Homography<F> adjugate_backward(const SurfelProjection<F>& r, const SurfelMoments<F>& m, F sum_w) {
    const F s = r.scale;
    const Vec3<F> gA{s * m.u_dx, s * m.v_dx, s * m.w_dx}, gB{s * m.u_dy, s * m.v_dy, s * m.w_dy};
    const F g_det = s * m.zc;  // det = w . C
    const Vec3<F> gC = Vec3<F>{s * m.u, s * m.v, s * sum_w} + g_det * r.M.w;
    return {cross(gB, r.M.w) + cross(r.M.v, gC), cross(r.M.w, gA) + cross(gC, r.M.u),
            cross(gA, r.M.v) + cross(r.M.u, gB) + g_det * r.C};
}

template <class F>
TEXGS_MATHS Gradient<F, 2> project_backward(const View& view, const Surfel<F>& s, const SurfelProjection<F>& r,
                                            const SurfelMoments<F>& m, const texgs_options& o) {
    const Forms<F> f = affine_forms(r);
    const F sum_w = -(f.ux * m.u_dx + f.uy * m.u_dy + f.u * m.u + f.vx * m.v_dx + f.vy * m.v_dy + f.v * m.v +
                      f.wx * m.w_dx + f.wy * m.w_dy + f.zc * m.zc);
    const F disc_x = F(o.low_pass) * m.disc_dx, disc_y = F(o.low_pass) * m.disc_dy;  // dL/d(low-pass centre)
    Homography<F> gM = adjugate_backward(r, m, sum_w);
    centre_backward(r, disc_x, disc_y, gM);

    // M counts pixels from the centre: its rows u, v hold f a.x - c a.z and the like.
    const F fx = view.fx, fy = view.fy;
    const auto from_rows = [&](F gu, F gv, F gw) -> Vec3<F> { return {fx * gu, fy * gv, gw - r.cx * gu - r.cy * gv}; };
    const Vec3<F> ga = from_rows(gM.u.x, gM.v.x, gM.w.x), gb = from_rows(gM.u.y, gM.v.y, gM.w.y);
    Vec3<F> gp = from_rows(gM.u.z, gM.v.z, gM.w.z);
    gp.z = gp.z + m.zp;

    Gradient<F, 2> g;
    g.mean = rotate_back(view, gp);
    const Vec3<F> ga_world = rotate_back(view, ga), gb_world = rotate_back(view, gb);
    g.scale[0] = dot(ga_world, r.pose.axes.u);
    g.scale[1] = dot(gb_world, r.pose.axes.v);
    const F sign = facing(view, s, r.pose.axes);
    axes_backward(r.pose.w, r.pose.x, r.pose.y, r.pose.z, r.pose.inverse_norm,
                  Axes<F>{s.scale[0] * ga_world, s.scale[1] * gb_world, sign * m.normal}, g.quat);
    g.opacity = m.e / s.opacity;
    g.shift_x = disc_x - (f.ux * m.u + f.vx * m.v + f.wx * sum_w);
    g.shift_y = disc_y - (f.uy * m.u + f.vy * m.v + f.wy * sum_w);
    return g;
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
