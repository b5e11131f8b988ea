// SPDX-License-Identifier: Apache-2.0
// Projects surfels: record, footprint on screen, depth key. Many surfels at a time.
#include "isa.h"
#include "kernels.h"
#include "surfels.h"

#include "../bounds.h"

namespace texgs::TEXGS_ISA {
namespace {

struct Lanes {
    float v[kLanes];
    Lanes(vf x) { store(v, x); }
    float operator[](int i) const { return v[i]; }
};

// Low-pass centres in pixels.
struct Centres {
    vf x, y;
};
Centres shifted_centres(const Raster& r, const View& view, const Projection<vf>& q, int64_t first, int n) {
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

// Their ellipses, discs and boxes.
struct BoundLanes {
    Lanes cx, cy, ex, ey, xx, xy, yy, disc, x0, y0, x1, y1;
    Box<float> box(int i) const { return {x0[i], y0[i], x1[i], y1[i]}; }
    void store(Footprint& out, int i, uint16_t flags) const {
        out = {ex[i], ey[i], xx[i], xy[i], yy[i], cx[i], cy[i], disc[i], 0, 0, 0, 0, flags};
    }
};
BoundLanes bound_lanes(const Centres& c, const Bounds<vf>& b) {
    return {c.x, c.y, b.ex, b.ey, b.xx, b.xy, b.yy, b.disc, b.box.x0, b.box.y0, b.box.x1, b.box.y1};
}

Plane plane_of(const Projection<vf>& q, int i) {
    const auto lane = [&](const Vec3<vf>& a) -> Vec3<float> { return {Lanes(a.x)[i], Lanes(a.y)[i], Lanes(a.z)[i]}; };
    return {lane(q.p), lane(q.a), lane(q.b)};
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

void project_lanes(const Raster& r, const View& view, float diagonal, int64_t first, int n) {
    const texgs_options& o = r.options;
    const Surfel<vf> s = load_surfels(r.surfels, first, n);
    const Projection<vf> q = project(view, s, o.filter_sigma);
    const Forms<vf> f = visible_forms(q, o.low_pass);
    const Centres c = shifted_centres(r, view, q, first, n);
    const vf log2_opacity = log2(max(s.opacity, 1e-30f));
    const vf cut = largest_rho(log2_opacity, log2(vf(o.alpha_min)));
    const vm clip = nearest_depth(q, cut) <= vf(o.near_plane);
    const Bounds<vf> b = bound(q, cut, c.x, c.y, o.low_pass);

    const unsigned visible = bits(is_visible(q, s.opacity, c.x, c.y, o)), behind = bits(b.behind & clip);
    const unsigned clipped = bits(clip), filtered = bits(clip | ~is_never_filtered(b, f, o));
    const RecordLanes records = record_lanes(c, f, log2_opacity, q.p.z);
    const BoundLanes bounds = bound_lanes(c, b);
    const float* colors = r.channels > kRecordChannels ? nullptr : surfel_channels(r);
    for (int i = 0; i < n; ++i) {
        const int64_t id = first + i;
        Record& record = r.records[id];
        Footprint& foot = r.footprints[id];
        cull(r, id);
        if (!(visible >> i & 1)) continue;
        records.store(record, i);
        if (colors)
            for (int k = 0; k < r.channels; ++k) record.color[k] = colors[id * r.channels + k];
        const int flags = (clipped >> i & 1 ? kClipped : 0) | (filtered >> i & 1 ? kFiltered : 0);
        bounds.store(foot, i, static_cast<uint16_t>(flags));
        Box<float> box = bounds.box(i);
        if (behind >> i & 1) {
            const Lanes x(c.x - q.cx), y(c.y - q.cy), cuts(cut);
            box = clipped_box(view, x[i], y[i], plane_of(q, i), foot.cx, foot.cy, cuts[i], o);
            foot.xx = foot.xy = foot.yy = 0;  // no ellipse: every block of the box
        }
        if (!cover_tiles(box, r.tiles_x, r.tiles_y, foot)) continue;
        std::memcpy(&r.depth_keys[id], &record.zp, sizeof(float));  // positive floats sort as integers
        if (r.image.radii) r.image.radii[id] = half_extent(box, diagonal);
    }
    if (r.with_normal) store_normals(r, view, s, q.axes, first, n);
}

}  // namespace

void project_surfels(const Raster& r, int64_t begin, int64_t end) {
    const View view = make_view(r.camera.viewmat, r.camera.K);
    const float diagonal = std::hypot(float(r.camera.width), float(r.camera.height));
    for (int64_t i = begin; i < end; i += kLanes)
        project_lanes(r, view, diagonal, i, static_cast<int>(end - i < kLanes ? end - i : kLanes));
}

}  // namespace texgs::TEXGS_ISA
