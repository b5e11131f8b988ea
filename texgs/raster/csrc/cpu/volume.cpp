// SPDX-License-Identifier: Apache-2.0
// Rays through volumes on CPUs, rows of pixels in parallel.
#include "../volume_bricks.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "dispatch.h"
#include "parallel.h"
#include "point_table.h"
#include "volume_kernels.h"

namespace texgs {
namespace {

constexpr int kBrick = TEXGS_BRICK;
constexpr int kPixels = 64;  // of a row that one worker casts at a time

const VolumeKernels& volume_kernels() {
#if defined(__x86_64__) || defined(_M_X64)
    if (active_isa() == Isa::avx512) return avx512::kVolumeKernels;
    if (active_isa() == Isa::avx2) return avx2::kVolumeKernels;
#endif
    return portable::kVolumeKernels;
}

// Bricks in which something shows, as a box of bricks; empty where there is none.
struct Shown {
    int32_t lower[3] = {1, 1, 1}, upper[3] = {0, 0, 0};

    Shown(const uint8_t* distance, const int32_t (&size)[3]) {
        for (int z = 0; z < size[2]; ++z)
            for (int y = 0; y < size[1]; ++y) {
                const uint8_t* row = distance + (int64_t(z) * size[1] + y) * size[0];
                const auto* first = static_cast<const uint8_t*>(std::memchr(row, 0, size[0]));
                if (!first) continue;
                int last = size[0] - 1;
                while (row[last]) --last;
                const int32_t low[3] = {static_cast<int32_t>(first - row), y, z}, high[3] = {last + 1, y + 1, z + 1};
                const bool is_first = upper[0] == 0;
                for (int a = 0; a < 3; ++a) {
                    lower[a] = is_first ? low[a] : std::min(lower[a], low[a]);
                    upper[a] = is_first ? high[a] : std::max(upper[a], high[a]);
                }
            }
    }
    bool any() const { return upper[0] > 0; }
};

// Pixels [x0, x1) x [y0, y1) of a view.
struct Frame {
    int x0, y0, x1, y1;
};

// Pixels that a box may be seen in: all, where a part of it is behind the camera.
Frame frame_of(const CastJob& job) {
    const texgs_cast_view& v = job.view;
    double low[2] = {1e30, 1e30}, high[2] = {-1e30, -1e30};
    for (int corner = 0; corner < 8; ++corner) {
        double camera[3];
        for (int i = 0; i < 3; ++i) {
            camera[i] = v.viewmat[4 * i + 3];
            for (int a = 0; a < 3; ++a) {
                const double cells = job.volume.size[a] - 1, place = corner >> a & 1 ? job.upper[a] : job.lower[a];
                camera[i] += v.viewmat[4 * i + a] * (2.0 * place / cells - 1.0) * job.volume.half[a];
            }
        }
        if (camera[2] < 1e-6) return {0, 0, v.width, v.height};
        const double at[2] = {v.K[0] * camera[0] / camera[2] + v.K[2], v.K[4] * camera[1] / camera[2] + v.K[5]};
        for (int i = 0; i < 2; ++i) low[i] = std::min(low[i], at[i]), high[i] = std::max(high[i], at[i]);
    }
    const auto pixel = [](double place, int size) { return static_cast<int>(std::clamp(place, 0.0, double(size))); };
    return {pixel(low[0] - 1.0, v.width), pixel(low[1] - 1.0, v.height), pixel(high[0] + 2.0, v.width),
            pixel(high[1] + 2.0, v.height)};
}

// Nothing, in all pixels.
void clear(const texgs_cast_view& view) {
    const int64_t n = int64_t(view.width) * view.height;
    std::fill_n(view.rgba, 4 * n, 0.0f);
    if (view.depth) std::fill_n(view.depth, n, 0.0f);
    if (view.median) std::fill_n(view.median, n, 0.0f);
    if (view.normal) std::fill_n(view.normal, 3 * n, 0.0f);
}

}  // namespace
}  // namespace texgs

using namespace texgs;

int32_t texgs_cast(const texgs_volume* volume, const texgs_transfer* transfer, int32_t n, const uint8_t* distance,
                   const uint32_t* cells, const uint32_t* own, const texgs_cast_view* view, void*) {
    return guarded([&] {
        check_channels(volume, transfer, n);
        for (int c = 0; c < n; ++c) check_transfer(transfer[c]);
        check_cast(*view);
        clear(*view);
        int32_t size[3];
        const int64_t words = 2 * count_bricks(*volume, size);
        const Shown shown(distance, size);
        if (!shown.any()) return;
        const std::vector<PointTable> tables(transfer, transfer + n);
        CastJob job{*volume, *view, n, {}, distance, cells, {}, {}};
        for (int c = 0; c < n; ++c)
            job.channels[c] = {volume[c].values, volume[c].type, transfer[c].within, own ? own + c * words : nullptr,
                               tables[c].view};
        for (int a = 0; a < 3; ++a) {
            job.lower[a] = static_cast<float>(kBrick * shown.lower[a]);
            job.upper[a] = static_cast<float>(std::min(kBrick * shown.upper[a], volume->size[a] - 1));
        }
        const Frame frame = frame_of(job);
        const int64_t parts = (frame.x1 - frame.x0 + kPixels - 1) / kPixels;
        parallel_for(parts * (frame.y1 - frame.y0), 1, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i) {
                const int first = frame.x0 + static_cast<int>(i % parts) * kPixels;
                const int y = frame.y0 + static_cast<int>(i / parts);
                volume_kernels().cast(job, y, first, std::min(first + kPixels, frame.x1));
            }
        });
    });
}

int32_t texgs_volume_lookup(const texgs_volume* volume, const texgs_transfer* transfer, int64_t n, const float* points,
                            const texgs_lookup* to, void*) {
    return guarded([&] {
        check_volume(*volume);
        check_transfer(*transfer);
        const PointTable table(*transfer);
        const LookupJob job{*volume, table.view, points, *to};
        parallel_for(n, 256, [&](int64_t begin, int64_t end, int) { volume_kernels().lookup(job, begin, end); });
    });
}
