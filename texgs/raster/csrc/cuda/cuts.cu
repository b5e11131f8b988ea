// SPDX-License-Identifier: Apache-2.0
// Depth ranges of a cut on GPUs, a thread a pixel.
#include "../cuts.h"
#include "maths.cuh"
#include "workspace.cuh"

using namespace texgs;
using namespace texgs::cuda;

namespace texgs::cuda {
namespace {

constexpr int kThreads = 128;

__global__ __launch_bounds__(kThreads) void cut_kernel(const texgs_camera camera, int32_t n, const float* planes,
                                                       float* depth_range, int32_t* face) {
    const int64_t pixel = int64_t(blockIdx.x) * kThreads + threadIdx.x, plane = int64_t(camera.width) * camera.height;
    if (pixel >= plane) return;
    const float x = static_cast<float>(pixel % camera.width) + 0.5f;
    const float y = static_cast<float>(pixel / camera.width) + 0.5f;
    float near = 0.0f, far = INFINITY;
    int32_t entered = -1;
    for (int i = 0; i < n; ++i) {
        const SeenPlane seen = seen_plane(camera, planes + 4 * i);
        cut(i, seen.slope(x, y), seen.height, near, far, entered);
    }
    depth_range[pixel] = near, depth_range[plane + pixel] = far;
    face[pixel] = near < far ? entered : -1;
}

}  // namespace
}  // namespace texgs::cuda

int32_t texgs_cut_range(const texgs_camera* camera, int32_t n, const float* planes, float* depth_range, int32_t* face,
                        void* on) {
    return on_device_of(face, on, [&](cudaStream_t stream) {
        check_camera(*camera);
        check_planes(n);
        launch(cut_kernel, blocks_for(int64_t(camera->width) * camera->height, kThreads), kThreads, stream, *camera, n,
               planes, depth_range, face);
    });
}
