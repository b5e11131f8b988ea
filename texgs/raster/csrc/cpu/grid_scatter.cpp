// SPDX-License-Identifier: Apache-2.0
// From the gradients of rays to those of rows. Each sample becomes a record, sorted by brick (grid_samples.cpp); then
// the records of a brick find the rows that they add to in the cache.
#include "grid_kernels.h"
#include "grid_row.h"

#include "../grid_maths.h"

namespace texgs::TEXGS_ISA {
namespace {

// Which of a record's four gradients each of the first 16 floats of a row has; later extras are not used.
constexpr int32_t kChannels[16] = {0, 1, 2, 3, 0, 1, 2, 0, 0, 1, 2, 1, 0, 1, 2, 2};

template <int K>
TEXGS_INLINE Row<K> channels_of(const float g[4]) {
    Row<K> out;
    for (int i = 0; i < Row<K>::kVectors; ++i) out.v[i] = permute_quad(g, kChannels + (i * kLanes) % 16);
    return out;
}

// The samples of a ray back to front: light that reaches the background or later samples is what a denser sample takes
// away.
void place_ray(const GridJob& job, const GridSample* samples, int n, int64_t ray, uint32_t* cursors, GridRecord* out) {
    const float* background = job.march.background;
    float g[3] = {0.0f, 0.0f, 0.0f}, later = job.grad_alpha ? -job.grad_alpha[ray] : 0.0f;
    for (int c = 0; c < 3 && job.grad_color; ++c) {
        g[c] = job.grad_color[3 * ray + c];
        later += g[c] * background[c];
    }
    later *= samples[n - 1].behind;
    const float delta = job.march.step * job.grid.spacing;
    for (int i = n - 1; i >= 0; --i) {
        const GridSample& s = samples[i];
        const Cell c = unpack(s.cell);
        const int brick = ((c.x >> 3) * job.bricks[1] + (c.y >> 3)) * job.bricks[2] + (c.z >> 3);
        GridRecord& record = out[cursors[brick]++];
        record.cell = s.cell, record.ray = static_cast<uint32_t>(ray);
        float by_weight = 0.0f;
        for (int a = 0; a < 3; ++a) {
            record.f[a] = s.f[a];
            record.g[a] = s.color[a] > 0.0f ? s.weight * g[a] : 0.0f;
            by_weight += g[a] * s.color[a];
        }
        record.g[3] = delta * (s.behind * by_weight - later);
        later += s.weight * by_weight;
        if (job.row_weight) record.g[0] = s.weight;
    }
}

template <int K>
void scatter(const GridJob& job, const GridRecord* begin, const GridRecord* end) {
    for (const GridRecord* r = begin; r < end; ++r) {
        if (r + 4 < end) prefetch(job.basis + int64_t(r[4].ray) * K);
        const Corners corners = corners_of(job.grid, unpack(r->cell));
        const Row<K> g = each<K>([](vf a, vf b) { return a * b; }, channels_of<K>(r->g),
                                 load_row<K>(job.basis + int64_t(r->ray) * K));
        float w[8];
        corner_weights(r->f, w);
        for (int i = 0; i < 8; ++i) {
            if (!corners.row[i]) continue;
            float* sum = job.gradient + int64_t(corners.row[i]) * K;
            store_row<K>(sum, each<K>([&](vf a, vf b) { return fma(w[i], a, b); }, g, load_row<K>(sum)));
            job.touched[corners.block[i]] = 1;
        }
    }
}

}  // namespace

void place_records(const GridJob& job, const GridSample* samples, int64_t begin, int64_t end, uint32_t* cursors,
                   GridRecord* out) {
    for (int64_t ray = begin; ray < end; ++ray) {
        const int n = job.lengths[ray];
        if (n) place_ray(job, samples, n, ray, cursors, out);
        samples += n;
    }
}

void scatter_records(const GridJob& job, const GridRecord* begin, const GridRecord* end) {
    for_degree(job.grid.degree, [&](auto k) { scatter<k.value>(job, begin, end); });
}

void mark_records(const GridJob& job, const GridRecord* begin, const GridRecord* end) {
    for (const GridRecord* r = begin; r < end; ++r) {
        const Corners corners = corners_of(job.grid, unpack(r->cell));
        for (const int32_t row : corners.row) {
            float& weight = job.row_weight[row];
            if (row && r->g[0] > weight) weight = r->g[0];
        }
    }
}

}  // namespace texgs::TEXGS_ISA
