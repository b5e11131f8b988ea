// SPDX-License-Identifier: Apache-2.0
// Blinn-Phong shading of surfels (Blinn 1977), both faces lit alike:
//     gain = ambient + diffuse |n.l|,  shaded = gain * color + specular |n.h|^shininess.
// With `facing` only ambient light is left where the light is behind the face that the camera sees. Elsewhere nothing
// changes: v, l and so h are on one side of the surfel, and for n on that side |n.l| = n.l and |n.h| = n.h.
#include "interleaved.h"
#include "loss_kernels.h"

#include "../maths.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr float kSmallest = 1e-30f;  // a cosine or length below is 0

struct Material {
    vf ambient, diffuse, specular, shininess;
};

// Up to kLanes surfels under the light, as far as both forward and backward need them.
struct Lit {
    vf w, x, y, z, inverse_norm;  // unit quaternion, 1 / length as given
    Vec3<vf> normal, view, light, half;
    vf over_distance, over_sum;  // 1 / distance of the camera, 1 / |view + light|
    vf n_l, n_h;                 // signed; 0 in the shadow, as the lobe
    vf lobe;                     // |n_h|^shininess
};

TEXGS_INLINE vf parameter(const float* p, bool shared, int64_t i, int n) {
    return shared ? vf(*p) : load_part(p + i, n);
}

Material load_material(const BlinnPhongJob& job, int64_t i, int n) {
    return {parameter(job.ambient, job.shared & TEXGS_SHARED_AMBIENT, i, n),
            parameter(job.diffuse, job.shared & TEXGS_SHARED_DIFFUSE, i, n),
            parameter(job.specular, job.shared & TEXGS_SHARED_SPECULAR, i, n),
            parameter(job.shininess, job.shared & TEXGS_SHARED_SHININESS, i, n)};
}

TEXGS_INLINE Vec3<vf> load_vectors(const float* p, int64_t i, int n) {
    vf v[3];
    load_columns<3>(p + 3 * i, n, v);
    return {v[0], v[1], v[2]};
}
TEXGS_INLINE void store_vectors(float* p, Vec3<vf> a, int64_t i, int n) {
    const vf v[3] = {a.x, a.y, a.z};
    store_columns<3>(p + 3 * i, v, n);
}

TEXGS_INLINE Vec3<vf> splat(const float* p) { return {vf(p[0]), vf(p[1]), vf(p[2])}; }

// 1 / |a|, or 0 for the zero vector.
TEXGS_INLINE vf inverse_length(Vec3<vf> a) {
    const vf length = sqrt(dot(a, a));
    return zero_unless(length > vf(kSmallest), vf(1.0f) / length);
}

// No light where it is behind the face that the camera sees. A NaN is not hidden.
TEXGS_INLINE void cast_shadow(Lit& s) {
    const vm lit = ~(select(dot(s.normal, s.view) < vf(0.0f), -s.n_l, s.n_l) <= vf(0.0f));
    s.n_l = zero_unless(lit, s.n_l), s.n_h = zero_unless(lit, s.n_h), s.lobe = zero_unless(lit, s.lobe);
}

Lit light_surfels(const BlinnPhongJob& job, const Material& m, int64_t i, int n) {
    Lit s;
    vf q[4];
    load_columns<4>(job.quats + 4 * i, n, q);
    s.inverse_norm = vf(1.0f) / sqrt(fma(q[0], q[0], fma(q[1], q[1], fma(q[2], q[2], q[3] * q[3]))));
    s.w = q[0] * s.inverse_norm, s.x = q[1] * s.inverse_norm;
    s.y = q[2] * s.inverse_norm, s.z = q[3] * s.inverse_norm;
    s.normal = axes(s.w, s.x, s.y, s.z).n;

    const Vec3<vf> to_camera = splat(job.camera_position) - load_vectors(job.means, i, n);
    s.over_distance = inverse_length(to_camera);
    s.view = s.light = s.half = s.over_distance * to_camera;
    s.over_sum = 0.0f;
    if (job.light) {
        const Vec3<vf> to_light = splat(job.light);
        s.light = inverse_length(to_light) * to_light;
        const Vec3<vf> both = s.view + s.light;
        s.over_sum = inverse_length(both);
        s.half = s.over_sum * both;
    }
    s.n_l = dot(s.normal, s.light);
    s.n_h = dot(s.normal, s.half);
    s.lobe = exp2_or_nan(m.shininess * log2(max(abs(s.n_h), kSmallest)));
    if (job.facing) cast_shadow(s);
    return s;
}

// A colour that is clamped to 0 and 1, in which NaN stays; and its gradient, which passes within.
TEXGS_INLINE vf clamped(vf a) { return select(a <= a, min(max(a, 0.0f), 1.0f), a); }
TEXGS_INLINE vf clamped_backward(vf a, vf gradient) { return zero_unless((a >= vf(0.0f)) & (a <= vf(1.0f)), gradient); }

// The derivative of value = low + span sigmoid(x).
TEXGS_INLINE vf sigmoid_slope(vf value, float low, float span) {
    return (value - vf(low)) * (vf(1.0f) - (value - vf(low)) * vf(1.0f / span));
}

TEXGS_INLINE Vec3<vf> shade(const Material& m, const Lit& s, vf gain, Vec3<vf> color) {
    const vf highlight = m.specular * s.lobe;
    return {fma(gain, color.x, highlight), fma(gain, color.y, highlight), fma(gain, color.z, highlight)};
}

TEXGS_INLINE vf sign(vf a) { return select(a > vf(0.0f), 1.0f, select(a < vf(0.0f), -1.0f, 0.0f)); }

// Gradients of the directions: of the normal into the quaternion, of the view direction into the mean.
void direction_gradients(const BlinnPhongJob& job, const Lit& s, vf by_n_l, vf by_n_h, int64_t i, int n) {
    if (job.grad_quats) {
        const Vec3<vf> none{0.0f, 0.0f, 0.0f};
        vf g[4];
        axes_backward(s.w, s.x, s.y, s.z, s.inverse_norm, Axes<vf>{none, none, by_n_l * s.light + by_n_h * s.half}, g);
        store_columns<4>(job.grad_quats + 4 * i, g, n);
    }
    if (job.grad_means) {
        Vec3<vf> by_view = (by_n_l + by_n_h) * s.normal;  // headlight: light and half are the view direction
        if (job.light) {
            const Vec3<vf> by_half = by_n_h * s.normal;
            by_view = s.over_sum * (by_half - dot(by_half, s.half) * s.half);
        }
        const Vec3<vf> by_mean = s.over_distance * (dot(by_view, s.view) * s.view - by_view);
        store_vectors(job.grad_means, by_mean, i, n);
    }
}

}  // namespace

void blinn_phong_range(const BlinnPhongJob& job, int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; i += kLanes) {
        const int n = static_cast<int>(end - i < kLanes ? end - i : kLanes);
        const Material m = load_material(job, i, n);
        const Lit s = light_surfels(job, m, i, n);
        const vf gain = fma(m.diffuse, abs(s.n_l), m.ambient);
        Vec3<vf> seen = shade(m, s, gain, load_vectors(job.color, i, n));
        if (job.clamped) seen = {clamped(seen.x), clamped(seen.y), clamped(seen.z)};
        store_vectors(job.shaded, seen, i, n);
        if (job.gain) store_part(job.gain + i, gain, n);
    }
}

MaterialSums blinn_phong_backward_range(const BlinnPhongJob& job, int64_t begin, int64_t end) {
    float* const out[4] = {job.grad_ambient, job.grad_diffuse, job.grad_specular, job.grad_shininess};
    vf total[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    for (int64_t i = begin; i < end; i += kLanes) {
        const int n = static_cast<int>(end - i < kLanes ? end - i : kLanes);
        const vm present = to_float(iota()) < vf(static_cast<float>(n));
        const Material m = load_material(job, i, n);
        const Lit s = light_surfels(job, m, i, n);
        const vf gain = fma(m.diffuse, abs(s.n_l), m.ambient);
        const Vec3<vf> color = load_vectors(job.color, i, n), seen = shade(m, s, gain, color);
        Vec3<vf> g = load_vectors(job.grad_shaded, i, n);
        if (job.clamped)
            g = {clamped_backward(seen.x, g.x), clamped_backward(seen.y, g.y), clamped_backward(seen.z, g.z)};
        if (job.grad_color) store_vectors(job.grad_color, gain * g, i, n);

        const vf by_gain = job.grad_gain ? dot(color, g) + load_part(job.grad_gain + i, n) : dot(color, g);
        const vf by_highlight = g.x + g.y + g.z;
        const vf cosine = max(abs(s.n_h), kSmallest), by_lobe = by_highlight * m.specular * s.lobe;
        vf by_material[4] = {by_gain, by_gain * abs(s.n_l), by_highlight * s.lobe, by_lobe * vf(kLn2) * log2(cosine)};
        const vf material[4] = {m.ambient, m.diffuse, m.specular, m.shininess};
        for (int k = 0; k < 4; ++k) {
            if (!out[k]) continue;
            if (job.ranges && job.ranges[2 * k + 1] > 0.0f)
                by_material[k] *= sigmoid_slope(material[k], job.ranges[2 * k], job.ranges[2 * k + 1]);
            if (job.shared >> k & 1)
                total[k] += zero_unless(present, by_material[k]);
            else
                store_part(out[k] + i, by_material[k], n);
        }
        direction_gradients(job, s, by_gain * m.diffuse * sign(s.n_l), by_lobe * m.shininess / cosine * sign(s.n_h), i,
                            n);
    }
    return {{sum(total[0]), sum(total[1]), sum(total[2]), sum(total[3])}};
}

}  // namespace texgs::TEXGS_ISA
