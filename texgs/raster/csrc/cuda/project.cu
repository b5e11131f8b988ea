// SPDX-License-Identifier: Apache-2.0
// Projects surfels, one per thread: record, footprint on screen, depth key.
#include "surfel.cuh"

#include "../bounds.h"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 128;

__device__ Record make_record(const Projection<float>& q, float cx, float cy, float log2_opacity, bool clip,
                              float low_pass, int64_t id) {
    const Forms<float> f = visible_forms(q, low_pass);
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
            log2_opacity,
            f.zc,
            q.p.z,
            clip ? 1.0f : 0.0f,
            static_cast<int32_t>(id),
            0.0f};
}

// Record and footprint of surfel i; false where it is not visible.
__device__ bool project_surfel(const Raster& r, const View& view, const Surfel<float>& s, const Projection<float>& q,
                               int64_t i, Footprint& foot) {
    const texgs_options& o = r.options;
    float x = view.cx, y = view.cy;
    if (r.surfels.shift) x += r.surfels.shift[2 * i], y += r.surfels.shift[2 * i + 1];
    const float cx = q.cx + x, cy = q.cy + y;
    if (!is_visible(q, s.opacity, cx, cy, o)) return false;
    const float log2_opacity = log2f(s.opacity);
    const float cut = largest_rho(log2_opacity, log2f(o.alpha_min));
    const bool clip = nearest_depth(q, cut) <= o.near_plane;
    Bounds<float> b = bound(q, cut, cx, cy, o.low_pass);
    if (b.behind && clip) {
        b.box = clipped_box(view, x, y, {q.p, q.a, q.b}, cx, cy, cut, o);
        b.xx = b.xy = b.yy = 0;  // no ellipse: every block of the box
    }
    foot = {b.ex, b.ey, b.xx, b.xy, b.yy, cx, cy, b.disc, 0, 0, 0, 0};
    r.records[i] = make_record(q, cx, cy, log2_opacity, clip, o.low_pass, i);
    if (!cover_tiles(b.box, r.tiles_x, r.tiles / r.tiles_x, foot)) return false;
    if (r.image.radii) {
        const float diagonal = hypotf(static_cast<float>(r.camera.width), static_cast<float>(r.camera.height));
        r.image.radii[i] = half_extent(b.box, diagonal);
    }
    return true;
}

__global__ __launch_bounds__(kBlock) void project_kernel(const Raster r) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= r.surfels.n) return;
    const View view = make_view(r.camera.viewmat, r.camera.K);
    const Surfel<float> s = load_surfel(r.surfels, i);
    const Projection<float> q = project(view, s, r.options.filter_sigma);
    if (r.image.radii) r.image.radii[i] = 0;
    Footprint foot{};
    const bool visible = project_surfel(r, view, s, q, i, foot);
    if (!visible) foot.x0 = foot.x1 = foot.y0 = foot.y1 = 0;
    r.footprints[i] = foot;
    r.depth_keys[i] = visible ? __float_as_uint(q.p.z) : kCulled;  // positive floats sort as integers
    r.order[i] = static_cast<uint32_t>(i);
    if (r.with_normal) {
        const Vec3<float> n = facing(view, s, q.axes) * q.axes.n;
        r.normals[3 * i] = n.x, r.normals[3 * i + 1] = n.y, r.normals[3 * i + 2] = n.z;
    }
}

}  // namespace

void project(const Raster& r, cudaStream_t stream) {
    launch(project_kernel, blocks_for(r.surfels.n, kBlock), kBlock, stream, r);
}

}  // namespace texgs::cuda
