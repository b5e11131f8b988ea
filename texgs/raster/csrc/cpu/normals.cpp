// SPDX-License-Identifier: Apache-2.0
// Normals of the surface behind a depth map, and how far they agree with blended normals.
//
// A pixel's ray is r = ((x - cx) / fx, (y - cy) / fy, 1), its point z r. The cross product of the central differences
// of the points (Huang et al. 2024) is, up to a positive factor, the camera-space vector
//     (gx, gy, -(1 + r.x gx + r.y gy)),  gx = fx (z_right - z_left) / (z_right + z_left),  gy likewise,
// which always faces the camera and needs no points.
#include "loss_kernels.h"
#include "simd.h"

#include "../maths.h"

namespace texgs::TEXGS_ISA {
namespace {

// Normals at `n` pixels from (x, y) on, none of them at the border of the image.
struct Surface {
    vf rx, ry, left, right, up, down;  // rays, depths of the neighbours
    vf inverse_x, inverse_y;           // 1 / (left + right), 1 / (up + down), or 0 where a neighbour has no depth
    vf inverse_length;
    Vec3<vf> normal;  // camera space, unit, or 0
};

Surface surface(const NormalJob& job, const View& view, int x, int y, int n) {
    const float* depth = job.depth + (static_cast<int64_t>(y) * job.width + x);
    Surface s;
    s.left = load_part(depth - 1, n), s.right = load_part(depth + 1, n);
    s.up = load_part(depth - job.width, n), s.down = load_part(depth + job.width, n);
    const vm seen = min(min(s.left, s.right), min(s.up, s.down)) > vf(0.0f);
    s.inverse_x = zero_unless(seen, vf(1.0f) / (s.left + s.right));
    s.inverse_y = zero_unless(seen, vf(1.0f) / (s.up + s.down));
    s.rx = (to_float(iota()) + vf(static_cast<float>(x) + 0.5f - view.cx)) * vf(1.0f / view.fx);
    s.ry = (static_cast<float>(y) + 0.5f - view.cy) / view.fy;
    const vf gx = vf(view.fx) * (s.right - s.left) * s.inverse_x;
    const vf gy = vf(view.fy) * (s.down - s.up) * s.inverse_y;
    const Vec3<vf> v{gx, gy, -fma(s.rx, gx, fma(s.ry, gy, 1.0f))};
    s.inverse_length = zero_unless(seen, vf(1.0f) / sqrt(dot(v, v)));
    s.normal = s.inverse_length * v;
    return s;
}

TEXGS_INLINE void add_part(float* p, vf a, int n) { store_part(p, load_part(p, n) + a, n); }

// Adds the gradient of the four depths that a normal depends on, as far as they lie in rows [y0, y1).
void add_depth_gradient(const NormalJob& job, const View& view, const Surface& s, Vec3<vf> by_normal, int x, int y,
                        int n, int y0, int y1) {
    const Vec3<vf> g = rotate(view, by_normal);
    const Vec3<vf> by_v = s.inverse_length * (g - dot(g, s.normal) * s.normal);
    const vf by_gx = vf(2.0f * view.fx) * (by_v.x - s.rx * by_v.z) * s.inverse_x * s.inverse_x;
    const vf by_gy = vf(2.0f * view.fy) * (by_v.y - s.ry * by_v.z) * s.inverse_y * s.inverse_y;
    float* depth = job.out_depth + (static_cast<int64_t>(y) * job.width + x);
    if (y >= y0 && y < y1) {
        add_part(depth + 1, by_gx * s.left, n);
        add_part(depth - 1, -(by_gx * s.right), n);
    }
    if (y + 1 >= y0 && y + 1 < y1) add_part(depth + job.width, by_gy * s.up, n);
    if (y - 1 >= y0 && y - 1 < y1) add_part(depth - job.width, -(by_gy * s.down), n);
}

struct Planes {  // of an [3, H, W] image
    int64_t size;
    Vec3<vf> load(const float* image, int64_t i, int n) const {
        return {load_part(image + i, n), load_part(image + i + size, n), load_part(image + i + 2 * size, n)};
    }
    void store(float* image, int64_t i, Vec3<vf> a, int n) const {
        store_part(image + i, a.x, n);
        store_part(image + i + size, a.y, n);
        store_part(image + i + 2 * size, a.z, n);
    }
    void clear(float* image, int64_t i, int64_t n) const {
        for (int k = 0; k < 3; ++k) std::memset(image + i + k * size, 0, sizeof(float) * n);
    }
};

Planes planes(const NormalJob& job) { return {static_cast<int64_t>(job.height) * job.width}; }

// Calls body(x, y, n) on the pixels of rows [y0, y1) that are not at the border of the image.
template <class Body>
void for_inner_pixels(const NormalJob& job, int y0, int y1, const Body& body) {
    for (int y = y0 < 1 ? 1 : y0; y < y1 && y < job.height - 1; ++y) {
        for (int x = 1; x < job.width - 1; x += kLanes) {
            const int left = job.width - 1 - x;
            body(x, y, left < kLanes ? left : kLanes);
        }
    }
}

}  // namespace

void depth_to_normal_rows(const NormalJob& job, int y0, int y1) {
    const View view = make_view(job.viewmat, job.K);
    const Planes image = planes(job);
    image.clear(job.out_normal, static_cast<int64_t>(y0) * job.width, static_cast<int64_t>(y1 - y0) * job.width);
    for_inner_pixels(job, y0, y1, [&](int x, int y, int n) {
        const Vec3<vf> normal = rotate_back(view, surface(job, view, x, y, n).normal);
        image.store(job.out_normal, static_cast<int64_t>(y) * job.width + x, normal, n);
    });
}

void depth_to_normal_backward_rows(const NormalJob& job, int y0, int y1) {
    const View view = make_view(job.viewmat, job.K);
    const Planes image = planes(job);
    std::memset(job.out_depth + static_cast<int64_t>(y0) * job.width, 0, sizeof(float) * (y1 - y0) * job.width);
    for_inner_pixels(job, y0 - 1, y1 + 1, [&](int x, int y, int n) {
        const Vec3<vf> upstream = image.load(job.upstream, static_cast<int64_t>(y) * job.width + x, n);
        add_depth_gradient(job, view, surface(job, view, x, y, n), upstream, x, y, n, y0, y1);
    });
}

double normal_consistency_rows(const NormalJob& job, int y0, int y1) {
    const View view = make_view(job.viewmat, job.K);
    const Planes image = planes(job);
    const int64_t first = static_cast<int64_t>(y0) * job.width, pixels = static_cast<int64_t>(y1 - y0) * job.width;
    if (job.out_normal) image.clear(job.out_normal, first, pixels);
    if (job.out_depth) std::memset(job.out_depth + first, 0, sizeof(float) * pixels);
    const int halo = job.out_depth ? 1 : 0;
    double total = 0.0;
    for_inner_pixels(job, y0 - halo, y1 + halo, [&](int x, int y, int n) {
        const int64_t i = static_cast<int64_t>(y) * job.width + x;
        const Surface s = surface(job, view, x, y, n);
        const Vec3<vf> blended = image.load(job.normal, i, n), from_depth = rotate_back(view, s.normal);
        const vf alpha = load_part(job.alpha + i, n), weight = vf(-job.scale) * alpha;
        if (y >= y0 && y < y1) {
            total += sum(alpha * dot(blended, from_depth));
            if (job.out_normal) image.store(job.out_normal, i, weight * from_depth, n);
        }
        if (job.out_depth) add_depth_gradient(job, view, s, weight * blended, x, y, n, y0, y1);
    });
    return total;
}

}  // namespace texgs::TEXGS_ISA
