// SPDX-License-Identifier: Apache-2.0
// Sums the slots of each surfel or Gaussian, in order, and carries the sums back through the projection.
#include "primitives.cuh"
#include "warp.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 128;

// One warp per surfel, one lane per number of the slot.
__global__ __launch_bounds__(kBlock) void sum_slots_kernel(const Raster r, int maximum) {
    const int64_t rank = (int64_t(blockIdx.x) * kBlock + threadIdx.x) / kWarp;
    if (rank >= r.surfels.n) return;
    const int64_t begin = r.pair_begin[rank], end = r.pair_begin[rank + 1];
    float* out = r.sums + int64_t(r.order[rank]) * r.slot_width;
    for (int k = lane_index(); k < r.slot_width; k += kWarp) {
        float total = 0.0f;
#pragma unroll 4
        for (int64_t slot = begin; slot < end; ++slot) {
            const float sum = r.slots[slot * r.slot_width + k];
            total = k == maximum ? fmaxf(total, sum) : total + sum;
        }
        out[k] = total;
    }
}

template <int N>
__device__ void store_geometry(const texgs_gradients& out, int64_t i, const Gradient<float, N>& g) {
    if (out.means) out.means[3 * i] = g.mean.x, out.means[3 * i + 1] = g.mean.y, out.means[3 * i + 2] = g.mean.z;
    if (out.quats)
        for (int k = 0; k < 4; ++k) out.quats[4 * i + k] = g.quat[k];
    if (out.scales)
        for (int k = 0; k < N; ++k) out.scales[N * i + k] = g.scale[k];
    if (out.opacities) out.opacities[i] = g.opacity;
    if (out.shift) out.shift[2 * i] = g.shift_x, out.shift[2 * i + 1] = g.shift_y;
}

__device__ void store_channels(const Raster& r, int64_t i, const float* sums, int first) {
    const int textured = r.surfels.base ? 3 : 0, plain = r.surfels.channels - textured;
    for (int c = 0; r.out.base && c < textured; ++c) r.out.base[3 * i + c] = sums[first + c];
    for (int c = 0; r.out.features && c < plain; ++c) r.out.features[i * plain + c] = sums[first + textured + c];
    if (r.out.gain) r.out.gain[i] = sums[r.slot_width - 1];
}

template <class P>
__global__ __launch_bounds__(kBlock) void gradients_kernel(const Raster r) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= r.surfels.n) return;
    const float* s = r.sums + i * r.slot_width;
    const bool depth = r.grad.depth || r.grad.median || r.grad.distortion;
    const int first = !r.geometry ? 0 : depth ? P::Sums::kAll : P::Sums::kGeometry;
    store_channels(r, i, s, first);
    if (!r.geometry) return;
    Gradient<float, P::kScales> gradient{};
    if (r.footprints[i].x0 < r.footprints[i].x1) {  // what is not drawn may have no finite projection
        const View view = make_view(r.camera.viewmat, r.camera.K);
        const P primitive = load_primitive<P>(r.surfels, i);
        auto m = read_moments(primitive, s, depth);
        if constexpr (!P::kAffine) {
            const float* normal = s + first + r.surfels.channels;
            if (r.grad.normal) m.normal = {normal[0], normal[1], normal[2]};
        }
        const auto q = project(view, primitive, r.camera, r.options);
        gradient = project_backward(view, primitive, q, m, r.options);
        if (r.surfels.raw) activate_backward(primitive, gradient);
    }
    store_geometry(r.out, i, gradient);
}

__global__ __launch_bounds__(kBlock) void surfel_contributions_kernel(const Raster r) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= r.surfels.n) return;
    const float* s = r.sums + i * r.slot_width;
    const texgs_contributions& out = r.contributions;
    using K = ContributionSums;
    if (out.weight_sum) out.weight_sum[i] = s[K::kWeight];
    if (out.weight_max) out.weight_max[i] = s[K::kLargest];
    if (out.pixels) out.pixels[i] = s[K::kPixels];
    for (int c = 0; out.sums && c < out.channels; ++c) out.sums[i * out.channels + c] = s[K::kChannels + c];
}

}  // namespace

void sum_slots(const Raster& r, int maximum, cudaStream_t stream) {
    launch(sum_slots_kernel, blocks_for(r.surfels.n, kBlock / kWarp), kBlock, stream, r, maximum);
}

void surfel_gradients(const Raster& r, cudaStream_t stream) {
    with_primitive<float>(r.surfels.axes, [&](auto primitive) {
        const auto kernel = gradients_kernel<typename decltype(primitive)::type>;
        launch(kernel, blocks_for(r.surfels.n, kBlock), kBlock, stream, r);
    });
}

void surfel_contributions(const Raster& r, cudaStream_t stream) {
    launch(surfel_contributions_kernel, blocks_for(r.surfels.n, kBlock), kBlock, stream, r);
}

}  // namespace texgs::cuda
