// SPDX-License-Identifier: Apache-2.0
// Vectors, cameras, rotations: what the geometry of surfels (surfel.h) and of 3D Gaussians (gaussian.h) has in common,
// shared by every back end. F is float (CUDA, scalar) or a vector of floats (CPU), so that a line here handles one
// primitive or sixteen.
//
// Include it after a header that declares fma, select, sqrt, abs, min, max and comparisons for F in namespace
// texgs::TEXGS_ISA.
#pragma once
#include "both.h"

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

// A primitive turned and moved into the camera.
template <class F>
struct Pose {
    F w, x, y, z, inverse_norm;  // unit quaternion, 1 / length as given
    Axes<F> axes;                // world
    Vec3<F> p;                   // mean, camera
};
template <class F>
TEXGS_MATHS Pose<F> make_pose(const View& view, Vec3<F> mean, const F (&quat)[4]) {
    Pose<F> r;
    r.inverse_norm = F(1.0f) / sqrt(quat[0] * quat[0] + quat[1] * quat[1] + quat[2] * quat[2] + quat[3] * quat[3]);
    r.w = quat[0] * r.inverse_norm, r.x = quat[1] * r.inverse_norm;
    r.y = quat[2] * r.inverse_norm, r.z = quat[3] * r.inverse_norm;
    r.axes = axes(r.w, r.x, r.y, r.z);
    r.p = rotate(view, mean) + Vec3<F>{F(view.t[0]), F(view.t[1]), F(view.t[2])};
    return r;
}

// How a pixel (dx, dy) from a primitive's centre maps to it, in standard deviations (u, v) = (U, V) / W:
// (U, V) = (ux, vx) dx + (uy, vy) dy + (u, v), W = wx dx + wy dy + 1. Of a Gaussian only ux, uy and vy are not 0.
template <class F>
struct Forms {
    F ux, uy, u, vx, vy, v, wx, wy, zc;  // zc: depth at the centre
};

// Gradient of a primitive with N scales.
template <class F, int N>
struct Gradient {
    Vec3<F> mean;
    F quat[4], scale[N], opacity, shift_x, shift_y;
};

}  // namespace
}  // namespace texgs::TEXGS_ISA
