// SPDX-License-Identifier: Apache-2.0
// View-dependent colour of surfels from real spherical harmonics of degree 0 to 3, in the order and with the signs of
// 3DGS (Kerbl et al. 2023).
#include "interleaved.h"
#include "loss_kernels.h"

#include "../maths.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kMostTerms = 16;
// Normalisation factors, as square roots of multiples of 1 / pi: 1/4; 3/4; 15/4, 5/16, 15/16; 35/32, 105/4, 21/32,
// 7/16, 105/16.
constexpr float kY0 = 0.28209479f;
constexpr float kY1 = 0.48860251f;
constexpr float kY2[3] = {1.09254843f, 0.31539157f, 0.54627422f};
constexpr float kY3[5] = {0.59004359f, 2.89061144f, 0.45704580f, 0.37317633f, 1.44530572f};

// A value with its gradient by the direction.
struct Term {
    vf y;
    Vec3<vf> g;
};

// Basis functions and their gradients as polynomials of a unit direction.
void evaluate(int degree, Vec3<vf> d, Term out[kMostTerms]) {
    const vf x = d.x, y = d.y, z = d.z, zero = 0.0f;
    const auto term = [&](int k, float c, vf value, vf gx, vf gy, vf gz) {
        out[k] = {vf(c) * value, {vf(c) * gx, vf(c) * gy, vf(c) * gz}};
    };
    term(0, kY0, 1.0f, zero, zero, zero);
    if (degree < 1) return;
    term(1, -kY1, y, zero, 1.0f, zero);
    term(2, kY1, z, zero, zero, 1.0f);
    term(3, -kY1, x, 1.0f, zero, zero);
    if (degree < 2) return;
    const vf xx = x * x, yy = y * y, zz = z * z, two = 2.0f, four = 4.0f;
    term(4, kY2[0], x * y, y, x, zero);
    term(5, -kY2[0], y * z, zero, z, y);
    term(6, kY2[1], two * zz - xx - yy, -(two * x), -(two * y), four * z);
    term(7, -kY2[0], x * z, z, zero, x);
    term(8, kY2[2], xx - yy, two * x, -(two * y), zero);
    if (degree < 3) return;
    const vf three = 3.0f, six = 6.0f, eight = 8.0f, band = four * zz - xx - yy;
    term(9, -kY3[0], y * (three * xx - yy), six * x * y, three * (xx - yy), zero);
    term(10, kY3[1], x * y * z, y * z, x * z, x * y);
    term(11, -kY3[2], y * band, -(two * x * y), band - two * yy, eight * y * z);
    term(12, kY3[3], z * (two * zz - three * (xx + yy)), -(six * x * z), -(six * y * z), six * zz - three * (xx + yy));
    term(13, -kY3[2], x * band, band - two * xx, -(two * x * y), eight * x * z);
    term(14, kY3[4], z * (xx - yy), two * x * z, -(two * y * z), xx - yy);
    term(15, -kY3[0], x * (xx - three * yy), three * (xx - yy), -(six * x * y), zero);
}

struct Direction {
    Vec3<vf> d;
    vf over_distance;
};

Direction from_camera(const HarmonicsJob& job, int64_t i, int n) {
    vf mean[3];
    load_columns<3>(job.means + 3 * i, n, mean);
    const Vec3<vf> v{mean[0] - vf(job.camera_position[0]), mean[1] - vf(job.camera_position[1]),
                     mean[2] - vf(job.camera_position[2])};
    const vf length = sqrt(dot(v, v)), over = zero_unless(length > vf(1e-30f), vf(1.0f) / length);
    return {over * v, over};
}

using Stored = float[kLanes];

}  // namespace

void harmonics_range(const HarmonicsJob& job, int64_t begin, int64_t end) {
    const int terms = (job.degree + 1) * (job.degree + 1);
    for (int64_t first = begin; first < end; first += kLanes) {
        const int n = static_cast<int>(end - first < kLanes ? end - first : kLanes);
        Term basis[kMostTerms];
        evaluate(job.degree, from_camera(job, first, n).d, basis);
        Stored y[kMostTerms];
        for (int k = 0; k < terms; ++k) store(y[k], basis[k].y);
        for (int i = 0; i < n; ++i) {  // a surfel's coefficients lie together: one surfel at a time
            const float* sh = job.sh + (first + i) * terms * 3;
            float c[3] = {0.5f, 0.5f, 0.5f};
            for (int k = 0; k < terms; ++k)
                for (int j = 0; j < 3; ++j) c[j] += y[k][i] * sh[3 * k + j];
            for (int j = 0; j < 3; ++j) job.color[3 * (first + i) + j] = c[j] < 0.0f ? 0.0f : c[j];
        }
    }
}

void harmonics_backward_range(const HarmonicsJob& job, int64_t begin, int64_t end) {
    const int terms = (job.degree + 1) * (job.degree + 1);
    for (int64_t first = begin; first < end; first += kLanes) {
        const int n = static_cast<int>(end - first < kLanes ? end - first : kLanes);
        const Direction direction = from_camera(job, first, n);
        Term basis[kMostTerms];
        evaluate(job.degree, direction.d, basis);
        Stored y[kMostTerms], by_y[kMostTerms];
        for (int k = 0; k < terms; ++k) store(y[k], basis[k].y);
        std::memset(by_y, 0, sizeof by_y);
        for (int i = 0; i < n; ++i) {
            const int64_t id = first + i;
            float g[3];
            for (int j = 0; j < 3; ++j) g[j] = job.forward_color[3 * id + j] > 0.0f ? job.grad_color[3 * id + j] : 0.0f;
            const float* sh = job.sh + id * terms * 3;
            for (int k = 0; k < terms; ++k) by_y[k][i] = sh[3 * k] * g[0] + sh[3 * k + 1] * g[1] + sh[3 * k + 2] * g[2];
            if (!job.grad_sh) continue;
            float* out = job.grad_sh + id * terms * 3;
            for (int k = 0; k < terms; ++k)
                for (int j = 0; j < 3; ++j) out[3 * k + j] = y[k][i] * g[j];
        }
        if (!job.grad_means) continue;
        Vec3<vf> by_d{0.0f, 0.0f, 0.0f};
        for (int k = 0; k < terms; ++k) by_d = by_d + load(by_y[k]) * basis[k].g;
        const Vec3<vf> by_mean = direction.over_distance * (by_d - dot(by_d, direction.d) * direction.d);
        const vf columns[3] = {by_mean.x, by_mean.y, by_mean.z};
        store_columns<3>(job.grad_means + 3 * first, columns, n);
    }
}

}  // namespace texgs::TEXGS_ISA
