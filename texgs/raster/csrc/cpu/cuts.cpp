// SPDX-License-Identifier: Apache-2.0
// Depth ranges of a cut on CPUs, rows of pixels in parallel.
#include "../cuts.h"

#include <algorithm>
#include <limits>

#include "parallel.h"

namespace texgs {
namespace {

// One row of pixels, as a function: the compiler sees vectors where nothing may alias the sizes.
void cut_row(const SeenPlane* planes, int n, int width, float y, float* near, float* far, int32_t* face) {
    std::fill_n(near, width, 0.0f);
    std::fill_n(far, width, std::numeric_limits<float>::infinity());
    std::fill_n(face, width, -1);
    for (int i = 0; i < n; ++i)
        for (int x = 0; x < width; ++x)
            cut(i, planes[i].slope(static_cast<float>(x) + 0.5f, y), planes[i].height, near[x], far[x], face[x]);
    for (int x = 0; x < width; ++x) face[x] = near[x] < far[x] ? face[x] : -1;
}

}  // namespace
}  // namespace texgs

using namespace texgs;

int32_t texgs_cut_range(const texgs_camera* camera, int32_t n, const float* planes, float* depth_range, int32_t* face,
                        void*) {
    return guarded([&] {
        check_camera(*camera);
        check_planes(n);
        SeenPlane seen[TEXGS_MAX_PLANES];
        for (int i = 0; i < n; ++i) seen[i] = seen_plane(*camera, planes + 4 * i);
        const int64_t width = camera->width, plane = width * camera->height;
        parallel_for(camera->height, 16, [&](int64_t begin, int64_t end, int) {
            for (int64_t y = begin; y < end; ++y)
                cut_row(seen, n, camera->width, static_cast<float>(y) + 0.5f, depth_range + y * width,
                        depth_range + plane + y * width, face + y * width);
        });
    });
}
