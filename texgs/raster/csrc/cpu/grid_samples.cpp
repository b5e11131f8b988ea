// SPDX-License-Identifier: Apache-2.0
// Marching rays and gathering their gradients, in parallel and with the same bits for any number of threads: rays are
// cut into chunks of a fixed size, chunks into a fixed number of groups. Records are sorted by brick, those of a brick
// by group, so by ray. A sample reaches its own brick and the next one along each axis: the slabs of bricks across x
// take turns, first the even ones, then the odd ones, and no two threads meet.
#include "grid_samples.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "../status.h"
#include "dispatch.h"
#include "parallel.h"

namespace texgs {

const GridKernels& grid_kernels() {
#if defined(__x86_64__) || defined(_M_X64)
    if (active_isa() == Isa::avx512) return avx512::kGridKernels;
    if (active_isa() == Isa::avx2) return avx2::kGridKernels;
#endif
    return portable::kGridKernels;
}

namespace {

constexpr int64_t kChunkRays = 512;
constexpr int64_t kGroups = 16;

int64_t brick_count(const GridJob& job) { return int64_t(job.bricks[0]) * job.bricks[1] * job.bricks[2]; }

}  // namespace
}  // namespace texgs

using namespace texgs;

// Room for so many more samples.
void texgs_grid_samples::Chunk::make_room(int64_t samples) {
    if (list.count + samples <= list.capacity) return;
    Buffer larger;
    const int64_t capacity = std::max(list.count + samples, 2 * list.capacity);
    auto* moved = larger.ensure<GridSample>(capacity);
    if (list.count) std::memcpy(moved, list.samples, list.count * sizeof(GridSample));
    memory.swap(larger);
    list.samples = moved, list.capacity = capacity;
}

void texgs_grid_samples::march_chunk(const GridJob& job, int64_t index, int64_t begin, int64_t end) try {
    const int32_t* size = job.grid.size;
    const double longest = size[0] + size[1] + size[2];  // of all rays, the diagonal at most
    Chunk& chunk = chunks_[index];
    chunk.list.count = 0;
    while (begin < end) {
        chunk.make_room(static_cast<int64_t>(longest / job.march.step) + 2);
        begin = grid_kernels().march(job, chunk.list, begin, end);
    }
} catch (const OutOfMemory& e) {
    missing_ = e.bytes;
}

void texgs_grid_samples::render(GridJob& job, bool keep) {
    const int64_t n = job.march.n;
    const int floats = job.grid.degree == 2 ? 32 : job.grid.degree == 1 ? 16 : 4;
    job.keep = keep;
    job.basis = keep ? basis_.ensure<float>(n * floats) : nullptr;
    job.lengths = keep ? lengths_.ensure<int32_t>(n) : nullptr;
    n_chunks_ = (n + kChunkRays - 1) / kChunkRays;
    const int64_t lists = keep ? n_chunks_ : threads();  // what is not kept goes with the next chunk of its thread
    while (static_cast<int64_t>(chunks_.size()) < lists) chunks_.emplace_back();
    missing_ = 0;
    parallel_for(n_chunks_, 1, [&](int64_t begin, int64_t end, int worker) {
        for (int64_t i = begin; i < end; ++i)
            march_chunk(job, keep ? i : worker, i * kChunkRays, std::min((i + 1) * kChunkRays, n));
    });
    if (missing_) throw OutOfMemory{missing_};
}

// How many samples each group has in each brick: [group, brick].
void texgs_grid_samples::count_by_brick(const GridJob& job) {
    const int64_t bricks = brick_count(job);
    auto* counts = cursors_.ensure<uint32_t>(kGroups * bricks);
    parallel_for(kGroups, 1, [&](int64_t begin, int64_t end, int) {
        std::memset(counts + begin * bricks, 0, (end - begin) * bricks * sizeof(uint32_t));
        for (int64_t group = begin; group < end; ++group)
            for (int64_t i = group * n_chunks_ / kGroups; i < (group + 1) * n_chunks_ / kGroups; ++i)
                for (int64_t s = 0; s < chunks_[i].list.count; ++s) {
                    const uint32_t cell = chunks_[i].list.samples[s].cell;
                    const int64_t x = cell >> 23, y = cell >> 13 & 127, z = cell >> 3 & 127;
                    ++counts[group * bricks + (x * job.bricks[1] + y) * job.bricks[2] + z];
                }
    });
}

// Counts become the place of a group's first record in a brick, bricks one after the other.
void texgs_grid_samples::sum_counts(const GridJob& job) {
    const int64_t bricks = brick_count(job), per_slab = bricks / job.bricks[0];
    auto* cursors = cursors_.ensure<uint32_t>(kGroups * bricks);
    auto* slabs = slabs_.ensure<int64_t>(job.bricks[0] + 1);
    int64_t sum = 0;
    for (int64_t brick = 0; brick < bricks; ++brick) {
        if (brick % per_slab == 0) slabs[brick / per_slab] = sum;
        for (int64_t group = 0; group < kGroups; ++group)
            sum += std::exchange(cursors[group * bricks + brick], static_cast<uint32_t>(sum));
    }
    slabs[job.bricks[0]] = n_records_ = sum;
    if (sum > UINT32_MAX) throw OutOfMemory{sum * static_cast<int64_t>(sizeof(GridRecord))};
}

void texgs_grid_samples::place(const GridJob& job) {
    const int64_t bricks = brick_count(job), n = job.march.n;
    auto* cursors = cursors_.ensure<uint32_t>(kGroups * bricks);
    auto* records = records_.ensure<GridRecord>(n_records_);
    parallel_for(kGroups, 1, [&](int64_t begin, int64_t end, int) {
        for (int64_t group = begin; group < end; ++group)
            for (int64_t i = group * n_chunks_ / kGroups; i < (group + 1) * n_chunks_ / kGroups; ++i)
                grid_kernels().place(job, chunks_[i].list.samples, i * kChunkRays, std::min((i + 1) * kChunkRays, n),
                                     cursors + group * bricks, records);
    });
}

void texgs_grid_samples::scatter(const GridJob& job) {
    const GridRecord* records = records_.ensure<GridRecord>(n_records_);
    const int64_t* slabs = slabs_.ensure<int64_t>(job.bricks[0] + 1);
    const auto kernel = job.row_weight ? grid_kernels().mark : grid_kernels().scatter;
    for (int64_t parity = 0; parity < 2; ++parity)
        parallel_for((job.bricks[0] + 1 - parity) / 2, 1, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i) {
                const int64_t slab = 2 * i + parity;
                kernel(job, records + slabs[slab], records + slabs[slab + 1]);
            }
        });
}

void texgs_grid_samples::gather(GridJob& job) {
    job.basis = basis_.ensure<float>(0);
    job.lengths = lengths_.ensure<int32_t>(0);
    count_by_brick(job);
    sum_counts(job);
    place(job);
    scatter(job);
}

int64_t texgs_grid_samples::count() const {
    int64_t sum = 0;
    for (int64_t i = 0; i < n_chunks_; ++i) sum += chunks_[i].list.count;
    return sum;
}

void texgs_grid_samples::list(const texgs_grid& grid, int64_t n_rays, float* points, int32_t* lengths) {
    for (int64_t i = 0; i < n_chunks_; ++i)
        for (const GridSample *s = chunks_[i].list.samples, *end = s + chunks_[i].list.count; s < end; ++s) {
            const uint32_t cell[3] = {s->cell >> 20, s->cell >> 10 & 1023, s->cell & 1023};
            for (int a = 0; a < 3; ++a)
                *points++ = grid.lower[a] + grid.spacing * (static_cast<float>(cell[a]) + s->f[a]);
        }
    std::copy_n(lengths_.ensure<int32_t>(0), n_rays, lengths);
}
