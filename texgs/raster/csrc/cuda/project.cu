// SPDX-License-Identifier: Apache-2.0
// Projects surfels or Gaussians, one per thread: record, footprint on screen, depth key.
#include "primitives.cuh"

#include "../bounds.h"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 128;

__device__ Record make_record(const Outline<float>& seen, float cx, float cy, float depth, int64_t id) {
    const Forms<float>& f = seen.forms;
    return {cx,
            cy,
            f.ux,
            f.uy,
            f.u,
            f.vx,
            f.vy,
            f.v,
            f.wx,
            f.wy,
            seen.log2_opacity,
            f.zc,
            depth,
            seen.clipped ? 1.0f : 0.0f,
            static_cast<int32_t>(id),
            0.0f};
}

// Record and footprint of primitive i; false where it is not visible.
template <class P, class Projection>
__device__ bool project_primitive(const Raster& r, const View& view, const P& s, const Projection& q, int64_t i,
                                  Footprint& foot) {
    const texgs_options& o = r.options;
    float x = view.cx, y = view.cy;
    if (r.surfels.shift) x += r.surfels.shift[2 * i], y += r.surfels.shift[2 * i + 1];
    const float cx = q.cx + x, cy = q.cy + y;
    const Outline<float> seen = outline(s, q, cx, cy, o);
    if (!seen.visible) return false;
    Bounds<float> b = seen.bounds;
    if constexpr (!P::kAffine)
        if (b.behind) {
            b.box = clipped_box(view, x, y, {q.pose.p, q.a, q.b}, cx, cy, seen.cut, o);
            b.ex = cx, b.ey = cy;    // they may not be finite
            b.xx = b.xy = b.yy = 0;  // no ellipse: every block of the box
        }
    foot = {b.ex, b.ey, b.xx, b.xy, b.yy, cx, cy, b.disc, 0, 0, 0, 0};
    r.records[i] = make_record(seen, cx, cy, q.pose.p.z, i);
    if (!cover_tiles(b.box, r.tiles_x, r.tiles / r.tiles_x, foot)) return false;
    if (r.image.radii) {
        const float diagonal = hypotf(static_cast<float>(r.camera.width), static_cast<float>(r.camera.height));
        r.image.radii[i] = half_extent(b.box, diagonal);
    }
    return true;
}

template <class P>
__global__ __launch_bounds__(kBlock) void project_kernel(const Raster r) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= r.surfels.n) return;
    const View view = make_view(r.camera.viewmat, r.camera.K);
    const P s = load_primitive<P>(r.surfels, i);
    const auto q = project(view, s, r.camera, r.options);
    if (r.image.radii) r.image.radii[i] = 0;
    Footprint foot{};
    const bool visible = project_primitive(r, view, s, q, i, foot);
    if (!visible) foot.x0 = foot.x1 = foot.y0 = foot.y1 = 0;
    r.footprints[i] = foot;
    r.depth_keys[i] = visible ? __float_as_uint(q.pose.p.z) : kCulled;  // positive floats sort as integers
    r.order[i] = static_cast<uint32_t>(i);
    if constexpr (!P::kAffine)
        if (r.with_normal) {
            const Vec3<float> n = facing(view, s, q.pose.axes) * q.pose.axes.n;
            r.normals[3 * i] = n.x, r.normals[3 * i + 1] = n.y, r.normals[3 * i + 2] = n.z;
        }
}

}  // namespace

void project(const Raster& r, cudaStream_t stream) {
    with_primitive<float>(r.surfels.axes, [&](auto primitive) {
        launch(project_kernel<typename decltype(primitive)::type>, blocks_for(r.surfels.n, kBlock), kBlock, stream, r);
    });
}

}  // namespace texgs::cuda
