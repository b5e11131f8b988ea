// SPDX-License-Identifier: Apache-2.0
// Sums the slots of each surfel, in order, and carries the sums back through the projection.
#include "gradients.cuh"
#include "surfel.cuh"

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

__device__ void store_geometry(const texgs_gradients& out, int64_t i, const SurfelGradient<float>& g) {
    if (out.means) out.means[3 * i] = g.mean.x, out.means[3 * i + 1] = g.mean.y, out.means[3 * i + 2] = g.mean.z;
    if (out.quats)
        for (int k = 0; k < 4; ++k) out.quats[4 * i + k] = g.quat[k];
    if (out.scales) out.scales[2 * i] = g.su, out.scales[2 * i + 1] = g.sv;
    if (out.opacities) out.opacities[i] = g.opacity;
    if (out.shift) out.shift[2 * i] = g.shift_x, out.shift[2 * i + 1] = g.shift_y;
}

__device__ void store_channels(const Raster& r, int64_t i, const float* sums, int first) {
    const int own = r.surfels.channels;
    float* channels = r.surfels.base ? r.out.base : r.out.features;
    for (int c = 0; channels && c < own; ++c) channels[i * own + c] = sums[first + c];
    if (r.out.gain) r.out.gain[i] = sums[r.slot_width - 1];
}

__global__ __launch_bounds__(kBlock) void surfel_gradients_kernel(const Raster r) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= r.surfels.n) return;
    const float* s = r.sums + i * r.slot_width;
    const bool depth = r.grad.depth || r.grad.median || r.grad.distortion;
    const int first = !r.geometry ? 0 : kGeometrySums + (depth ? kDepthSums : 0);
    store_channels(r, i, s, first);
    if (!r.geometry) return;
    SurfelGradient<float> gradient{};
    if (r.footprints[i].x0 < r.footprints[i].x1) {  // a surfel that is not drawn may have no finite projection
        Moments<float> m{s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9], s[10], 0, 0, {0, 0, 0}};
        if (depth) m.zc = s[kGeometrySums], m.zp = s[kGeometrySums + 1];
        const float* normal = s + first + r.surfels.channels;
        if (r.grad.normal) m.normal = {normal[0], normal[1], normal[2]};
        const View view = make_view(r.camera.viewmat, r.camera.K);
        const Surfel<float> surfel = load_surfel(r.surfels, i);
        gradient = project_backward(view, surfel, project(view, surfel, r.options.filter_sigma), m, r.options.low_pass);
    }
    store_geometry(r.out, i, gradient);
}

__global__ __launch_bounds__(kBlock) void surfel_contributions_kernel(const Raster r) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= r.surfels.n) return;
    const float* s = r.sums + i * r.slot_width;
    const texgs_contributions& out = r.contributions;
    if (out.weight_sum) out.weight_sum[i] = s[0];
    if (out.weight_max) out.weight_max[i] = s[1];
    if (out.pixels) out.pixels[i] = s[2];
    for (int c = 0; out.sums && c < out.channels; ++c) out.sums[i * out.channels + c] = s[3 + c];
}

}  // namespace

void sum_slots(const Raster& r, int maximum, cudaStream_t stream) {
    launch(sum_slots_kernel, blocks_for(r.surfels.n, kBlock / kWarp), kBlock, stream, r, maximum);
}

void surfel_gradients(const Raster& r, cudaStream_t stream) {
    launch(surfel_gradients_kernel, blocks_for(r.surfels.n, kBlock), kBlock, stream, r);
}

void surfel_contributions(const Raster& r, cudaStream_t stream) {
    launch(surfel_contributions_kernel, blocks_for(r.surfels.n, kBlock), kBlock, stream, r);
}

}  // namespace texgs::cuda
