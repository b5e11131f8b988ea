// SPDX-License-Identifier: Apache-2.0
// The memory of rays' samples and of their sorted records, kept from one call to the next.
#pragma once
#include <atomic>
#include <deque>

#include "grid_kernels.h"
#include "memory.h"

struct texgs_grid_samples {
    // Marches all rays; `job` needs grid, march and outputs.
    void render(texgs::GridJob& job, bool keep);
    // Adds what the kept samples say: gradients, or weights where `job.row_weight` is given.
    void gather(texgs::GridJob& job);
    // The number of kept samples; their world positions, and how many each ray has.
    int64_t count() const;
    void list(const texgs_grid& grid, int64_t n_rays, float* points, int32_t* lengths);

private:
    struct Chunk {
        texgs::Buffer memory;
        texgs::GridChunk list{};
        void make_room(int64_t samples);
    };

    void march_chunk(const texgs::GridJob& job, int64_t index, int64_t begin, int64_t end);
    void count_by_brick(const texgs::GridJob& job);
    void sum_counts(const texgs::GridJob& job);
    void place(const texgs::GridJob& job);
    void scatter(const texgs::GridJob& job);

    std::deque<Chunk> chunks_;
    int64_t n_chunks_ = 0;
    std::atomic<int64_t> missing_{0};  // bytes that could not be had
    texgs::Buffer basis_, lengths_, cursors_, slabs_, records_;
    int64_t n_records_ = 0;
};

namespace texgs {

// Frees the memory of samples that wait to be used again.
void clear_grid_pool();

}  // namespace texgs
