// SPDX-License-Identifier: Apache-2.0
// View-dependent colour of surfels from real spherical harmonics of degree 0 to 3, in the order and with the signs of
// 3DGS (Kerbl et al. 2023); one surfel per thread.
#include "../checks.h"
#include "../texgs_losses.h"
#include "maths.cuh"
#include "workspace.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 128;
constexpr float kY0 = 0.28209479f;   // 1 / (2 sqrt(pi))
constexpr float kY1 = 0.48860251f;   // sqrt(3 / (4 pi))
constexpr float kY20 = 1.09254843f;  // sqrt(15 / pi) / 2
constexpr float kY21 = 0.31539157f;  // sqrt(5 / pi) / 4
constexpr float kY22 = 0.54627422f;  // half the first
constexpr float kY30 = 0.59004359f;  // sqrt(35 / (2 pi)) / 4
constexpr float kY31 = 2.89061144f;  // sqrt(105 / pi) / 2
constexpr float kY32 = 0.45704580f;  // sqrt(21 / (2 pi)) / 4
constexpr float kY33 = 0.37317633f;  // sqrt(7 / pi) / 4
constexpr float kY34 = 1.44530572f;  // half the second

// Calls visit(k, value, gradient by the direction) for each basis function, a polynomial of the unit direction.
template <int Degree, class Visit>
__device__ __forceinline__ void for_terms(Vec3<float> d, Visit visit) {
    const float x = d.x, y = d.y, z = d.z;
    const auto term = [&](int k, float c, float value, float gx, float gy, float gz) {
        visit(k, c * value, Vec3<float>{c * gx, c * gy, c * gz});
    };
    term(0, kY0, 1.0f, 0.0f, 0.0f, 0.0f);
    if constexpr (Degree >= 1) {
        term(1, -kY1, y, 0.0f, 1.0f, 0.0f);
        term(2, kY1, z, 0.0f, 0.0f, 1.0f);
        term(3, -kY1, x, 1.0f, 0.0f, 0.0f);
    }
    const float xx = x * x, yy = y * y, zz = z * z;
    if constexpr (Degree >= 2) {
        term(4, kY20, x * y, y, x, 0.0f);
        term(5, -kY20, y * z, 0.0f, z, y);
        term(6, kY21, 2.0f * zz - xx - yy, -2.0f * x, -2.0f * y, 4.0f * z);
        term(7, -kY20, x * z, z, 0.0f, x);
        term(8, kY22, xx - yy, 2.0f * x, -2.0f * y, 0.0f);
    }
    if constexpr (Degree >= 3) {
        const float band = 4.0f * zz - xx - yy;
        term(9, -kY30, y * (3.0f * xx - yy), 6.0f * x * y, 3.0f * (xx - yy), 0.0f);
        term(10, kY31, x * y * z, y * z, x * z, x * y);
        term(11, -kY32, y * band, -2.0f * x * y, band - 2.0f * yy, 8.0f * y * z);
        term(12, kY33, z * (2.0f * zz - 3.0f * (xx + yy)), -6.0f * x * z, -6.0f * y * z, 6.0f * zz - 3.0f * (xx + yy));
        term(13, -kY32, x * band, band - 2.0f * xx, -2.0f * x * y, 8.0f * x * z);
        term(14, kY34, z * (xx - yy), 2.0f * x * z, -2.0f * y * z, xx - yy);
        term(15, -kY30, x * (xx - 3.0f * yy), 3.0f * (xx - yy), -6.0f * x * y, 0.0f);
    }
}

struct Direction {
    Vec3<float> d;
    float over_distance;

    __device__ Direction(const float* camera_position, const float* mean) {
        const Vec3<float> v{mean[0] - camera_position[0], mean[1] - camera_position[1], mean[2] - camera_position[2]};
        const float length = sqrt(dot(v, v));
        over_distance = length > 1e-30f ? 1.0f / length : 0.0f;
        d = over_distance * v;
    }
};

struct Job {
    int64_t n;
    const float *sh, *means, *camera_position;
};

template <int Degree>
__global__ __launch_bounds__(kBlock) void color_kernel(const Job job, float* color) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= job.n) return;
    constexpr int kTerms = (Degree + 1) * (Degree + 1);
    const float* sh = job.sh + i * kTerms * 3;
    float c[3] = {0.5f, 0.5f, 0.5f};
    for_terms<Degree>(Direction(job.camera_position, job.means + 3 * i).d, [&](int k, float y, Vec3<float>) {
        for (int j = 0; j < 3; ++j) c[j] = fma(y, sh[3 * k + j], c[j]);
    });
    for (int j = 0; j < 3; ++j) color[3 * i + j] = c[j] < 0.0f ? 0.0f : c[j];  // NaN stays
}

template <int Degree>
__global__ __launch_bounds__(kBlock) void color_backward_kernel(const Job job, const float* color,
                                                                const float* grad_color, float* grad_sh,
                                                                float* grad_means) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= job.n) return;
    constexpr int kTerms = (Degree + 1) * (Degree + 1);
    const float* sh = job.sh + i * kTerms * 3;
    float* out = grad_sh ? grad_sh + i * kTerms * 3 : nullptr;
    float g[3];
    for (int j = 0; j < 3; ++j) g[j] = color[3 * i + j] > 0.0f ? grad_color[3 * i + j] : 0.0f;
    const Direction direction(job.camera_position, job.means + 3 * i);
    Vec3<float> by_d{0.0f, 0.0f, 0.0f};
    for_terms<Degree>(direction.d, [&](int k, float y, Vec3<float> gradient) {
        const float by_y = fma(sh[3 * k], g[0], fma(sh[3 * k + 1], g[1], sh[3 * k + 2] * g[2]));
        by_d = by_d + by_y * gradient;
        for (int j = 0; out && j < 3; ++j) out[3 * k + j] = y * g[j];
    });
    if (!grad_means) return;
    const Vec3<float> by_mean = direction.over_distance * (by_d - dot(by_d, direction.d) * direction.d);
    grad_means[3 * i] = by_mean.x, grad_means[3 * i + 1] = by_mean.y, grad_means[3 * i + 2] = by_mean.z;
}

}  // namespace
}  // namespace texgs::cuda

using namespace texgs;
using namespace texgs::cuda;

int32_t texgs_spherical_harmonics(int64_t n, int32_t degree, const float* sh, const float* means,
                                  const float* camera_position, float* color, void* on) {
    return on_device_of(camera_position, on, [&](cudaStream_t stream) {
        check_degree(degree);
        constexpr decltype(&color_kernel<0>) kernels[] = {color_kernel<0>, color_kernel<1>, color_kernel<2>,
                                                          color_kernel<3>};
        launch(kernels[degree], blocks_for(n, kBlock), kBlock, stream, Job{n, sh, means, camera_position}, color);
    });
}

int32_t texgs_spherical_harmonics_backward(int64_t n, int32_t degree, const float* sh, const float* means,
                                           const float* camera_position, const float* color, const float* grad_color,
                                           float* grad_sh, float* grad_means, void* on) {
    return on_device_of(camera_position, on, [&](cudaStream_t stream) {
        check_degree(degree);
        constexpr decltype(&color_backward_kernel<0>) kernels[] = {color_backward_kernel<0>, color_backward_kernel<1>,
                                                                   color_backward_kernel<2>, color_backward_kernel<3>};
        launch(kernels[degree], blocks_for(n, kBlock), kBlock, stream, Job{n, sh, means, camera_position}, color,
               grad_color, grad_sh, grad_means);
    });
}
