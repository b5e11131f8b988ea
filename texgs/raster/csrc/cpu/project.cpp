// SPDX-License-Identifier: Apache-2.0
// Projects surfels: record, footprint on screen, depth key. Many surfels at a time.
#include "isa.h"
#include "kernels.h"
#include "surfels.h"

namespace texgs::TEXGS_ISA {
namespace {

using Box = float[4];  // x0, y0, x1, y1 in pixels

struct Bounds {
    vf ex, ey, xx, xy, yy;  // ellipse at level 1
    vf x0, y0, x1, y1;      // box of ellipse and disc
    vf disc;                // squared radius of the disc, -1 where the ellipse covers it
    vm behind;              // the ellipse is not one: the surfel reaches behind the camera
};

// Ellipse rho_surfel <= cut and disc rho_filter <= cut around (cx, cy), in pixels.
Bounds bound(const Projection<vf>& r, vf cut, vf cx, vf cy, float low_pass) {
    Bounds b;
    Conic<vf> e = project_conic(cut, r.M);
    b.behind = e.ww > vf(-1e-3f) * r.p.z * r.p.z;
    // A thin ellipse has an ill-conditioned inverse; growing it by a fraction of a pixel only adds candidates.
    const vf grow = fma(1e-6f, e.xx + e.yy, 1e-2f);
    const vm disc_only = r.scale * r.scale <= vf(0.0f);
    const vf xx = select(disc_only, 1e-2f, max(e.xx, 0.0f) + grow), yy = select(disc_only, 1e-2f, max(e.yy, 0.0f) + grow);
    const vf xy = select(disc_only, 0.0f, e.xy);
    const vf inverse = vf(1.0f) / max(fnma(xy, xy, xx * yy), 1e-6f);
    b.ex = cx + select(disc_only, 0.0f, e.x), b.ey = cy + select(disc_only, 0.0f, e.y);
    b.xx = yy * inverse, b.xy = -(xy * inverse), b.yy = xx * inverse;

    const vf radius2 = cut / vf(low_pass), radius = sqrt(radius2);
    const vf half_trace = vf(0.5f) * (xx + yy);
    const vf split = vf(0.5f) * (xx - yy);
    const vf smallest = half_trace - sqrt(fma(split, split, xy * xy)) - grow;
    const vf reach = radius + sqrt((b.ex - cx) * (b.ex - cx) + (b.ey - cy) * (b.ey - cy));
    b.disc = select(reach * reach < smallest, -1.0f, radius2);
    const vf sx = sqrt(xx), sy = sqrt(yy);
    b.x0 = min(b.ex - sx, cx - radius), b.x1 = max(b.ex + sx, cx + radius);
    b.y0 = min(b.ey - sy, cy - radius), b.y1 = max(b.ey + sy, cy + radius);
    return b;
}

// Grows `box` by a surfel cut by the near plane: its square of half-width `side` sigma, clipped, projected around
// the principal point (cx, cy).
void clipped_box(const View& view, float cx, float cy, Vec3<float> p, Vec3<float> a, Vec3<float> b, float side,
                 float near, Box box) {
    const float corner[4][2] = {{-side, -side}, {side, -side}, {side, side}, {-side, side}};
    const auto include = [&](float u, float v) {
        const float z = p.z + u * a.z + v * b.z;
        const float x = view.fx * (p.x + u * a.x + v * b.x) / z + cx;
        const float y = view.fy * (p.y + u * a.y + v * b.y) / z + cy;
        box[0] = x < box[0] ? x : box[0], box[1] = y < box[1] ? y : box[1];
        box[2] = x > box[2] ? x : box[2], box[3] = y > box[3] ? y : box[3];
    };
    for (int i = 0; i < 4; ++i) {
        const float *s = corner[i], *e = corner[(i + 1) % 4];
        const float zs = p.z + s[0] * a.z + s[1] * b.z - near, ze = p.z + e[0] * a.z + e[1] * b.z - near;
        if (zs > 0) include(s[0], s[1]);
        if ((zs > 0) != (ze > 0)) {
            const float t = zs / (zs - ze);
            include(s[0] + t * (e[0] - s[0]), s[1] + t * (e[1] - s[1]));
        }
    }
}

// Whether the low-pass filter may rule a fragment with rho <= cut. Along a ray from the centre, where both vanish,
// rho_surfel / rho_filter is monotonous: it is enough to look at the two ends, the centre and the contour of the disc.
vm may_be_filtered(const Bounds& b, const Forms<vf>& f, const texgs_options& o) {
    if (o.filter_sigma > 0) return vf(0.0f) <= vf(0.0f);
    const vf xx = fma(f.ux, f.ux, f.vx * f.vx), yy = fma(f.uy, f.uy, f.vy * f.vy), xy = fma(f.ux, f.uy, f.vx * f.vy);
    const vf split = vf(0.5f) * (xx - yy);
    const vf steepest = vf(0.5f) * (xx + yy) + sqrt(fma(split, split, xy * xy));
    return ~((b.disc < vf(0.0f)) & (steepest < vf(0.999f * o.low_pass)));
}

struct Lanes {
    float v[kLanes];
    Lanes(vf x) { store(v, x); }
    float operator[](int i) const { return v[i]; }
};

// First and one-past-last tile whose pixel centres the interval [low, high] can reach.
TEXGS_INLINE uint16_t first_tile(float low, int tiles) {
    const float t = (low - 0.5f) * (1.0f / kTile);
    return static_cast<uint16_t>(t <= 0 ? 0 : t >= tiles ? tiles : static_cast<int>(t));
}
TEXGS_INLINE uint16_t last_tile(float high, int tiles) {
    const float t = (high - 0.5f) * (1.0f / kTile);
    return static_cast<uint16_t>(!(t >= 0) ? 0 : t >= tiles ? tiles : static_cast<int>(t) + 1);
}

void project_lanes(const Raster& r, const View& view, int64_t first, int n) {
    const texgs_options& o = r.options;
    const Surfel<vf> s = load_surfels(r.surfels, first, n);
    const Projection<vf> q = project(view, s, o.filter_sigma);
    const Forms<vf> f = affine_forms(q);
    vf cx = q.cx + vf(view.cx), cy = q.cy + vf(view.cy);
    if (r.surfels.shift) {
        cx += load_strided(r.surfels.shift + 2 * first, 2, n);
        cy += load_strided(r.surfels.shift + 2 * first + 1, 2, n);
    }
    // Fragments at rho = cut have alpha = alpha_min; a little more covers rounding.
    const vf log2_opacity = log2(max(s.opacity, 1e-30f));
    const vf cut = fma(2.0f * kLn2 * 1.0001f, log2_opacity - log2(vf(o.alpha_min)), 1e-3f);
    const vm visible = (q.p.z > vf(o.near_plane)) & (s.opacity >= vf(o.alpha_min)) & (abs(cx) < vf(1e7f)) &
                       (abs(cy) < vf(1e7f)) & (q.inverse_norm < vf(1e18f));
    const vf safe_cut = max(cut, 1e-3f);
    const vf nearest = q.p.z - sqrt(safe_cut * fma(q.a.z, q.a.z, q.b.z * q.b.z));
    const vm clip = nearest <= vf(o.near_plane);
    const Bounds b = bound(q, safe_cut, cx, cy, o.low_pass);

    const unsigned visible_bits = bits(visible), behind_bits = bits(b.behind & clip), clip_bits = bits(clip);
    const unsigned filter_bits = bits(clip | may_be_filtered(b, f, o));
    // A surfel seen edge-on is its disc: forms so steep that rho_surfel never wins.
    const vm edge_on = q.scale * q.scale <= vf(0.0f);
    const vf steep = vf(1e4f) * sqrt(vf(o.low_pass));
    const Lanes lcx(cx), lcy(cy), ux(select(edge_on, steep, f.ux)), uy(f.uy), u(f.u), vx(f.vx),
        vy(select(edge_on, steep, f.vy)), v(f.v), wx(f.wx), wy(f.wy), lo(log2_opacity),
        zc(select(edge_on, q.p.z, f.zc)), zp(q.p.z);
    const Lanes ex(b.ex), ey(b.ey), xx(b.xx), xy(b.xy), yy(b.yy), disc(b.disc), x0(b.x0), y0(b.y0), x1(b.x1), y1(b.y1);
    const Lanes px(q.p.x), py(q.p.y), ax(q.a.x), ay(q.a.y), az(q.a.z), bx(q.b.x), by(q.b.y), bz(q.b.z), lcut(safe_cut), ox(cx - q.cx), oy(cy - q.cy);

    const float* colors = r.channels > kRecordChannels ? nullptr : surfel_channels(r);
    const float diagonal = std::hypot(float(r.camera.width), float(r.camera.height));
    for (int i = 0; i < n; ++i) {
        const int64_t id = first + i;
        Footprint& foot = r.footprints[id];
        r.depth_keys[id] = kCulled;
        foot.x0 = foot.x1 = foot.y0 = foot.y1 = 0;
        if (r.image.radii) r.image.radii[id] = 0;
        if (!(visible_bits >> i & 1)) continue;
        Record& record = r.records[id];
        record = {lcx[i], lcy[i], ux[i], uy[i], u[i], vx[i], vy[i], v[i], wx[i], wy[i], lo[i], zc[i], zp[i], {}};
        if (colors)
            for (int c = 0; c < r.channels; ++c) record.color[c] = colors[id * r.channels + c];
        Box box = {x0[i], y0[i], x1[i], y1[i]};
        foot = {ex[i], ey[i], xx[i], xy[i], yy[i], lcx[i], lcy[i], disc[i], 0, 0, 0, 0, 0};
        foot.flags = static_cast<uint16_t>((clip_bits >> i & 1 ? kClipped : 0) | (filter_bits >> i & 1 ? kFiltered : 0));
        if (behind_bits >> i & 1) {
            const float radius = std::sqrt(lcut[i] / o.low_pass);
            box[0] = lcx[i] - radius, box[1] = lcy[i] - radius, box[2] = lcx[i] + radius, box[3] = lcy[i] + radius;
            clipped_box(view, ox[i], oy[i], {px[i], py[i], zp[i]}, {ax[i], ay[i], az[i]}, {bx[i], by[i], bz[i]},
                        std::sqrt(lcut[i]), o.near_plane, box);
            foot.xx = foot.xy = foot.yy = 0;  // no ellipse: every block of the box
        }
        foot.x0 = first_tile(box[0], r.tiles_x), foot.x1 = last_tile(box[2], r.tiles_x);
        foot.y0 = first_tile(box[1], r.tiles_y), foot.y1 = last_tile(box[3], r.tiles_y);
        if (foot.x0 >= foot.x1 || foot.y0 >= foot.y1) continue;
        std::memcpy(&r.depth_keys[id], &zp.v[i], sizeof(float));  // positive floats sort as integers
        if (r.image.radii) {
            const float w = box[2] - box[0], h = box[3] - box[1], longer = w > h ? w : h;
            r.image.radii[id] = 0.5f * (longer < 2 * diagonal ? longer : 2 * diagonal);
        }
    }
    if (r.with_normal) {
        const vf sign = facing(view, s, q.axes);
        const Lanes nx(sign * q.axes.n.x), ny(sign * q.axes.n.y), nz(sign * q.axes.n.z);
        for (int i = 0; i < n; ++i) {
            float* normal = r.normals + 3 * (first + i);
            normal[0] = nx[i], normal[1] = ny[i], normal[2] = nz[i];
        }
    }
}

}  // namespace

void project_surfels(const Raster& r, int64_t begin, int64_t end) {
    const View view = make_view(r.camera.viewmat, r.camera.K);
    for (int64_t i = begin; i < end; i += kLanes)
        project_lanes(r, view, i, static_cast<int>(end - i < kLanes ? end - i : kLanes));
}

}  // namespace texgs::TEXGS_ISA
