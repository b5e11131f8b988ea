// SPDX-License-Identifier: Apache-2.0
// Rays through a sparse voxel grid. A ray has two loops: the first looks at densities alone, lists the samples that
// show something and asks for the rows around them; the second, some samples later, blends their colours.
#include "grid_kernels.h"
#include "grid_row.h"
#include "grid_walk.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kBatch = 32;  // samples between the loops: their rows fit into the first-level cache

struct Pending {
    int n;
    int32_t rows[kBatch][8];
};

struct Light {
    float color[3], depth, transmittance;
};

// Red, green and blue from a row's products with the basis: sums over the coefficients.
template <int K>
TEXGS_INLINE void fold(const Row<K>& products, float out[3]) {
    vf total = products.v[0];
    for (int i = 1; i < Row<K>::kVectors; ++i) total += products.v[i];
    float sums[kLanes];
    store(sums, total);
    for (int c = 0; c < 3; ++c) {
        out[c] = 0.5f;
        for (int i = c; i < (K < kLanes ? K : kLanes); i += 4) out[c] += sums[i];
    }
    if constexpr (K == 32) {  // the ninth coefficient is in the extras
        float first[16];
        for (int i = 0; i < 16 / kLanes; ++i) store(first + i * kLanes, products.v[i]);
        for (int c = 0; c < 3; ++c) out[c] += first[7 + 4 * c];
    }
}

// The second loop: colours of the pending samples, the last ones listed, added to the light.
template <int K>
void blend(const GridJob& job, const Row<K>& basis, Pending& pending, GridSample* samples, Light& light) {
    const float* rows = job.grid.rows;
    for (int i = 0; i < pending.n; ++i) {
        GridSample& s = samples[i];
        float w[8];
        corner_weights(s.f, w);
        Row<K> sum = zero_row<K>();
        for (int corner = 0; corner < 8; ++corner) {
            const Row<K> row = load_row<K>(rows + int64_t(pending.rows[i][corner]) * K);
            sum = each<K>([&](vf a, vf b) { return fma(w[corner], a, b); }, row, sum);
        }
        fold<K>(each<K>([](vf a, vf b) { return a * b; }, sum, basis), s.color);
        for (int c = 0; c < 3; ++c) {
            s.color[c] = s.color[c] < 0.0f ? 0.0f : s.color[c];  // a NaN is not hidden
            light.color[c] += s.weight * s.color[c];
        }
    }
    pending.n = 0;
}

// Both loops for one ray; its samples are appended to the chunk.
template <int K>
Light march_ray(const GridJob& job, const Ray& ray, int first, int end, GridChunk& chunk, float* basis_floats) {
    Light light{{0.0f, 0.0f, 0.0f}, 0.0f, 1.0f};
    Pending pending;
    pending.n = 0;
    Row<K> basis = zero_row<K>();
    GridSample *const begin = chunk.samples + chunk.count, *next = begin;
    light.transmittance = march(job.grid, job.march, ray, first, end, [&](const Sample& s) {
        for (const int32_t row : s.corners.row) prefetch_row<K>(job.grid.rows + int64_t(row) * K);
        if (next == begin) {
            row_basis(job.grid.degree, ray.direction, basis_floats);
            basis = load_row<K>(basis_floats);
        }
        const float* f = s.point.f;
        *next++ = {pack(s.point.cell), {f[0], f[1], f[2]}, s.weight, s.behind, {}};
        light.depth += s.weight * s.distance;
        for (int i = 0; i < 8; ++i) pending.rows[pending.n][i] = s.corners.row[i];
        if (++pending.n == kBatch) blend<K>(job, basis, pending, next - kBatch, light);
    });
    blend<K>(job, basis, pending, next - pending.n, light);
    chunk.count += next - begin;
    return light;
}

void write_ray(const GridJob& job, int64_t i, const Light& light) {
    const float alpha = 1.0f - light.transmittance;
    if (job.color)
        for (int c = 0; c < 3; ++c)
            job.color[3 * i + c] = light.color[c] + light.transmittance * job.march.background[c];
    if (job.alpha) job.alpha[i] = alpha;
    if (job.depth) job.depth[i] = alpha > 0.0f ? light.depth * job.grid.spacing / alpha : 0.0f;
}

template <int K>
int64_t march_chunk(const GridJob& job, GridChunk& chunk, int64_t begin, int64_t end) {
    Bundle bundle;
    for (int64_t i = begin; i < end; ++i) {
        const int lane = static_cast<int>((i - begin) % kLanes);
        if (lane == 0) enter_all(job.grid, job.march, i, static_cast<int>(end - i < kLanes ? end - i : kLanes), bundle);
        const int first = bundle.first[lane], last = bundle.end[lane];
        if (!job.keep) chunk.count = 0;
        if (chunk.count + last - first > chunk.capacity) return i;
        const int64_t before = chunk.count;
        float scratch[K];
        const Light light =
            march_ray<K>(job, bundle.rays[lane], first, last, chunk, job.keep ? job.basis + i * K : scratch);
        if (job.keep) job.lengths[i] = static_cast<int32_t>(chunk.count - before);
        write_ray(job, i, light);
    }
    return end;
}

}  // namespace

int64_t march_rays(const GridJob& job, GridChunk& chunk, int64_t begin, int64_t end) {
    return for_degree(job.grid.degree, [&](auto k) { return march_chunk<k.value>(job, chunk, begin, end); });
}

}  // namespace texgs::TEXGS_ISA
