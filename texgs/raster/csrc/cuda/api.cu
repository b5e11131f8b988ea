// SPDX-License-Identifier: Apache-2.0
// The C interface: checks, and the order of calls on different streams.
#include <string>

#include "../cpu/status.h"
#include "frame.cuh"
#include "pool.cuh"

using namespace texgs;
using namespace texgs::cuda;

namespace {

void check_arguments(const texgs_surfels& s, const texgs_camera& c, const texgs_options& o) {
    require(s.n >= 0 && s.n < (int64_t(1) << 31), "surfels: expected fewer than 2^31");
    const bool some = s.n > 0;  // memory of no elements may have no address
    require(!some || (s.means && s.quats && s.scales && s.opacities),
            "surfels: means, quats, scales and opacities are needed");
    require(!some || (s.features != nullptr) != (s.base != nullptr), "surfels: give either features or a texture");
    require(s.channels >= 1 && s.channels <= TEXGS_MAX_CHANNELS, "channels: expected 1 to 32");
    require(!s.base || (s.channels == 3 && s.gain && s.texels && s.sizes && s.offsets),
            "texture: base, gain, texels, sizes and offsets are needed, with 3 channels");
    require(c.viewmat && c.K, "camera: viewmat and K are needed");
    require(c.width >= 1 && c.height >= 1 && c.width < (1 << 20) && c.height < (1 << 20),
            "image: width and height must be 1 to 2^20 - 1");
    require(o.low_pass > 0, "low_pass: expected above 0");
    require(o.filter_sigma >= 0, "filter_sigma: expected 0 or more");
    require(o.alpha_min > 0 && o.alpha_min < 1, "alpha_min: expected between 0 and 1, without them");
    require(o.transmittance_min >= 0 && o.transmittance_min < 1, "transmittance_min: expected 0 to 1, without 1");
    require(o.near_plane > 0 && o.far_plane > o.near_plane, "near, far: expected 0 < near < far");
}

}  // namespace

int32_t texgs_abi_version(void) { return TEXGS_ABI_VERSION; }
const char* texgs_error(void) { return last_error.c_str(); }
int64_t texgs_bytes_needed(void) { return last_bytes_needed; }
int64_t texgs_memory(int32_t reset) { return texgs::cuda::memory_peak(reset != 0); }
void texgs_use_openmp(void*) {}
void texgs_set_threads(int32_t) {}

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
        check_arguments(*surfels, *camera, *options);
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
        require(image->color && image->alpha, "backward: the forward colour and alpha are needed");
        require(!grad->normal || frame->raster.with_normal, "backward: a normal gradient without a forward normal");
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
        require(!out->image || (out->channels >= 1 && out->channels <= TEXGS_MAX_CHANNELS),
                "channels: expected 1 to 32");
        const auto stream = static_cast<cudaStream_t>(on);
        const DeviceScope scope(frame->device);
        const Turn turn(frame->last_use, stream);
        frame->attach(*surfels, *camera, *options);
        frame->contribute(*out, stream);
    });
}

void texgs_release(texgs_frame* frame) {
    if (frame) pool<texgs_frame>().give(std::unique_ptr<texgs_frame>(frame));
}
