// SPDX-License-Identifier: Apache-2.0
// Blinn-Phong shading of surfels (Blinn 1977), both faces lit alike, one surfel per thread:
//     gain = ambient + diffuse |n.l|,  shaded = gain * color + specular |n.h|^shininess.
// With `facing` only ambient light is left where the light is behind the face that the camera sees. Elsewhere nothing
// changes: v, l and so h are on one side of the surfel, and for n on that side |n.l| = n.l and |n.h| = n.h.
#include <algorithm>

#include "../texgs_losses.h"
#include "maths.cuh"
#include "workspace.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 256;
constexpr float kSmallest = 1e-30f;  // a cosine or length below is 0

struct Job {
    int64_t n;
    const float *color, *ambient, *diffuse, *specular, *shininess;
    int shared;
    const float *means, *quats, *camera_position, *light;
    bool facing, clamped;
};
struct Gradients {
    const float *shaded, *gain;
    float *color, *material[4], *means, *quats;
    double* sums;     // [blocks, 4] of the shared parameters
    float ranges[8];  // low and span
};

struct Material {
    float ambient, diffuse, specular, shininess;

    __device__ Material(const Job& job, int64_t i)
        : ambient(job.ambient[job.shared & TEXGS_SHARED_AMBIENT ? 0 : i]),
          diffuse(job.diffuse[job.shared & TEXGS_SHARED_DIFFUSE ? 0 : i]),
          specular(job.specular[job.shared & TEXGS_SHARED_SPECULAR ? 0 : i]),
          shininess(job.shininess[job.shared & TEXGS_SHARED_SHININESS ? 0 : i]) {}
};

__device__ inline Vec3<float> load(const float* p, int64_t i) { return {p[3 * i], p[3 * i + 1], p[3 * i + 2]}; }
__device__ inline void store(float* p, int64_t i, Vec3<float> a) {
    p[3 * i] = a.x, p[3 * i + 1] = a.y, p[3 * i + 2] = a.z;
}
__device__ inline float sign(float a) { return static_cast<float>((a > 0.0f) - (a < 0.0f)); }

// 1 / |a|, or 0 for the zero vector.
__device__ inline float inverse_length(Vec3<float> a) {
    const float length = sqrt(dot(a, a));
    return length > kSmallest ? 1.0f / length : 0.0f;
}

// A surfel under the light, as far as both forward and backward need it.
struct Lit {
    float w, x, y, z, inverse_norm;  // unit quaternion, 1 / length as given
    Vec3<float> normal, view, light, half;
    float over_distance, over_sum = 0;  // 1 / distance of the camera, 1 / |view + light|
    float n_l, n_h;                     // signed; 0 in the shadow, as the lobe
    float lobe;                         // |n_h|^shininess

    __device__ Lit(const Job& job, const Material& m, int64_t i) {
        const float* q = job.quats + 4 * i;
        inverse_norm = 1.0f / sqrt(fma(q[0], q[0], fma(q[1], q[1], fma(q[2], q[2], q[3] * q[3]))));
        w = q[0] * inverse_norm, x = q[1] * inverse_norm, y = q[2] * inverse_norm, z = q[3] * inverse_norm;
        normal = axes(w, x, y, z).n;
        const Vec3<float> to_camera = load(job.camera_position, 0) - load(job.means, i);
        over_distance = inverse_length(to_camera);
        view = light = half = over_distance * to_camera;
        if (job.light) {
            const Vec3<float> to_light = load(job.light, 0);
            light = inverse_length(to_light) * to_light;
            const Vec3<float> both = view + light;
            over_sum = inverse_length(both);
            half = over_sum * both;
        }
        n_l = dot(normal, light), n_h = dot(normal, half);
        lobe = exp2f(m.shininess * log2f(fmaxf(abs(n_h), kSmallest)));
        // No light where it is behind the face that the camera sees.
        if (job.facing && (dot(normal, view) < 0.0f ? -n_l : n_l) <= 0.0f) n_l = n_h = lobe = 0.0f;
    }
};

// A colour that is clamped to 0 and 1, in which NaN stays; and its gradient, which passes within.
__device__ inline float clamped(float a) { return a <= a ? clamp(a, 0.0f, 1.0f) : a; }
__device__ inline float clamped_backward(float a, float gradient) { return a >= 0.0f && a <= 1.0f ? gradient : 0.0f; }

__device__ inline Vec3<float> shade(const Material& m, const Lit& s, float gain, Vec3<float> color) {
    const float highlight = m.specular * s.lobe;
    return {fma(gain, color.x, highlight), fma(gain, color.y, highlight), fma(gain, color.z, highlight)};
}

__global__ __launch_bounds__(kBlock) void shade_kernel(const Job job, float* shaded, float* gains) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= job.n) return;
    const Material m(job, i);
    const Lit s(job, m, i);
    const float gain = fma(m.diffuse, abs(s.n_l), m.ambient);
    Vec3<float> seen = shade(m, s, gain, load(job.color, i));
    if (job.clamped) seen = {clamped(seen.x), clamped(seen.y), clamped(seen.z)};
    store(shaded, i, seen);
    if (gains) gains[i] = gain;
}

// Gradients of the directions: of the normal into the quaternion, of the view direction into the mean.
__device__ void store_directions(const Job& job, const Gradients& out, const Lit& s, float by_n_l, float by_n_h,
                                 int64_t i) {
    if (out.quats) {
        const Vec3<float> none{0.0f, 0.0f, 0.0f};
        axes_backward(s.w, s.x, s.y, s.z, s.inverse_norm, Axes<float>{none, none, by_n_l * s.light + by_n_h * s.half},
                      out.quats + 4 * i);
    }
    if (out.means) {
        Vec3<float> by_view = (by_n_l + by_n_h) * s.normal;  // headlight: light and half are the view direction
        if (job.light) {
            const Vec3<float> by_half = by_n_h * s.normal;
            by_view = s.over_sum * (by_half - dot(by_half, s.half) * s.half);
        }
        store(out.means, i, s.over_distance * (dot(by_view, s.view) * s.view - by_view));
    }
}

// Gradients of ambient, diffuse, specular and shininess.
struct ByMaterial {
    float v[4] = {};
};

// The derivative of value = low + span sigmoid(x), or 1.
__device__ inline float sigmoid_slope(float value, const float* range) {
    const float above = value - range[0];
    return range[1] > 0.0f ? above * (1.0f - above / range[1]) : 1.0f;
}

__device__ ByMaterial shade_backward(const Job& job, const Gradients& out, int64_t i) {
    const Material m(job, i);
    const Lit s(job, m, i);
    const float gain = fma(m.diffuse, abs(s.n_l), m.ambient);
    const Vec3<float> color = load(job.color, i), seen = shade(m, s, gain, color);
    Vec3<float> g = load(out.shaded, i);
    if (job.clamped) g = {clamped_backward(seen.x, g.x), clamped_backward(seen.y, g.y), clamped_backward(seen.z, g.z)};
    if (out.color) store(out.color, i, gain * g);
    const float by_gain = dot(color, g) + (out.gain ? out.gain[i] : 0.0f), by_highlight = g.x + g.y + g.z;
    const float cosine = fmaxf(abs(s.n_h), kSmallest), by_lobe = by_highlight * m.specular * s.lobe;
    store_directions(job, out, s, by_gain * m.diffuse * sign(s.n_l), by_lobe * m.shininess / cosine * sign(s.n_h), i);
    return {{by_gain * sigmoid_slope(m.ambient, out.ranges),
             by_gain * abs(s.n_l) * sigmoid_slope(m.diffuse, out.ranges + 2),
             by_highlight * s.lobe * sigmoid_slope(m.specular, out.ranges + 4),
             by_lobe * kLn2 * log2f(cosine) * sigmoid_slope(m.shininess, out.ranges + 6)}};
}

__global__ __launch_bounds__(kBlock) void shade_backward_kernel(const Job job, const Gradients out) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    ByMaterial by;
    if (i < job.n) by = shade_backward(job, out, i);
#pragma unroll
    for (int k = 0; k < 4; ++k) {
        if (!out.material[k]) continue;
        if (job.shared >> k & 1) {
            const double sum = block_sum<kBlock>(by.v[k]);
            if (threadIdx.x == 0) out.sums[4 * int64_t(blockIdx.x) + k] = sum;
        } else if (i < job.n) {
            out.material[k][i] = by.v[k];
        }
    }
}

}  // namespace
}  // namespace texgs::cuda

using namespace texgs;
using namespace texgs::cuda;

int32_t texgs_blinn_phong(int64_t n, const float* color, const float* ambient, const float* diffuse,
                          const float* specular, const float* shininess, int32_t shared, const float* means,
                          const float* quats, const float* camera_position, const float* light, int32_t facing,
                          int32_t clamped, float* shaded, float* gain, void* on) {
    return on_device_of(camera_position, on, [&](cudaStream_t stream) {
        const Job job{n,     color, ambient,         diffuse, specular,    shininess,   shared,
                      means, quats, camera_position, light,   facing != 0, clamped != 0};
        launch(shade_kernel, blocks_for(n, kBlock), kBlock, stream, job, shaded, gain);
    });
}

int32_t texgs_blinn_phong_backward(int64_t n, const float* color, const float* ambient, const float* diffuse,
                                   const float* specular, const float* shininess, int32_t shared, const float* means,
                                   const float* quats, const float* camera_position, const float* light, int32_t facing,
                                   int32_t clamped, const float* ranges, const float* grad_shaded,
                                   const float* grad_gain, float* grad_color, float* grad_ambient, float* grad_diffuse,
                                   float* grad_specular, float* grad_shininess, float* grad_means, float* grad_quats,
                                   void* on) {
    return with_workspace(camera_position, on, [&](Workspace& workspace, cudaStream_t stream) {
        const Job job{n,     color, ambient,         diffuse, specular,    shininess,   shared,
                      means, quats, camera_position, light,   facing != 0, clamped != 0};
        const int64_t blocks = blocks_for(n, kBlock);
        Gradients out{grad_shaded,
                      grad_gain,
                      grad_color,
                      {grad_ambient, grad_diffuse, grad_specular, grad_shininess},
                      grad_means,
                      grad_quats,
                      workspace.sums.ensure<double>(4 * blocks),
                      {}};
        if (ranges) std::copy(ranges, ranges + 8, out.ranges);
        launch(shade_backward_kernel, blocks, kBlock, stream, job, out);
        for (int k = 0; k < 4; ++k)
            if (out.material[k] && (shared >> k & 1))
                finish_sum(out.sums + k, blocks, 4, 0.0, 1.0, out.material[k], stream);
    });
}
