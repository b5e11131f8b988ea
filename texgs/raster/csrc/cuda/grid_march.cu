// SPDX-License-Identifier: Apache-2.0
// Rays through a sparse voxel grid, a thread each.
#include "grid.cuh"

namespace texgs::cuda {
namespace {

constexpr int kThreads = 128;

__device__ inline int64_t thread_index() { return int64_t(blockIdx.x) * kThreads + threadIdx.x; }

// Calls body(sample) where there is any density along a ray, front to back; returns the light that is left.
template <class Body>
__device__ float march(const texgs_grid& grid, const texgs_march& how, const Ray& ray, const Body& body) {
    const float step = how.step;
    float light = 1.0f;
    for (int k = ray.first; k < ray.samples && !(light < how.transmittance_min);) {
        const Point p = sample_point(grid, ray, k, step);
        const int block = block_of(grid, p.cell);
        if (const int distance = grid.distance[block]) {
            k += skipped(ray, p, distance);
            continue;
        }
        if (grid.occupied[block] >> bit_of(p.cell) & 1) {
            const Corners corners = corners_of(grid, p.cell);
            const float density = density_at(grid, corners, p.f);
            if (density > 0.0f) {
                const float behind = light * ::expf(-density * step * grid.spacing);
                body(Sample{p, corners, light - behind, behind, ray.near + (static_cast<float>(k) + 0.5f) * step});
                light = behind;
            }
        }
        ++k;
    }
    return light;
}

__global__ __launch_bounds__(kThreads) void count_kernel(const GridJob job) {
    const int64_t i = thread_index();
    if (i > job.how.n) return;
    uint64_t count = 0;
    if (i < job.how.n) {
        const Ray ray = enter(job.grid, job.how, i);
        march(job.grid, job.how, ray, [&](const Sample&) { ++count; });
    }
    job.begin[i] = count;
}

// The colour of a sample, from the rows of its corners and the basis in the ray's direction.
template <int K>
__device__ void shade(const texgs_grid& grid, const Sample& s, const float (&basis)[K], float out[3]) {
    float w[8];
    corner_weights(s.point.f, w);
    const auto* rows = reinterpret_cast<const float4*>(grid.rows);
    float4 color{0.5f, 0.5f, 0.5f, 0.0f};
#pragma unroll
    for (int q = 0; q < K / 4; ++q) {
        float4 sum{0.0f, 0.0f, 0.0f, 0.0f};
#pragma unroll
        for (int i = 0; i < 8; ++i) {
            const float4 v = rows[int64_t(s.corners.row[i]) * (K / 4) + q];
            sum.x = fma(w[i], v.x, sum.x), sum.y = fma(w[i], v.y, sum.y);
            sum.z = fma(w[i], v.z, sum.z), sum.w = fma(w[i], v.w, sum.w);
        }
        color.x = fma(basis[4 * q], sum.x, color.x);
        color.y = fma(basis[4 * q + 1], sum.y, color.y);
        color.z = fma(basis[4 * q + 2], sum.z, color.z);
        if (K == 32 && q == 1) color.x = fma(basis[7], sum.w, color.x);  // the ninth coefficient is in the extras
        if (K == 32 && q == 2) color.y = fma(basis[11], sum.w, color.y);
        if (K == 32 && q == 3) color.z = fma(basis[15], sum.w, color.z);
    }
    const float sums[3] = {color.x, color.y, color.z};
    for (int c = 0; c < 3; ++c) out[c] = sums[c] < 0.0f ? 0.0f : sums[c];  // a NaN is not hidden
}

template <int K, bool Keep>
__global__ __launch_bounds__(kThreads) void render_kernel(const GridJob job) {
    const int64_t i = thread_index();
    if (i >= job.how.n) return;
    const Ray ray = enter(job.grid, job.how, i);
    float basis[K];
    row_basis(K == 32 ? 2 : K == 16 ? 1 : 0, ray.direction, basis);
    if (Keep)
        for (int k = 0; k < K; ++k) job.basis[i * K + k] = basis[k];
    float color[3] = {0.0f, 0.0f, 0.0f}, depth = 0.0f;
    GridSample* next = Keep ? job.samples + job.begin[i] : nullptr;
    const float light = march(job.grid, job.how, ray, [&](const Sample& s) {
        float own[3];
        shade<K>(job.grid, s, basis, own);
        for (int c = 0; c < 3; ++c) color[c] = fma(s.weight, own[c], color[c]);
        depth = fma(s.weight, s.distance, depth);
        if (Keep && next < job.samples + job.begin[i + 1])  // as many as were counted, whatever the compiler does
            *next++ = {
                pack(s.point.cell), static_cast<uint32_t>(i), {s.point.f[0], s.point.f[1], s.point.f[2]}, s.weight,
                s.behind,           {own[0], own[1], own[2]}};
    });
    // nor fewer: the rest counts for nothing
    if (Keep)
        for (; next < job.samples + job.begin[i + 1]; ++next)
            *next = {0, static_cast<uint32_t>(i), {}, 0.0f, light, {}};
    const float alpha = 1.0f - light;
    if (job.color)
        for (int c = 0; c < 3; ++c) job.color[3 * i + c] = color[c] + light * job.how.background[c];
    if (job.alpha) job.alpha[i] = alpha;
    if (job.depth) job.depth[i] = alpha > 0.0f ? depth * job.grid.spacing / alpha : 0.0f;
}

template <int K>
void render(const GridJob& job, bool keep, cudaStream_t stream) {
    launch(keep ? render_kernel<K, true> : render_kernel<K, false>, blocks_for(job.how.n, kThreads), kThreads, stream,
           job);
}

// The samples of a ray back to front: light that reaches the background or later samples is what a denser sample takes
// away.
__global__ __launch_bounds__(kThreads) void gradient_kernel(const GridJob job) {
    const int64_t ray = thread_index();
    if (ray >= job.how.n) return;
    const uint64_t first = job.begin[ray], end = job.begin[ray + 1];
    if (first == end) return;
    float g[3] = {0.0f, 0.0f, 0.0f}, later = job.grad_alpha ? -job.grad_alpha[ray] : 0.0f;
    for (int c = 0; c < 3 && job.grad_color; ++c) {
        g[c] = job.grad_color[3 * ray + c];
        later = fma(g[c], job.how.background[c], later);
    }
    later *= job.samples[end - 1].behind;
    const float delta = job.how.step * job.grid.spacing;
    for (uint64_t i = end; i-- > first;) {
        const GridSample& s = job.samples[i];
        float by_weight = 0.0f, by_color[3];
        for (int c = 0; c < 3; ++c) {
            by_color[c] = s.color[c] > 0.0f ? s.weight * g[c] : 0.0f;
            by_weight = fma(g[c], s.color[c], by_weight);
        }
        job.gradients[i] = {by_color[0], by_color[1], by_color[2], delta * (s.behind * by_weight - later)};
        later = fma(s.weight, by_weight, later);
    }
}

}  // namespace

void count_samples(const GridJob& job, cudaStream_t stream) {
    launch(count_kernel, blocks_for(job.how.n + 1, kThreads), kThreads, stream, job);
}

void render_rays(const GridJob& job, bool keep, cudaStream_t stream) {
    if (job.grid.degree == 2) return render<32>(job, keep, stream);
    if (job.grid.degree == 1) return render<16>(job, keep, stream);
    render<4>(job, keep, stream);
}

void sample_gradients(const GridJob& job, cudaStream_t stream) {
    launch(gradient_kernel, blocks_for(job.how.n, kThreads), kThreads, stream, job);
}

}  // namespace texgs::cuda
