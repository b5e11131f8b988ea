// SPDX-License-Identifier: Apache-2.0
// The geometry of one surfel on one screen, shared by every back end: F is float (CUDA, scalar) or a vector of
// floats (CPU), so that a line here handles one surfel or sixteen.
//
// A surfel is the plane p + u a + v b (camera space, u and v in standard deviations). With the homography M, whose
// rows u, v, w map (u, v, 1) to homogeneous pixels, its adjugate maps a pixel back to the plane:
//     (U, V, W) = adj(M) (x, y, 1),   u = U / W,   v = V / W,   depth z = det(M) / W.
// All three forms are affine in the pixel: a fragment costs three of them and one division. The origin of the pixel
// coordinates is moved to the surfel's low-pass centre, which avoids cancellation, and the forms are scaled so that
// W = 1 there.
//
// Include it after a header that declares fma, select, sqrt, abs and comparisons for F in namespace texgs::TEXGS_ISA.
#pragma once

#ifdef __CUDACC__
#define TEXGS_MATHS __host__ __device__ inline
#else
#define TEXGS_MATHS inline
#endif

namespace texgs::TEXGS_ISA {
namespace {

constexpr float kLargestAlpha = 0.99f;  // keeps 1 / (1 - alpha) finite, as in 3DGS
constexpr float kLog2E = 1.44269504f;
constexpr float kLn2 = 0.69314718f;

template <class F>
struct Vec3 {
    F x, y, z;
};
template <class F>
TEXGS_MATHS Vec3<F> operator+(Vec3<F> a, Vec3<F> b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class F>
TEXGS_MATHS Vec3<F> operator-(Vec3<F> a, Vec3<F> b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class F>
TEXGS_MATHS Vec3<F> operator*(F s, Vec3<F> a) {
    return {s * a.x, s * a.y, s * a.z};
}
template <class F>
TEXGS_MATHS F dot(Vec3<F> a, Vec3<F> b) {
    return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z));
}
template <class F>
TEXGS_MATHS Vec3<F> cross(Vec3<F> a, Vec3<F> b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// World to camera, intrinsics, and the camera's position in the world.
struct View {
    float R[9], t[3], fx, fy, cx, cy, position[3];
};

TEXGS_MATHS View make_view(const float* viewmat, const float* K) {
    View v;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) v.R[3 * i + j] = viewmat[4 * i + j];
        v.t[i] = viewmat[4 * i + 3];
    }
    for (int j = 0; j < 3; ++j) v.position[j] = -(v.R[j] * v.t[0] + v.R[3 + j] * v.t[1] + v.R[6 + j] * v.t[2]);
    v.fx = K[0], v.cx = K[2], v.fy = K[4], v.cy = K[5];
    return v;
}
template <class F>
TEXGS_MATHS Vec3<F> rotate(const View& v, Vec3<F> a) {
    return {fma(F(v.R[0]), a.x, fma(F(v.R[1]), a.y, F(v.R[2]) * a.z)),
            fma(F(v.R[3]), a.x, fma(F(v.R[4]), a.y, F(v.R[5]) * a.z)),
            fma(F(v.R[6]), a.x, fma(F(v.R[7]), a.y, F(v.R[8]) * a.z))};
}
template <class F>
TEXGS_MATHS Vec3<F> rotate_back(const View& v, Vec3<F> a) {
    return {fma(F(v.R[0]), a.x, fma(F(v.R[3]), a.y, F(v.R[6]) * a.z)),
            fma(F(v.R[1]), a.x, fma(F(v.R[4]), a.y, F(v.R[7]) * a.z)),
            fma(F(v.R[2]), a.x, fma(F(v.R[5]), a.y, F(v.R[8]) * a.z))};
}

template <class F>
struct Surfel {
    Vec3<F> mean;
    F qw, qx, qy, qz, su, sv, opacity;
};

// Columns of the rotation matrix of a unit quaternion: two tangents and the normal, in the world.
template <class F>
struct Axes {
    Vec3<F> u, v, n;
};
template <class F>
TEXGS_MATHS Axes<F> axes(F w, F x, F y, F z) {
    const F two = 2.0f, one = 1.0f;
    return {{one - two * (y * y + z * z), two * (x * y + w * z), two * (x * z - w * y)},
            {two * (x * y - w * z), one - two * (x * x + z * z), two * (y * z + w * x)},
            {two * (x * z + w * y), two * (y * z - w * x), one - two * (x * x + y * y)}};
}

// Adjoint of axes(), followed by that of the normalisation q -> q / |q|: gradient of the quaternion as given.
template <class F>
TEXGS_MATHS void axes_backward(F w, F x, F y, F z, F inverse_norm, const Axes<F>& g, F out[4]) {
    const F two = 2.0f;
    const F gw = two * (x * (g.v.z - g.n.y) + y * (g.n.x - g.u.z) + z * (g.u.y - g.v.x));
    const F gx =
        two * (y * (g.v.x + g.u.y) + z * (g.n.x + g.u.z) + w * (g.v.z - g.n.y)) - (two + two) * x * (g.v.y + g.n.z);
    const F gy =
        two * (x * (g.v.x + g.u.y) + z * (g.n.y + g.v.z) + w * (g.n.x - g.u.z)) - (two + two) * y * (g.u.x + g.n.z);
    const F gz =
        two * (x * (g.n.x + g.u.z) + y * (g.n.y + g.v.z) + w * (g.u.y - g.v.x)) - (two + two) * z * (g.u.x + g.v.y);
    const F radial = gw * w + gx * x + gy * y + gz * z;
    out[0] = (gw - radial * w) * inverse_norm;
    out[1] = (gx - radial * x) * inverse_norm;
    out[2] = (gy - radial * y) * inverse_norm;
    out[3] = (gz - radial * z) * inverse_norm;
}

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
struct Projection {
    F w, x, y, z, inverse_norm;  // unit quaternion, 1 / length as given
    Axes<F> axes;                // world
    Vec3<F> p, a, b;             // camera: centre, scaled tangents
    Homography<F> M;             // about the low-pass centre
    F cx, cy;                    // low-pass centre, from the principal point
    F filter_sigma2;             // 0 where the box of filter_sigma is not in front of the camera
    Vec3<F> A, B, C;             // adj(M) = [A B C]
    F scale;                     // 1 / W at the centre; 0 for a surfel seen edge-on
};

template <class F>
TEXGS_MATHS Projection<F> project(const View& view, const Surfel<F>& s, float filter_sigma) {
    Projection<F> r;
    r.inverse_norm = F(1.0f) / sqrt(s.qw * s.qw + s.qx * s.qx + s.qy * s.qy + s.qz * s.qz);
    r.w = s.qw * r.inverse_norm, r.x = s.qx * r.inverse_norm;
    r.y = s.qy * r.inverse_norm, r.z = s.qz * r.inverse_norm;
    r.axes = axes(r.w, r.x, r.y, r.z);
    r.p = rotate(view, s.mean) + Vec3<F>{F(view.t[0]), F(view.t[1]), F(view.t[2])};
    r.a = s.su * rotate(view, r.axes.u);
    r.b = s.sv * rotate(view, r.axes.v);

    const F fx = view.fx, fy = view.fy;
    Homography<F> M{{fx * r.a.x, fx * r.b.x, fx * r.p.x}, {fy * r.a.y, fy * r.b.y, fy * r.p.y}, {r.a.z, r.b.z, r.p.z}};
    const F sigma2 = filter_sigma * filter_sigma;
    const auto in_front = conic_entry(sigma2, M.w, M.w) < F(-1e-6f) * r.p.z * r.p.z;
    r.filter_sigma2 = select(in_front, sigma2, F(0.0f));
    const Conic<F> box = project_conic(r.filter_sigma2, M);
    r.cx = box.x, r.cy = box.y;
    r.M = {M.u - r.cx * M.w, M.v - r.cy * M.w, M.w};

    r.A = cross(r.M.v, r.M.w);
    r.B = cross(r.M.w, r.M.u);
    r.C = cross(r.M.u, r.M.v);
    // Below this ratio of the sides of its image, W is rounding error: only the low-pass disc is left of the surfel.
    const F sides = r.M.u.x * r.M.u.x + r.M.u.y * r.M.u.y + r.M.v.x * r.M.v.x + r.M.v.y * r.M.v.y;
    const auto edge_on = abs(r.C.z) <= F(1e-6f) * sides;
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
struct Moments {
    F u_dx, u_dy, u, v_dx, v_dy, v, w_dx, w_dy;
    F disc_dx, disc_dy;  // sum of e (dx, dy) over filtered fragments
    F e;                 // over all fragments
    F zc, zp;            // dL/d(depth of the plane at the centre), dL/d(depth of the mean), or 0
    Vec3<F> normal;      // dL/d(normal facing the camera), or 0
};

// The affine forms as fragments use them: (U, V) = (ux, vx) dx + (uy, vy) dy + (u, v), W = wx dx + wy dy + 1.
template <class F>
struct Forms {
    F ux, uy, u, vx, vy, v, wx, wy, zc;
};
template <class F>
TEXGS_MATHS Forms<F> affine_forms(const Projection<F>& r) {
    const F s = r.scale;
    return {s * r.A.x, s * r.B.x, s * r.C.x, s * r.A.y,          s * r.B.y,
            s * r.C.y, s * r.A.z, s * r.B.z, s * dot(r.M.w, r.C)};
}

template <class F>
struct SurfelGradient {
    Vec3<F> mean;
    F quat[4], su, sv, opacity, shift_x, shift_y;
};

// Adjoint of the low-pass centre c = (D_uw, D_vw) / D_ww, D = conic_entry; added to the gradient of M.
// M here counts pixels from c, where the quotient is 0 and its derivative simplest.
template <class F>
TEXGS_MATHS void centre_backward(const Projection<F>& r, F gx, F gy, Homography<F>& gM) {
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
TEXGS_MATHS Homography<F> adjugate_backward(const Projection<F>& r, const Moments<F>& m, F sum_w) {
    const F s = r.scale;
    const Vec3<F> gA{s * m.u_dx, s * m.v_dx, s * m.w_dx}, gB{s * m.u_dy, s * m.v_dy, s * m.w_dy};
    const F g_det = s * m.zc;  // det = w . C
    const Vec3<F> gC = Vec3<F>{s * m.u, s * m.v, s * sum_w} + g_det * r.M.w;
    return {cross(gB, r.M.w) + cross(r.M.v, gC), cross(r.M.w, gA) + cross(gC, r.M.u),
            cross(gA, r.M.v) + cross(r.M.u, gB) + g_det * r.C};
}

template <class F>
TEXGS_MATHS SurfelGradient<F> project_backward(const View& view, const Surfel<F>& s, const Projection<F>& r,
                                               const Moments<F>& m, float low_pass) {
    const Forms<F> f = affine_forms(r);
    const F sum_w = -(f.ux * m.u_dx + f.uy * m.u_dy + f.u * m.u + f.vx * m.v_dx + f.vy * m.v_dy + f.v * m.v +
                      f.wx * m.w_dx + f.wy * m.w_dy + f.zc * m.zc);
    const F disc_x = F(low_pass) * m.disc_dx, disc_y = F(low_pass) * m.disc_dy;  // dL/d(low-pass centre)
    Homography<F> gM = adjugate_backward(r, m, sum_w);
    centre_backward(r, disc_x, disc_y, gM);

    // M counts pixels from the centre: its rows u, v hold f a.x - c a.z and the like.
    const F fx = view.fx, fy = view.fy;
    const auto from_rows = [&](F gu, F gv, F gw) -> Vec3<F> { return {fx * gu, fy * gv, gw - r.cx * gu - r.cy * gv}; };
    const Vec3<F> ga = from_rows(gM.u.x, gM.v.x, gM.w.x), gb = from_rows(gM.u.y, gM.v.y, gM.w.y);
    Vec3<F> gp = from_rows(gM.u.z, gM.v.z, gM.w.z);
    gp.z = gp.z + m.zp;

    SurfelGradient<F> g;
    g.mean = rotate_back(view, gp);
    const Vec3<F> ga_world = rotate_back(view, ga), gb_world = rotate_back(view, gb);
    g.su = dot(ga_world, r.axes.u);
    g.sv = dot(gb_world, r.axes.v);
    axes_backward(r.w, r.x, r.y, r.z, r.inverse_norm,
                  Axes<F>{s.su * ga_world, s.sv * gb_world, facing(view, s, r.axes) * m.normal}, g.quat);
    g.opacity = m.e / s.opacity;
    g.shift_x = disc_x - (f.ux * m.u + f.vx * m.v + f.wx * sum_w);
    g.shift_y = disc_y - (f.uy * m.u + f.vy * m.v + f.wy * sum_w);
    return g;
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
