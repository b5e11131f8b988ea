// SPDX-License-Identifier: Apache-2.0
// The C interface of the voxel grid on GPUs, and the buffers of rays' samples.
#include <bit>

#include "../grid_checks.h"
#include "grid.cuh"
#include "raster.cuh"
#include "workspace.cuh"

using namespace texgs;
using namespace texgs::cuda;

namespace {

constexpr int64_t kMostSamples = (int64_t(1) << 29) - 1;  // with a corner each, they are counted in 32 bits

}  // namespace

// Samples along rays on one device. Objects are reused: a training loop works with the same one or two.
struct texgs_grid_samples {
    explicit texgs_grid_samples(int device) : device(device) {}
    const int device;
    Mark last_use;

    void render(GridJob& job, bool keep, cudaStream_t stream);
    void attach(GridJob& job);
    void gather(GridJob& job, cudaStream_t stream);

    int64_t count = 0;

private:
    Late n_samples_;
    Buffer begin_, samples_, basis_, gradients_, keys_, keys2_, values_, values2_, row_begin_, scratch_;
};

void texgs_grid_samples::attach(GridJob& job) {
    job.begin = begin_.ensure<uint64_t>(job.how.n + 1);
    job.samples = samples_.ensure<GridSample>(count);
    job.basis = basis_.ensure<float>(job.how.n * floats_of(job.grid));
}

// The host waits for the number of samples, to make room for them.
void texgs_grid_samples::render(GridJob& job, bool keep, cudaStream_t stream) {
    const int64_t n = job.how.n;
    if (keep) {
        job.begin = begin_.ensure<uint64_t>(n + 1);
        count_samples(job, stream);
        prefix_sums(job.begin, n + 1, scratch_.ensure<char>(static_cast<int64_t>(prefix_sums_bytes(n + 1))), stream);
        n_samples_.fetch(job.begin + n, stream);
        count = n_samples_.wait();
        if (count > kMostSamples) throw OutOfMemory{count * int64_t(sizeof(GridSample))};
        attach(job);
    }
    render_rays(job, keep, stream);
}

void texgs_grid_samples::gather(GridJob& job, cudaStream_t stream) {
    attach(job);
    if (count == 0) return;
    job.gradients = gradients_.ensure<float4>(count);
    sample_gradients(job, stream);
    const int64_t corners = 8 * count;
    PingPong keys{keys_.ensure<uint32_t>(corners), keys2_.ensure<uint32_t>(corners)};
    PingPong values{values_.ensure<uint32_t>(corners), values2_.ensure<uint32_t>(corners)};
    job.keys = keys.current, job.values = values.current;
    list_corners(job, count, stream);
    void* scratch = scratch_.ensure<char>(static_cast<int64_t>(sort_bytes(corners)));
    sort_pairs(keys, values, corners, std::bit_width(static_cast<uint64_t>(job.grid.n)), scratch, stream);
    job.values = values.current;
    job.row_begin = row_begin_.ensure<uint32_t>(job.grid.n + 1);
    find_tiles(keys.current, corners, static_cast<int>(job.grid.n), job.row_begin, stream);
    gather_rows(job, stream);
}

namespace {

GridJob job_of(const texgs_grid& grid, const texgs_march& march) {
    check_grid(grid);
    check_march(march);
    GridJob job{};
    job.grid = grid, job.how = march;
    return job;
}

}  // namespace

void texgs::cuda::clear_grid_pool() { pool<texgs_grid_samples>().clear(); }

int32_t texgs_grid_occupy(const texgs_grid* grid, uint64_t* occupied, uint8_t* distance, void* on) {
    return with_workspace(occupied, on, [&](Workspace& workspace, cudaStream_t stream) {
        check_grid(*grid);
        occupy(*grid, occupied, distance, workspace.planes.ensure<uint64_t>(block_count(*grid)), stream);
    });
}

int32_t texgs_grid_render(const texgs_grid* grid, const texgs_march* march, float* color, float* alpha, float* depth,
                          texgs_grid_samples** samples, void* on) {
    return guarded([&] {
        GridJob job = job_of(*grid, *march);
        job.color = color, job.alpha = alpha, job.depth = depth;
        const int device = device_of(grid->rows);
        const DeviceScope scope(device);
        std::unique_ptr<texgs_grid_samples> s = pool<texgs_grid_samples>().take(device);
        {
            const auto stream = static_cast<cudaStream_t>(on);
            const Turn turn(s->last_use, stream);
            s->render(job, samples != nullptr, stream);
        }
        if (samples)
            *samples = s.release();
        else
            pool<texgs_grid_samples>().give(std::move(s));
    });
}

int32_t texgs_grid_backward(texgs_grid_samples* samples, const texgs_grid* grid, const texgs_march* march,
                            const float* grad_color, const float* grad_alpha, float* gradient, uint8_t* touched,
                            void* on) {
    return guarded([&] {
        GridJob job = job_of(*grid, *march);
        job.grad_color = grad_color, job.grad_alpha = grad_alpha, job.gradient = gradient, job.touched = touched;
        const auto stream = static_cast<cudaStream_t>(on);
        const DeviceScope scope(samples->device);
        const Turn turn(samples->last_use, stream);
        samples->gather(job, stream);
    });
}

int32_t texgs_grid_mark(texgs_grid_samples* samples, const texgs_grid* grid, const texgs_march* march, float* weight,
                        void* on) {
    return guarded([&] {
        GridJob job = job_of(*grid, *march);
        job.row_weight = weight;
        const auto stream = static_cast<cudaStream_t>(on);
        const DeviceScope scope(samples->device);
        const Turn turn(samples->last_use, stream);
        samples->attach(job);
        mark_rows(job, samples->count, stream);
    });
}

void texgs_grid_release(texgs_grid_samples* samples) {
    guarded([&] {
        if (samples) pool<texgs_grid_samples>().give(std::unique_ptr<texgs_grid_samples>(samples));
    });
}

int32_t texgs_grid_total_variation(const texgs_grid* grid, int64_t n_blocks, const int32_t* blocks,
                                   float weight_density, float weight_sh, float* gradient, uint8_t* touched, void* on) {
    return with_workspace(gradient, on, [&](Workspace& workspace, cudaStream_t stream) {
        check_grid(*grid);
        total_variation(*grid, n_blocks, blocks, weight_density, weight_sh, gradient, touched,
                        workspace.planes.ensure<uint32_t>(block_count(*grid)), stream);
    });
}

int32_t texgs_grid_step(const texgs_grid* grid, const texgs_rule* rule, float* gradient, uint8_t* touched, float* first,
                        float* second, void* on) {
    return on_device_of(gradient, on, [&](cudaStream_t stream) {
        check_grid(*grid);
        check_rule(*rule);
        step_rows(*grid, *rule, gradient, touched, first, second, stream);
    });
}
