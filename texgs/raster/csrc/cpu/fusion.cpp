// SPDX-License-Identifier: Apache-2.0
// Depth maps of many views as one surface: blocks of voxels in parallel, each voxel updated by one worker.
#include "../texgs_fusion.h"

#include <algorithm>
#include <cmath>

#include "../status.h"
#include "parallel.h"

namespace texgs {
namespace {

constexpr int kBlock = TEXGS_FUSION_BLOCK;
constexpr int64_t kBlockRange = 16;

// Where voxels are on an image: pixel = affine * (x, y, z, 1), with the camera z in its last row.
struct Projection {
    float row[3][4];

    Projection(const texgs_lattice& lattice, const texgs_depth_view& view) {
        for (int i = 0; i < 3; ++i) {
            double world[4] = {};  // row i of K [R t], from world to homogeneous pixels
            for (int j = 0; j < 4; ++j)
                for (int k = 0; k < 3; ++k) world[j] += double(view.K[3 * i + k]) * view.viewmat[4 * k + j];
            double offset = world[3];
            for (int j = 0; j < 3; ++j) {
                row[i][j] = static_cast<float>(world[j] * lattice.spacing);
                offset += world[j] * lattice.lower[j];
            }
            row[i][3] = static_cast<float>(offset);
        }
    }
};

void update(const texgs_lattice& lattice, int64_t at, float distance, const uint8_t* color) {
    const float before = lattice.views[at], share = 1.0f / (before + 1.0f);
    lattice.views[at] = before + 1.0f;
    lattice.distance[at] += share * (distance - lattice.distance[at]);
    for (int c = 0; c < 3; ++c) lattice.color[3 * at + c] += share * (color[c] - lattice.color[3 * at + c]);
}

// A row of voxels along x that begins at (x0, y, z).
void fuse_row(const texgs_lattice& lattice, const texgs_depth_view& view, const Projection& to_pixel, float scale,
              int x0, int y, int z) {
    float start[3];
    for (int i = 0; i < 3; ++i) {
        const float* row = to_pixel.row[i];
        start[i] = row[3] + row[2] * z + row[1] * y + row[0] * x0;
    }
    const int64_t first = (int64_t(z) * lattice.shape[1] + y) * lattice.shape[0] + x0;
    for (int i = 0; i < kBlock; ++i) {
        const float away = start[2] + i * to_pixel.row[2][0];
        if (!(away > 0.0f)) continue;
        const float u = std::floor((start[0] + i * to_pixel.row[0][0]) / away);
        const float v = std::floor((start[1] + i * to_pixel.row[1][0]) / away);
        if (!(u >= 0.0f && v >= 0.0f && u < view.width && v < view.height)) continue;
        const int64_t pixel = int64_t(v) * view.width + int64_t(u);
        const float distance = (view.depth[pixel] - away) * scale;
        if (view.depth[pixel] > 0.0f && distance > -1.0f)
            update(lattice, first + i, std::min(distance, 1.0f), view.color + 3 * pixel);
    }
}

}  // namespace
}  // namespace texgs

using namespace texgs;

int32_t texgs_fuse(const texgs_lattice* lattice, int64_t n, const int32_t* blocks, const texgs_depth_view* view,
                   float truncation, void*) {
    return guarded([&] {
        require(truncation > 0.0f, "truncation: expected a length above 0");
        const Projection to_pixel(*lattice, *view);
        parallel_for(n, kBlockRange, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i) {
                const int x0 = kBlock * blocks[3 * i], y0 = kBlock * blocks[3 * i + 1], z0 = kBlock * blocks[3 * i + 2];
                for (int z = z0; z < z0 + kBlock; ++z)
                    for (int y = y0; y < y0 + kBlock; ++y)
                        fuse_row(*lattice, *view, to_pixel, 1.0f / truncation, x0, y, z);
            }
        });
    });
}
