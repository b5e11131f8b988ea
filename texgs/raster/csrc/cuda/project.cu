// SPDX-License-Identifier: Apache-2.0
// Projects surfels, one per thread: record, footprint on screen, depth key.
#include "bounds.cuh"
#include "surfel.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 128;

// The footprint's tiles; false where there are none.
__device__ bool place_on_screen(const Raster& r, const Box& box, Footprint& foot) {
    const int tiles_y = r.tiles / r.tiles_x;
    foot.x0 = first_tile(box.x0, r.tiles_x), foot.x1 = last_tile(box.x1, r.tiles_x);
    foot.y0 = first_tile(box.y0, tiles_y), foot.y1 = last_tile(box.y1, tiles_y);
    return foot.x0 < foot.x1 && foot.y0 < foot.y1;
}

__device__ float half_extent(const texgs_camera& camera, const Box& box) {
    const float diagonal = hypotf(static_cast<float>(camera.width), static_cast<float>(camera.height));
    return 0.5f * fminf(fmaxf(box.x1 - box.x0, box.y1 - box.y0), 2 * diagonal);
}

// Forms of a surfel seen edge-on are so steep that rho_surfel never wins: it is its disc.
__device__ Record make_record(const Projection<float>& q, float cx, float cy, float log2_opacity, bool clip,
                              float low_pass, int64_t id) {
    Forms<float> f = affine_forms(q);
    if (q.scale == 0.0f) f.ux = f.vy = 1e4f * sqrt(low_pass), f.zc = q.p.z;
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
    if (!(q.p.z > o.near_plane && s.opacity >= o.alpha_min && fabsf(cx) < 1e7f && fabsf(cy) < 1e7f &&
          q.inverse_norm < 1e18f))
        return false;
    // Fragments at rho = cut have alpha = alpha_min; a little more covers rounding.
    const float log2_opacity = log2f(s.opacity);
    const float cut = fmaxf(fma(2.0f * kLn2 * 1.0001f, log2_opacity - log2f(o.alpha_min), 1e-3f), 1e-3f);
    const float nearest = q.p.z - sqrt(cut * fma(q.a.z, q.a.z, q.b.z * q.b.z));
    const bool clip = nearest <= o.near_plane;
    Bounds b = bound(q, cut, cx, cy, o.low_pass);
    if (b.behind && clip) {
        const float radius = sqrt(cut / o.low_pass);
        b.box = {cx - radius, cy - radius, cx + radius, cy + radius};
        include_clipped(view, x, y, q, sqrt(cut), o.near_plane, b.box);
        b.xx = b.xy = b.yy = 0;  // no ellipse: every block of the box
    }
    foot = {b.ex, b.ey, b.xx, b.xy, b.yy, cx, cy, b.disc, 0, 0, 0, 0};
    r.records[i] = make_record(q, cx, cy, log2_opacity, clip, o.low_pass, i);
    if (!place_on_screen(r, b.box, foot)) return false;
    if (r.image.radii) r.image.radii[i] = half_extent(r.camera, b.box);
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
