// SPDX-License-Identifier: Apache-2.0
// Losses and shading: splits images into tiles and surfels into ranges, runs the kernels of the active instruction set
// in parallel, and adds up their sums in a fixed order.
#include <algorithm>
#include <vector>

#include "../checks.h"
#include "dispatch.h"
#include "loss_kernels.h"
#include "parallel.h"

namespace texgs {

const LossKernels& loss_kernels() {
#if defined(__x86_64__) || defined(_M_X64)
    if (active_isa() == Isa::avx512) return avx512::kLossKernels;
    if (active_isa() == Isa::avx2) return avx2::kLossKernels;
#endif
    return portable::kLossKernels;
}

namespace {

constexpr int64_t kSurfelRange = 1024;
constexpr int kRowRange = 32;

// Planes of equal tiles, widths a multiple of 16 but for the last in a row.
std::vector<LossTile> cut_tiles(int planes, int height, int width) {
    const int columns = (width + kLossTileWidth - 1) / kLossTileWidth;
    const int rows = (height + kLossTileHeight - 1) / kLossTileHeight;
    const int w = (width + 16 * columns - 1) / (16 * columns) * 16, h = (height + rows - 1) / rows;
    std::vector<LossTile> tiles;
    for (int plane = 0; plane < planes; ++plane)
        for (int y = 0; y < height; y += h)
            for (int x = 0; x < width; x += w)
                tiles.push_back({plane, x, std::min(x + w, width), y, std::min(y + h, height)});
    return tiles;
}

// The sums of body(i) over [0, n), each computed by one worker.
template <class Sums, class Body>
std::vector<Sums> collect(int64_t n, const Body& body) {
    std::vector<Sums> sums(n);
    parallel_for(n, 1, [&](int64_t begin, int64_t end, int) {
        for (int64_t i = begin; i < end; ++i) sums[i] = body(i);
    });
    return sums;
}

int64_t ranges(int64_t n, int64_t length) { return (n + length - 1) / length; }

// Calls body(begin, end) on ranges of `length` that cover [0, n) and returns what it returns.
template <class Sums, class Index, class Body>
std::vector<Sums> collect_ranges(Index n, Index length, const Body& body) {
    return collect<Sums>(ranges(n, length), [&](int64_t i) {
        const Index begin = static_cast<Index>(i) * length;
        return body(begin, std::min(begin + length, n));
    });
}

double total(const std::vector<double>& sums) {
    double result = 0.0;
    for (const double sum : sums) result += sum;
    return result;
}

}  // namespace
}  // namespace texgs

using namespace texgs;

int32_t texgs_l1_dssim(const float* image, const float* target, int32_t channels, int32_t height, int32_t width,
                       float l1_weight, float dssim_weight, float* value, float* gradient, void*) {
    return guarded([&] {
        check_image(channels, height, width);
        const LossKernels& kernels = loss_kernels();
        const double n = static_cast<double>(channels) * height * width;
        const float l1_scale = static_cast<float>(l1_weight / n), dssim_scale = static_cast<float>(dssim_weight / n);
        const SsimJob job{image, target, height, width, l1_scale, dssim_scale, gradient};
        const std::vector<LossTile> tiles = cut_tiles(channels, height, width);
        double l1 = 0.0, dssim = 0.0;
        for (const SsimSums& sums :
             collect<SsimSums>(tiles.size(), [&](int64_t i) { return kernels.ssim(job, tiles[i]); }))
            l1 += sums.l1, dssim += sums.dssim;
        *value = static_cast<float>((l1_weight * l1 + dssim_weight * dssim) / n);
    });
}

int32_t texgs_depth_to_normal(const float* depth, const float* viewmat, const float* K, int32_t height, int32_t width,
                              float* normal, void*) {
    return guarded([&] {
        check_image(1, height, width);
        const LossKernels& kernels = loss_kernels();
        NormalJob job{};
        job.depth = depth, job.viewmat = viewmat, job.K = K, job.height = height, job.width = width;
        job.out_normal = normal;
        parallel_for(height, kRowRange, [&](int64_t begin, int64_t end, int) {
            kernels.depth_to_normal(job, static_cast<int>(begin), static_cast<int>(end));
        });
    });
}

int32_t texgs_depth_to_normal_backward(const float* depth, const float* viewmat, const float* K, int32_t height,
                                       int32_t width, const float* grad_normal, float* grad_depth, void*) {
    return guarded([&] {
        check_image(1, height, width);
        const LossKernels& kernels = loss_kernels();
        NormalJob job{};
        job.depth = depth, job.viewmat = viewmat, job.K = K, job.height = height, job.width = width;
        job.upstream = grad_normal, job.out_depth = grad_depth;
        parallel_for(height, kRowRange, [&](int64_t begin, int64_t end, int) {
            kernels.depth_to_normal_backward(job, static_cast<int>(begin), static_cast<int>(end));
        });
    });
}

int32_t texgs_normal_consistency(const float* normal, const float* depth, const float* alpha, const float* viewmat,
                                 const float* K, int32_t height, int32_t width, float weight, float* value,
                                 float* grad_normal, float* grad_depth, void*) {
    return guarded([&] {
        check_image(1, height, width);
        const LossKernels& kernels = loss_kernels();
        const double n = static_cast<double>(height) * width;
        NormalJob job{};
        job.depth = depth, job.viewmat = viewmat, job.K = K, job.height = height, job.width = width;
        job.normal = normal, job.alpha = alpha, job.scale = static_cast<float>(weight / n);
        job.out_normal = grad_normal, job.out_depth = grad_depth;
        const double agreement = total(collect_ranges<double>(
            height, kRowRange, [&](int begin, int end) { return kernels.normal_consistency(job, begin, end); }));
        *value = static_cast<float>(weight * (1.0 - agreement / n));
    });
}

int32_t texgs_bilateral_smoothness(const float* attribute, const float* guide, const float* alpha, int32_t channels,
                                   int32_t height, int32_t width, float weight, float* value, float* gradient, void*) {
    return guarded([&] {
        check_image(channels, height, width);
        const LossKernels& kernels = loss_kernels();
        const double n = kSobelSum * static_cast<double>(channels) * height * width;
        const SmoothnessJob job{attribute, guide, alpha, channels, height, width, static_cast<float>(weight / n),
                                gradient};
        const std::vector<LossTile> tiles = cut_tiles(1, height, width);
        const double sum =
            total(collect<double>(tiles.size(), [&](int64_t i) { return kernels.smoothness(job, tiles[i]); }));
        *value = static_cast<float>(weight * sum / n);
    });
}

int32_t texgs_blinn_phong(int64_t n, const float* color, const float* ambient, const float* diffuse,
                          const float* specular, const float* shininess, int32_t shared, const float* means,
                          const float* quats, const float* camera_position, const float* light, int32_t facing,
                          int32_t clamped, float* shaded, float* gain, void*) {
    return guarded([&] {
        const LossKernels& kernels = loss_kernels();
        BlinnPhongJob job{};
        job.color = color, job.ambient = ambient, job.diffuse = diffuse, job.specular = specular;
        job.shininess = shininess, job.shared = shared, job.means = means, job.quats = quats;
        job.camera_position = camera_position, job.light = light, job.facing = facing != 0, job.clamped = clamped != 0;
        job.shaded = shaded, job.gain = gain;
        parallel_for(n, kSurfelRange, [&](int64_t begin, int64_t end, int) { kernels.blinn_phong(job, begin, end); });
    });
}

int32_t texgs_blinn_phong_backward(int64_t n, const float* color, const float* ambient, const float* diffuse,
                                   const float* specular, const float* shininess, int32_t shared, const float* means,
                                   const float* quats, const float* camera_position, const float* light, int32_t facing,
                                   int32_t clamped, const float* ranges, const float* grad_shaded,
                                   const float* grad_gain, float* grad_color, float* grad_ambient, float* grad_diffuse,
                                   float* grad_specular, float* grad_shininess, float* grad_means, float* grad_quats,
                                   void*) {
    return guarded([&] {
        const LossKernels& kernels = loss_kernels();
        const BlinnPhongJob job{color,        ambient,       diffuse,         specular,   shininess,   shared,
                                means,        quats,         camera_position, light,      facing != 0, clamped != 0,
                                nullptr,      nullptr,       grad_shaded,     grad_gain,  grad_color,  grad_ambient,
                                grad_diffuse, grad_specular, grad_shininess,  grad_means, grad_quats,  ranges};
        double material[4] = {0.0, 0.0, 0.0, 0.0};
        for (const MaterialSums& sums : collect_ranges<MaterialSums>(n, kSurfelRange, [&](int64_t begin, int64_t end) {
                 return kernels.blinn_phong_backward(job, begin, end);
             }))
            for (int k = 0; k < 4; ++k) material[k] += sums.v[k];
        float* const out[4] = {grad_ambient, grad_diffuse, grad_specular, grad_shininess};
        for (int k = 0; k < 4; ++k)
            if (out[k] && (shared >> k & 1)) *out[k] = static_cast<float>(material[k]);
    });
}

int32_t texgs_spherical_harmonics(int64_t n, int32_t degree, const float* sh, const float* means,
                                  const float* camera_position, float* color, void*) {
    return guarded([&] {
        check_degree(degree);
        const LossKernels& kernels = loss_kernels();
        HarmonicsJob job{};
        job.degree = degree, job.sh = sh, job.means = means, job.camera_position = camera_position, job.color = color;
        parallel_for(n, kSurfelRange, [&](int64_t begin, int64_t end, int) { kernels.harmonics(job, begin, end); });
    });
}

int32_t texgs_spherical_harmonics_backward(int64_t n, int32_t degree, const float* sh, const float* means,
                                           const float* camera_position, const float* color, const float* grad_color,
                                           float* grad_sh, float* grad_means, void*) {
    return guarded([&] {
        check_degree(degree);
        const LossKernels& kernels = loss_kernels();
        const HarmonicsJob job{degree, sh, means, camera_position, nullptr, color, grad_color, grad_sh, grad_means};
        parallel_for(n, kSurfelRange,
                     [&](int64_t begin, int64_t end, int) { kernels.harmonics_backward(job, begin, end); });
    });
}
