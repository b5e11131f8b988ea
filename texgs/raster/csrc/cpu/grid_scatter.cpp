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

constexpr int kAhead = 8;  // visits between asking for rows and adding to them

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

// The records of one ray in one cell, and the rows that they add to.
struct Visit {
    const GridRecord *begin, *end;
    Corners corners;
};

// The visit that starts with a record; its rows are asked for.
template <int K>
TEXGS_INLINE Visit visit_from(const GridJob& job, const GridRecord* begin, const GridRecord* end) {
    const GridRecord* next = begin + 1;
    while (next < end && next->cell == begin->cell && next->ray == begin->ray) ++next;
    const Visit visit{begin, next, corners_of(job.grid, unpack(begin->cell))};
    for (const int32_t row : visit.corners.row) prefetch_row<K>(job.gradient + int64_t(row) * K);
    prefetch_row<K>(job.basis + int64_t(begin->ray) * K);
    return visit;
}

template <int K>
TEXGS_INLINE void add_visit(const GridJob& job, const Visit& visit) {
    constexpr int kChannelFloats = K < 16 ? K : 16;  // after which the channels repeat
    using Channels = Row<kChannelFloats>;
    Channels sums[8];
    for (Channels& sum : sums) sum = zero_row<kChannelFloats>();
    for (const GridRecord* r = visit.begin; r < visit.end; ++r) {
        const Channels g = channels_of<kChannelFloats>(r->g);
        float w[8];
        corner_weights(r->f, w);
        for (int i = 0; i < 8; ++i)
            sums[i] = each<kChannelFloats>([&](vf a, vf b) { return fma(w[i], a, b); }, g, sums[i]);
    }
    const Row<K> basis = load_row<K>(job.basis + int64_t(visit.begin->ray) * K);
    for (int i = 0; i < 8; ++i) {
        if (!visit.corners.row[i]) continue;
        float* at = job.gradient + int64_t(visit.corners.row[i]) * K;
        Row<K> gradient = load_row<K>(at);
        for (int v = 0; v < Row<K>::kVectors; ++v)
            gradient.v[v] = fma(sums[i].v[v % Channels::kVectors], basis.v[v], gradient.v[v]);
        store_row<K>(at, gradient);
        job.touched[visit.corners.block[i]] = 1;
    }
}

template <int K>
void scatter(const GridJob& job, const GridRecord* next, const GridRecord* end) {
    Visit visits[kAhead];
    for (int64_t listed = 0, added = 0; added < listed || next < end;) {
        for (; next < end && listed < added + kAhead; next = visits[listed++ % kAhead].end)
            visits[listed % kAhead] = visit_from<K>(job, next, end);
        add_visit<K>(job, visits[added++ % kAhead]);
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
