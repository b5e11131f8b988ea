// SPDX-License-Identifier: Apache-2.0
// The C interface on GPUs, and the order of calls on different streams.
#include <string>

#include "../checks.h"
#include "frame.cuh"
#include "grid.cuh"
#include "pool.cuh"
#include "workspace.cuh"

using namespace texgs;
using namespace texgs::cuda;

int32_t texgs_abi_version(void) { return TEXGS_ABI_VERSION; }
const char* texgs_sources(void) { return TEXGS_SOURCES; }
const char* texgs_error(void) { return last_error.c_str(); }
int64_t texgs_memory(int32_t reset) { return texgs::cuda::memory_peak(reset != 0); }
void texgs_use_openmp(void*) {}
void texgs_set_loops(int32_t, const int32_t*) {}

const char* texgs_instruction_set(void) {
    static const std::string architectures = [] {
        std::string names;
        for (const int architecture : {__CUDA_ARCH_LIST__})
            names += (names.empty() ? "sm_" : " sm_") + std::to_string(architecture / 10);
        return names;
    }();
    return architectures.c_str();
}

int32_t texgs_require_memory(int64_t bytes) {
    return guarded([&] { texgs::cuda::require_memory(bytes); });
}

int32_t texgs_forward(const texgs_surfels* surfels, const texgs_camera* camera, const texgs_options* options,
                      const texgs_image* image, texgs_frame** frame, void* on) {
    return guarded([&] {
        check_scene(*surfels, *camera, *options, *image);
        const auto stream = static_cast<cudaStream_t>(on);
        const int device = device_of(camera->viewmat);
        const DeviceScope scope(device);
        std::unique_ptr<texgs_frame> f = pool<texgs_frame>().take(device);
        {
            const Turn turn(f->last_use, stream);
            f->bin(*surfels, *camera, *options, *image, stream);
            if (image->color) f->render(stream);
        }
        if (frame)
            *frame = f.release();
        else
            pool<texgs_frame>().give(std::move(f));
    });
}

int32_t texgs_backward(texgs_frame* frame, const texgs_surfels* surfels, const texgs_camera* camera,
                       const texgs_options* options, const texgs_image* image, const texgs_image* grad,
                       const texgs_gradients* out, void* on) {
    return guarded([&] {
        check_frame(frame->raster, *surfels, *camera);
        check_gradients(*image, *grad, frame->raster.with_normal);
        const auto stream = static_cast<cudaStream_t>(on);
        const DeviceScope scope(frame->device);
        const Turn turn(frame->last_use, stream);
        frame->attach(*surfels, *camera, *options);
        frame->differentiate(*image, *grad, *out, stream);
    });
}

int32_t texgs_contribute(texgs_frame* frame, const texgs_surfels* surfels, const texgs_camera* camera,
                         const texgs_options* options, const texgs_contributions* out, void* on) {
    return guarded([&] {
        check_frame(frame->raster, *surfels, *camera);
        check_contributions(*out);
        const auto stream = static_cast<cudaStream_t>(on);
        const DeviceScope scope(frame->device);
        const Turn turn(frame->last_use, stream);
        frame->attach(*surfels, *camera, *options);
        frame->contribute(*out, stream);
    });
}

void texgs_release(texgs_frame* frame) {
    guarded([&] {
        if (frame) pool<texgs_frame>().give(std::unique_ptr<texgs_frame>(frame));
    });
}

void texgs_trim(void) {
    guarded([] { pool<texgs_frame>().clear(), pool<Workspace>().clear(), clear_grid_pool(); });
}
