// SPDX-License-Identifier: Apache-2.0
// The C interface on CPUs, and the pool of frames.
#include <memory>
#include <mutex>
#include <vector>

#include "../checks.h"
#include "dispatch.h"
#include "frame.h"
#include "grid_samples.h"

using namespace texgs;

namespace {

// Frames whose buffers wait to be used again. A few are enough; more would only hold memory.
class FramePool {
public:
    std::unique_ptr<texgs_frame> take() {
        std::lock_guard lock(mutex_);
        if (idle_.empty()) return std::make_unique<texgs_frame>();
        std::unique_ptr<texgs_frame> frame = std::move(idle_.back());
        idle_.pop_back();
        return frame;
    }
    void clear() {
        std::lock_guard lock(mutex_);
        idle_.clear();
    }
    void give(std::unique_ptr<texgs_frame> frame) {
        std::lock_guard lock(mutex_);
        if (idle_.size() < 2) idle_.push_back(std::move(frame));
    }

private:
    std::mutex mutex_;
    std::vector<std::unique_ptr<texgs_frame>> idle_;
};
FramePool& pool() {
    static FramePool frames;
    return frames;
}

}  // namespace

int32_t texgs_abi_version(void) { return TEXGS_ABI_VERSION; }
const char* texgs_sources(void) { return TEXGS_SOURCES; }
const char* texgs_error(void) { return last_error.c_str(); }
int64_t texgs_memory(int32_t reset) { return memory_peak(reset != 0); }

const char* texgs_instruction_set(void) {
    const char* name = nullptr;
    guarded([&] { name = isa_name(active_isa()); });
    return name;
}

int32_t texgs_require_memory(int64_t bytes) {
    return guarded([&] { require_memory(bytes); });
}

int32_t texgs_forward(const texgs_surfels* surfels, const texgs_camera* camera, const texgs_options* options,
                      const texgs_image* image, texgs_frame** frame, void*) {
    return guarded([&] {
        check_scene(*surfels, *camera, *options, *image);
        std::unique_ptr<texgs_frame> f = pool().take();
        f->bin(*surfels, *camera, *options, *image);
        if (image->color) f->render();
        if (frame)
            *frame = f.release();
        else
            pool().give(std::move(f));
    });
}

int32_t texgs_backward(texgs_frame* frame, const texgs_surfels* surfels, const texgs_camera* camera,
                       const texgs_options* options, const texgs_image* image, const texgs_image* grad,
                       const texgs_gradients* out, void*) {
    return guarded([&] {
        check_frame(frame->raster, *surfels, *camera);
        check_gradients(*image, *grad, frame->raster.with_normal);
        frame->attach(*surfels, *camera, *options);
        frame->differentiate(*image, *grad, *out);
    });
}

int32_t texgs_contribute(texgs_frame* frame, const texgs_surfels* surfels, const texgs_camera* camera,
                         const texgs_options* options, const texgs_contributions* out, void*) {
    return guarded([&] {
        check_frame(frame->raster, *surfels, *camera);
        check_contributions(*out);
        frame->attach(*surfels, *camera, *options);
        frame->contribute(*out);
    });
}

void texgs_release(texgs_frame* frame) {
    guarded([&] {
        if (frame) pool().give(std::unique_ptr<texgs_frame>(frame));
    });
}

void texgs_trim(void) {
    guarded([] { pool().clear(), clear_grid_pool(); });
}
