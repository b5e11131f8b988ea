// SPDX-License-Identifier: Apache-2.0
// The maths of rays through a volume, shared by every back end. F is float (CUDA, scalar) or a vector of floats (CPU).
//
// Include it after a header that declares fma, select, sqrt, min, max, exp2, log2 and comparisons for F in namespace
// texgs::TEXGS_ISA.
#pragma once
#include "maths.h"
#include "texgs_volume.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr float kOpaque = 1e-3f;  // light below which a ray ends

// Places in a volume are in samples: (0, 0, 0) is the first one.
struct Lattice {
    double per_unit[3], middle[3];  // place = middle + per_unit * world
    float last[3];                  // place of the last sample
    int32_t bricks[3];
};

TEXGS_MATHS Lattice lattice_of(const texgs_volume& volume) {
    Lattice l;
    for (int a = 0; a < 3; ++a) {
        const int cells = volume.size[a] - 1;
        l.per_unit[a] = cells / (2.0 * volume.half[a]);
        l.middle[a] = 0.5 * cells;
        l.last[a] = static_cast<float>(cells);
        l.bricks[a] = (cells + TEXGS_BRICK - 1) / TEXGS_BRICK;
    }
    return l;
}

// Sample k is at entry + (k + 0.5) * step, and its camera z at near + (k + 0.5) * z.
struct CastRay {
    float entry[3], step[3], ahead[3];  // the last: 1 or -1, where it goes along each axis
    float direction[3];                 // in the world, with z 1 in the camera
    float near, z;
    int32_t first, samples;  // those from `first` on and before `samples` count
    float begin, end;        // what of it counts, in steps
    const float* face;       // normal of the plane that cuts it, or NULL
    float face_end;          // in steps
};

// Keeps what is in the depth range of a pixel.
TEXGS_MATHS void cut_ray(const texgs_cast_view& view, int64_t pixel, CastRay& ray) {
    ray.first = 0, ray.begin = -1e30f, ray.end = 1e30f, ray.face = nullptr;
    if (!view.depth_range) return;
    const float* range = view.depth_range + pixel;
    ray.begin = (range[0] - ray.near) / ray.z;
    ray.end = (range[int64_t(view.width) * view.height] - ray.near) / ray.z;
    const float last = ::ceilf(ray.end);
    if (!(last >= static_cast<float>(ray.samples))) ray.samples = last > 0.0f ? static_cast<int32_t>(last) : 0;
    if (!(ray.begin < ray.end)) ray.samples = 0;
    const float samples = static_cast<float>(ray.samples), first = ray.begin < samples ? ray.begin : samples;
    ray.first = first > 0.0f ? static_cast<int32_t>(first) : 0;
    const int32_t face = view.face ? view.face[pixel] : -1;
    if (face < 0 || face >= view.n_planes) return;
    ray.face = view.planes + 3 * face;
    ray.face_end = ray.begin + view.opacity_unit / view.step;
}

// How much of the steps of samples k counts.
template <class F>
TEXGS_MATHS F share(const CastRay& ray, F k) {
    return min(k + F(1.0f), F(ray.end)) - max(k, F(ray.begin));
}

// The ray through the centre of pixel (x, y).
TEXGS_MATHS CastRay cast_ray(const Lattice& lattice, const texgs_cast_view& view, int x, int y) {
    const float *m = view.viewmat, *K = view.K;
    const double c[3] = {(x + 0.5 - K[2]) / K[0], (y + 0.5 - K[5]) / K[4], 1.0};
    double origin[3], along[3], near = 0.0, far = 1e30, length = 0.0;
    CastRay ray;
    for (int a = 0; a < 3; ++a) {
        double position = 0.0, direction = 0.0;
        for (int i = 0; i < 3; ++i) {
            position -= double(m[4 * i + a]) * m[4 * i + 3];
            direction += double(m[4 * i + a]) * c[i];
        }
        ray.direction[a] = static_cast<float>(direction);
        length += direction * direction;
        origin[a] = lattice.middle[a] + lattice.per_unit[a] * position;
        along[a] = lattice.per_unit[a] * direction;
        if (along[a] == 0.0) along[a] = 1e-30;
        const double one = -origin[a] / along[a], other = (lattice.last[a] - origin[a]) / along[a];
        near = near > (one < other ? one : other) ? near : (one < other ? one : other);
        far = far < (one < other ? other : one) ? far : (one < other ? other : one);
    }
    const double z = view.step / ::sqrt(length), samples = ::ceil((far - near) / z - 0.5);
    for (int a = 0; a < 3; ++a) {
        ray.entry[a] = static_cast<float>(origin[a] + near * along[a]);
        ray.step[a] = static_cast<float>(along[a] * z);
        ray.ahead[a] = ray.step[a] < 0.0f ? -1.0f : 1.0f;
    }
    ray.near = static_cast<float>(near), ray.z = static_cast<float>(z);
    ray.samples = samples > 0.0 ? static_cast<int32_t>(samples < 1e9 ? samples : 1e9) : 0;
    cut_ray(view, int64_t(y) * view.width + x, ray);
    return ray;
}

// A box of bricks that hold all that shows; places of its corners.
struct Extent {
    float lower[3], upper[3];
};

// The first sample of a ray, and the one behind the last, that may be in a box.
TEXGS_MATHS void clip(const CastRay& ray, const Extent& box, int32_t& first, int32_t& end) {
    float enter = static_cast<float>(ray.first), leave = static_cast<float>(ray.samples);
    for (int a = 0; a < 3; ++a) {
        const float one = (box.lower[a] - ray.entry[a]) / ray.step[a],
                    other = (box.upper[a] - ray.entry[a]) / ray.step[a];
        const float near = one < other ? one : other, far = one < other ? other : one;
        enter = near > enter ? near : enter;
        leave = far < leave ? far : leave;
    }
    enter = enter < static_cast<float>(ray.samples) ? enter : static_cast<float>(ray.samples);
    leave = leave > -1.0f ? leave : -1.0f;
    first = static_cast<int32_t>(enter) - 1;  // rounding must not pass one by
    first = first > ray.first ? first : ray.first;
    end = leave + 1.0f < static_cast<float>(ray.samples) ? static_cast<int32_t>(leave + 1.0f) : ray.samples;
}

// The next sample of a ray that may be outside of the bricks within `distance` of one, which show nothing.
TEXGS_MATHS int32_t leap(const CastRay& ray, int32_t k, const float place[3], const int32_t brick[3], int distance) {
    float leave = 1e9f;
    for (int a = 0; a < 3; ++a) {
        const int side = ray.step[a] > 0.0f ? brick[a] + distance : brick[a] - distance + 1;
        const float steps = (static_cast<float>(TEXGS_BRICK * side) - place[a]) / ray.step[a];
        leave = steps < leave ? steps : leave;
    }
    const int32_t samples = static_cast<int32_t>(::ceilf(leave - 1e-3f));  // rounding must not pass one by
    return k + (samples > 1 ? samples : 1);
}

template <class F>
TEXGS_MATHS F mix(F a, F b, F t) {
    return fma(t, b - a, a);  // a where both are the same
}

// The logarithm to base 2 of the light that a stretch of `lengths` units of length lets through, (1 - a)^lengths,
// exact for small opacities a, too. Those of matter at one place add up.
template <class F>
TEXGS_MATHS F log2_through(F a, F lengths) {
    const F s = a / (a - F(2.0f)), s2 = s * s;  // log2(1 - a) = 2 / ln 2 atanh(s)
    F p = fma(F(0.412198583f), s2, F(0.577078016f));
    p = fma(p, s2, F(0.961796694f));
    p = fma(p, s2, F(2.885390082f));
    const F y = lengths * select(a < F(0.25f), s * p, log2(max(F(1.0f) - a, F(1e-30f))));
    return select(a < F(1.0f), y, F(-126.0f));
}

// The opacity 1 - 2^y of such a stretch.
template <class F>
TEXGS_MATHS F opacity_of(F y) {
    F q = fma(F(1.333355814e-3f), y, F(9.618129108e-3f));  // (2^y - 1) / y
    q = fma(q, y, F(5.550410866e-2f));
    q = fma(q, y, F(2.402265070e-1f));
    q = fma(q, y, F(6.931471806e-1f));
    return select(F(-0.25f) < y, F(0.0f) - y * q, F(1.0f) - exp2(y));
}

// The eight corners of cells, x first, and the places inside of them.
template <class F>
TEXGS_MATHS F trilinear(const F (&v)[8], const F (&f)[3]) {
    const F low = mix(mix(v[0], v[1], f[0]), mix(v[2], v[3], f[0]), f[1]);
    return mix(low, mix(mix(v[4], v[5], f[0]), mix(v[6], v[7], f[0]), f[1]), f[2]);
}

// What lights a view, ready for use.
struct Lamp {
    float viewer[3], light[3], half[3];  // half: between the two
    float ambient, diffuse, specular, shininess;
    bool unlit_faces;
};
TEXGS_MATHS Lamp lamp_of(const texgs_cast_view& view) {
    Lamp lamp;
    float length = 0.0f;
    for (int a = 0; a < 3; ++a) {
        lamp.viewer[a] = view.to_viewer[a], lamp.light[a] = view.to_light[a];
        lamp.half[a] = lamp.viewer[a] + lamp.light[a];
        length += lamp.half[a] * lamp.half[a];
    }
    for (int a = 0; a < 3; ++a) lamp.half[a] /= length > 0.0f ? ::sqrtf(length) : 1.0f;
    lamp.ambient = view.ambient, lamp.diffuse = view.diffuse;
    lamp.specular = view.specular, lamp.shininess = view.shininess;
    lamp.unlit_faces = view.unlit_faces;
    return lamp;
}

// A unit vector, or 0: also where a difference reaches to a missing or an infinite sample.
template <class F>
TEXGS_MATHS Vec3<F> unit(Vec3<F> v) {
    const F length = sqrt(dot(v, v)), scale = F(1.0f) / length, zero = 0.0f;
    const auto is_known = (F(1e-18f) < length) & (length < F(3e38f));
    return {select(is_known, scale * v.x, zero), select(is_known, scale * v.y, zero),
            select(is_known, scale * v.z, zero)};
}
// The quaternion wxyz that turns z to a unit vector on the shortest way: half a turn around x to -z, and none to 0.
template <class F>
TEXGS_MATHS void turn_z_to(Vec3<F> n, F (&quat)[4]) {
    const F w = F(1.0f) + n.z, zero = 0.0f;
    const F scale = F(1.0f) / sqrt(fma(w, w, fma(n.x, n.x, n.y * n.y)));
    const auto is_opposite = w < F(1e-6f);
    quat[0] = select(is_opposite, zero, w * scale);
    quat[1] = select(is_opposite, F(1.0f), zero - n.y * scale);
    quat[2] = select(is_opposite, zero, n.x * scale);
    quat[3] = zero;
}
template <class F>
TEXGS_MATHS F along(Vec3<F> v, const float (&d)[3]) {
    return fma(v.x, F(d[0]), fma(v.y, F(d[1]), v.z * F(d[2])));
}
template <class F>
TEXGS_MATHS Vec3<F> turned(Vec3<F> n, F side) {  // towards where side is above 0
    const F sign = select(side < F(0.0f), F(-1.0f), F(1.0f));
    return sign * n;
}

// What is left of light from the lamp and of ambient light where other matter is in their way.
template <class F>
struct Exposure {
    F lamp = 1.0f, ambient = 1.0f;
};

// Blinn-Phong: c (k_a + k_d max(n.l, 0)) + k_s max(n.h, 0)^beta in [0, 1]. A normal of 0 is ambient.
template <class F>
TEXGS_MATHS Vec3<F> lit(Vec3<F> color, Vec3<F> normal, const Lamp& lamp, Exposure<F> exposure) {
    const F zero = 0.0f, one = 1.0f;
    const Vec3<F> n = turned(normal, along(normal, lamp.viewer));
    const F n_l = max(along(n, lamp.light), zero), n_h = max(along(n, lamp.half), zero);
    const F power = exp2(max(F(lamp.shininess) * log2(max(n_h, F(1e-30f))), F(-126.0f)));
    const F specular = F(lamp.specular) * exposure.lamp * select(zero < n_l, power, zero);
    const F diffuse = fma(F(lamp.diffuse) * exposure.lamp, n_l, F(lamp.ambient) * exposure.ambient);
    return {min(max(fma(color.x, diffuse, specular), zero), one), min(max(fma(color.y, diffuse, specular), zero), one),
            min(max(fma(color.z, diffuse, specular), zero), one)};
}

// The same of samples k of a ray, as far as their steps do not belong to a face; there its normal counts.
template <class F>
TEXGS_MATHS Vec3<F> lit(const CastRay& ray, F k, Vec3<F> color, Vec3<F>& normal, const Lamp& lamp,
                        Exposure<F> exposure) {
    const Vec3<F> inner = lit(color, normal, lamp, exposure);
    if (!ray.face) return inner;
    const F part = min(max(F(ray.face_end) - k, F(0.0f)), F(1.0f));
    const Vec3<F> plane{F(ray.face[0]), F(ray.face[1]), F(ray.face[2])};
    const Vec3<F> outer = lamp.unlit_faces ? color : lit(color, plane, lamp, exposure);
    const auto is_face = F(0.5f) < part;
    normal = {select(is_face, plane.x, normal.x), select(is_face, plane.y, normal.y),
              select(is_face, plane.z, normal.z)};
    return {mix(inner.x, outer.x, part), mix(inner.y, outer.y, part), mix(inner.z, outer.z, part)};
}

// From places in a volume to those of the light that reaches them: centre = place * scale + shift + outset * direction.
struct LightCells {
    float scale[3], shift[3], outset[3];
};
TEXGS_MATHS LightCells light_cells_of(const Lattice& lattice, const texgs_cast_view& view) {
    LightCells c{};
    for (int a = 0; view.light && a < 3; ++a) {
        const double per_unit = view.light_size[a] / (2.0 * view.light_half[a]), scale = per_unit / lattice.per_unit[a];
        c.scale[a] = static_cast<float>(scale);
        c.shift[a] = static_cast<float>(0.5 * (view.light_size[a] - 1) - lattice.middle[a] * scale);
        c.outset[a] = static_cast<float>(view.outset * per_unit);
    }
    return c;
}

// Which way from a sample to look for light: along the normal on the viewer's side, or that of its face.
template <class F>
TEXGS_MATHS Vec3<F> outward(const CastRay& ray, F k, Vec3<F> normal, const Lamp& lamp) {
    const Vec3<F> n = turned(normal, along(normal, lamp.viewer));
    if (!ray.face) return n;
    const auto is_face = F(0.5f) < F(ray.face_end) - k;
    return {select(is_face, F(ray.face[0]), n.x), select(is_face, F(ray.face[1]), n.y),
            select(is_face, F(ray.face[2]), n.z)};
}

// What strengths of shadows and of occlusion make of shares of light, in 255ths.
template <class F>
TEXGS_MATHS Exposure<F> exposure_of(const texgs_cast_view& view, F lamp, F sky) {
    return {fma(lamp, F(view.shadows / 255.0f), F(1.0f - view.shadows)),
            fma(sky, F(view.occlusion / 255.0f), F(1.0f - view.occlusion))};
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
