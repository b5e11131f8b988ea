// SPDX-License-Identifier: Apache-2.0
// The C interface of the voxel grid on CPUs.
#include <algorithm>
#include <memory>
#include <mutex>
#include <vector>

#include "../grid_checks.h"
#include "../texgs_neural.h"
#include "grid_samples.h"
#include "parallel.h"

namespace texgs {
namespace {

constexpr int64_t kBlockRange = 1024;

class SamplesPool {
public:
    std::unique_ptr<texgs_grid_samples> take() {
        std::lock_guard lock(mutex_);
        if (idle_.empty()) return std::make_unique<texgs_grid_samples>();
        std::unique_ptr<texgs_grid_samples> samples = std::move(idle_.back());
        idle_.pop_back();
        return samples;
    }
    void give(std::unique_ptr<texgs_grid_samples> samples) {
        std::lock_guard lock(mutex_);
        if (idle_.size() < 2) idle_.push_back(std::move(samples));
    }
    void clear() {
        std::lock_guard lock(mutex_);
        idle_.clear();
    }

private:
    std::mutex mutex_;
    std::vector<std::unique_ptr<texgs_grid_samples>> idle_;
};
SamplesPool& pool() {
    static SamplesPool samples;
    return samples;
}

GridJob job_of(const texgs_grid& grid, const texgs_march& march) {
    check_grid(grid);
    check_march(march);
    GridJob job{};
    job.grid = grid, job.march = march;
    for (int a = 0; a < 3; ++a) job.bricks[a] = (grid.size[a] + kBrickSide - 1) / kBrickSide;
    return job;
}

int64_t block_count(const texgs_grid& grid) {
    return int64_t(grid.size[0] / 4) * (grid.size[1] / 4) * (grid.size[2] / 4);
}

}  // namespace

void clear_grid_pool() { pool().clear(); }

}  // namespace texgs

using namespace texgs;

int32_t texgs_grid_occupy(const texgs_grid* grid, uint64_t* occupied, uint8_t* distance, void*) {
    return guarded([&] {
        check_grid(*grid);
        occupy(*grid, occupied, distance);
    });
}

int32_t texgs_grid_render(const texgs_grid* grid, const texgs_march* march, float* color, float* alpha, float* depth,
                          texgs_grid_samples** samples, void*) {
    return guarded([&] {
        GridJob job = job_of(*grid, *march);
        job.color = color, job.alpha = alpha, job.depth = depth;
        std::unique_ptr<texgs_grid_samples> s = pool().take();
        s->render(job, samples != nullptr);
        if (samples)
            *samples = s.release();
        else
            pool().give(std::move(s));
    });
}

int32_t texgs_grid_backward(texgs_grid_samples* samples, const texgs_grid* grid, const texgs_march* march,
                            const float* grad_color, const float* grad_alpha, float* gradient, uint8_t* touched,
                            void*) {
    return guarded([&] {
        GridJob job = job_of(*grid, *march);
        job.grad_color = grad_color, job.grad_alpha = grad_alpha, job.gradient = gradient, job.touched = touched;
        samples->gather(job);
    });
}

int32_t texgs_grid_mark(texgs_grid_samples* samples, const texgs_grid* grid, const texgs_march* march, float* weight,
                        void*) {
    return guarded([&] {
        GridJob job = job_of(*grid, *march);
        job.row_weight = weight;
        samples->gather(job);
    });
}

int64_t texgs_grid_count(const texgs_grid_samples* samples) { return samples->count(); }

int32_t texgs_grid_points(texgs_grid_samples* samples, const texgs_grid* grid, const texgs_march* march, float* points,
                          int32_t* lengths, void*) {
    return guarded([&] {
        check_grid(*grid);
        check_march(*march);
        samples->list(*grid, march->n, points, lengths);
    });
}

void texgs_grid_release(texgs_grid_samples* samples) {
    guarded([&] {
        if (samples) pool().give(std::unique_ptr<texgs_grid_samples>(samples));
    });
}

int32_t texgs_grid_total_variation(const texgs_grid* grid, int64_t n_blocks, const int32_t* blocks,
                                   float weight_density, float weight_sh, float* gradient, uint8_t* touched, void*) {
    return guarded([&] {
        check_grid(*grid);
        const GridVariation job{*grid, weight_density, weight_sh, gradient, touched};
        grid_kernels().total_variation(job, blocks, n_blocks);
    });
}

int32_t texgs_grid_step(const texgs_grid* grid, const texgs_rule* rule, float* gradient, uint8_t* touched, float* first,
                        float* second, void*) {
    return guarded([&] {
        check_grid(*grid);
        check_rule(*rule);
        const GridStep job{*grid, *rule, gradient, first, second, touched};
        parallel_for(block_count(*grid), kBlockRange,
                     [&](int64_t begin, int64_t end, int) { grid_kernels().step(job, begin, end); });
    });
}
