// SPDX-License-Identifier: Apache-2.0
// Projects surfels or Gaussians: record, footprint on screen, depth key. Many at a time.
#include "isa.h"
#include "kernels.h"
#include "primitives.h"

#include "../bounds.h"

namespace texgs::TEXGS_ISA {
namespace {

struct Lanes {
    float v[kLanes];
    Lanes(vf x) { store(v, x); }
    float operator[](int i) const { return v[i]; }
};

// Low-pass centres, or means, in pixels.
struct Centres {
    vf x, y;
};
template <class Projection>
Centres shifted_centres(const Raster& r, const View& view, const Projection& q, int64_t first, int n) {
    Centres c{q.cx + vf(view.cx), q.cy + vf(view.cy)};
    if (r.surfels.shift) {
        c.x += load_strided(r.surfels.shift + 2 * first, 2, n);
        c.y += load_strided(r.surfels.shift + 2 * first + 1, 2, n);
    }
    return c;
}

// Records of several surfels, to be stored one by one.
struct RecordLanes {
    Lanes cx, cy, ux, uy, u, vx, vy, v, wx, wy, log2_opacity, zc, zp;
    // In place: a record that is returned is put together first and copied then, which waits for its parts.
    void store(Record& out, int i) const {
        out = {cx[i], cy[i], ux[i], uy[i], u[i], vx[i], vy[i], v[i], wx[i], wy[i], log2_opacity[i], zc[i], zp[i], {}};
    }
};
RecordLanes record_lanes(const Centres& c, const Forms<vf>& f, vf log2_opacity, vf depth) {
    return {c.x, c.y, f.ux, f.uy, f.u, f.vx, f.vy, f.v, f.wx, f.wy, log2_opacity, f.zc, depth};
}

constexpr float kDepthError = 1e-3f;  // of the depth of a fragment, as a share of it

// Their ellipses, discs, boxes and depths.
struct BoundLanes {
    Lanes cx, cy, ex, ey, slope, width, height, tip, disc, x0, y0, x1, y1, nearest, farthest;
    Box<float> box(int i) const { return {x0[i], y0[i], x1[i], y1[i]}; }
    void store(Footprint& out, int i) const {
        out = {ex[i],   ey[i], slope[i], width[i], height[i], tip[i],     cx[i],      cy[i],
               disc[i], 0,     0,        0,        0,         nearest[i], farthest[i]};
    }
};
BoundLanes bound_lanes(const Centres& c, const Bounds<vf>& b, vf depth, vf reach) {
    const vf nearest = (depth - reach) * vf(1.0f - kDepthError), farthest = (depth + reach) * vf(1.0f + kDepthError);
    const vf width = sqrt(vf(1.0f) / b.xx), tip = -(b.xy / b.yy) * b.sx;
    return {c.x,    c.y,      b.ex,     b.ey,     -(b.xy / b.xx), width,   b.sy,    tip,
            b.disc, b.box.x0, b.box.y0, b.box.x1, b.box.y1,       nearest, farthest};
}

// The box of surfel i, which reaches behind the camera.
Box<float> cut_box(const Raster& r, const View& view, const SurfelProjection<vf>& q, const Centres& c, vf cut, int i) {
    const auto lane = [&](const Vec3<vf>& a) -> Vec3<float> { return {Lanes(a.x)[i], Lanes(a.y)[i], Lanes(a.z)[i]}; };
    const Lanes x(c.x - q.cx), y(c.y - q.cy), cx(c.x), cy(c.y), cuts(cut);
    const Plane plane{lane(q.pose.p), lane(q.a), lane(q.b)};
    return clipped_box(view, x[i], y[i], plane, cx[i], cy[i], cuts[i], r.options);
}

void cull(const Raster& r, int64_t id) {
    Footprint& foot = r.footprints[id];
    foot.x0 = foot.x1 = foot.y0 = foot.y1 = 0;
    r.depth_keys[id] = kCulled;
    if (r.image.radii) r.image.radii[id] = 0;
}

void store_normals(const Raster& r, const View& view, const Surfel<vf>& s, const Axes<vf>& axes, int64_t first, int n) {
    const vf sign = facing(view, s, axes);
    const Lanes nx(sign * axes.n.x), ny(sign * axes.n.y), nz(sign * axes.n.z);
    for (int i = 0; i < n; ++i) {
        float* normal = r.normals + 3 * (first + i);
        normal[0] = nx[i], normal[1] = ny[i], normal[2] = nz[i];
    }
}

template <class P>
void project_lanes(const Raster& r, const View& view, float diagonal, int64_t first, int n) {
    const P s = load_primitives<P>(r.surfels, first, n);
    const auto q = project(view, s, r.camera, r.options);
    const Centres c = shifted_centres(r, view, q, first, n);
    const Outline<vf> seen = outline(s, q, c.x, c.y, r.options);

    const unsigned visible = bits(seen.visible), behind = bits(seen.bounds.behind), clipped = bits(seen.clipped);
    const unsigned filtered = bits(seen.clipped | ~seen.never_filtered);
    const RecordLanes records = record_lanes(c, seen.forms, seen.log2_opacity, q.pose.p.z);
    const BoundLanes bounds = bound_lanes(c, seen.bounds, q.pose.p.z, seen.reach);
    // So few channels have one source.
    const float* few = r.surfels.base ? r.surfels.base : r.surfels.features;
    const float* colors = r.channels > kRecordChannels ? nullptr : few;
    for (int i = 0; i < n; ++i) {
        const int64_t id = first + i;
        Record& record = r.records[id];
        Footprint& foot = r.footprints[id];
        cull(r, id);
        if (!(visible >> i & 1)) continue;
        records.store(record, i);
        if (colors)
            for (int k = 0; k < r.channels; ++k) record.color[k] = colors[id * r.channels + k];
        r.flags[id] = (clipped >> i & 1 ? kClipped : 0) | (filtered >> i & 1 ? kFiltered : 0);
        bounds.store(foot, i);
        Box<float> box = bounds.box(i);
        if constexpr (!P::kAffine)
            if (behind >> i & 1) {
                box = cut_box(r, view, q, c, seen.cut, i);
                foot.ex = foot.cx, foot.ey = foot.cy;                         // they may not be finite
                foot.slope = foot.tip = 0, foot.width = foot.height = 1e18f;  // no ellipse: every block of the box
            }
        if (!cover_tiles(box, r.tiles_x, r.tiles_y, foot)) continue;
        std::memcpy(&r.depth_keys[id], &record.zp, sizeof(float));  // positive floats sort as integers
        if (r.image.radii) r.image.radii[id] = half_extent(box, diagonal);
    }
    if constexpr (!P::kAffine)
        if (r.with_normal) store_normals(r, view, s, q.pose.axes, first, n);
}

}  // namespace

void project_surfels(const Raster& r, int64_t begin, int64_t end) {
    const View view = make_view(r.camera.viewmat, r.camera.K);
    const float diagonal = std::hypot(float(r.camera.width), float(r.camera.height));
    with_primitive<vf>(r.surfels.axes, [&](auto primitive) {
        for (int64_t i = begin; i < end; i += kLanes)
            project_lanes<typename decltype(primitive)::type>(r, view, diagonal, i,
                                                              static_cast<int>(end - i < kLanes ? end - i : kLanes));
    });
}

}  // namespace texgs::TEXGS_ISA
