// SPDX-License-Identifier: Apache-2.0
// Volumes on GPUs: what is known of their bricks, a thread each, and rays through them, a thread each.
#include "../volume_bricks.h"
#include "chebyshev.cuh"
#include "light.cuh"
#include "workspace.cuh"

using namespace texgs;
using namespace texgs::cuda;

namespace texgs::cuda {
namespace {

constexpr int kTileX = 16, kTileY = 8;  // pixels of a block

// -- Bricks ------------------------------------------------------------------------------------------------------

template <class T>
__global__ __launch_bounds__(kThreads) void extremes_kernel(const texgs_volume volume, int64_t bricks, float* extremes,
                                                            unsigned long long* missing) {
    const int64_t i = thread_index();
    if (i >= bricks) return;
    const auto* values = static_cast<const T*>(volume.values);
    int64_t rest = i;
    int first[3], end[3];
    for (int a = 0; a < 3; ++a) {
        const int along = (volume.size[a] + TEXGS_BRICK - 2) / TEXGS_BRICK;
        first[a] = TEXGS_BRICK * static_cast<int>(rest % along);
        end[a] = first[a] + TEXGS_BRICK < volume.size[a] ? first[a] + TEXGS_BRICK + 1 : volume.size[a];
        rest /= along;
    }
    float low = INFINITY, high = -INFINITY;
    unsigned long long none = 0;
    for (int z = first[2]; z < end[2]; ++z)
        for (int y = first[1]; y < end[1]; ++y)
            for (int x = first[0]; x < end[0]; ++x) {
                const float value = static_cast<float>(values[(int64_t(z) * volume.size[1] + y) * volume.size[0] + x]);
                low = value < low ? value : low, high = value > high ? value : high;
                const int at[3] = {x, y, z};
                bool is_own =
                    value != value;  // samples on the upper faces are those of the next brick, if there is one
                for (int a = 0; a < 3; ++a) is_own &= at[a] < first[a] + TEXGS_BRICK || at[a] == volume.size[a] - 1;
                none += is_own;
            }
    extremes[2 * i] = low, extremes[2 * i + 1] = high;
    if (none) atomicAdd(missing, none);
}

__global__ __launch_bounds__(kThreads) void shown_kernel(const texgs_transfer transfer, int64_t bricks,
                                                         const float* extremes, uint8_t* shown) {
    const int64_t first = 4 * thread_index();  // bytes of one word
    for (int64_t i = first; i < first + 4 && i < bricks; ++i)
        shown[i] = shows(transfer, extremes[2 * i], extremes[2 * i + 1]) ? 0 : 255;
}

// Which cells of a word, half a brick, have extremes that are wanted.
template <class T, class IsWanted>
__device__ uint32_t cells_with(const texgs_volume& volume, int64_t word, const IsWanted& is_wanted) {
    int first[3];
    int64_t brick = word / 2;
    for (int a = 0; a < 3; ++a) {
        const int along = (volume.size[a] + TEXGS_BRICK - 2) / TEXGS_BRICK;
        first[a] = TEXGS_BRICK * static_cast<int>(brick % along);
        brick /= along;
    }
    first[2] += TEXGS_BRICK / 2 * static_cast<int>(word % 2);
    const int64_t row = volume.size[0], slice = row * volume.size[1];
    uint32_t cells = 0;
    for (int cell = 0; cell < 32; ++cell) {
        const int x = first[0] + cell % 4, y = first[1] + cell / 4 % 4, z = first[2] + cell / 16;
        if (x > volume.size[0] - 2 || y > volume.size[1] - 2 || z > volume.size[2] - 2) continue;
        const T* corner = static_cast<const T*>(volume.values) + z * slice + y * row + x;
        float low = INFINITY, high = -INFINITY;
        for (int i = 0; i < 8; ++i) {
            const float value = static_cast<float>(corner[(i & 1) + (i >> 1 & 1) * row + (i >> 2) * slice]);
            low = value < low ? value : low;
            high = value > high ? value : high;
        }
        if (is_wanted(low, high)) cells |= uint32_t(1) << cell;
    }
    return cells;
}

// In which cells of a word something may show.
template <class T>
__device__ uint32_t shown_cells(const texgs_volume& volume, const texgs_transfer& transfer, int64_t word) {
    const uint32_t cells =
        cells_with<T>(volume, word, [&](float low, float high) { return shows(transfer, low, high); });
    if (!transfer.within || !cells) return cells;
    texgs_volume mask = volume;
    mask.values = transfer.within;
    return cells & cells_with<uint8_t>(mask, word, [](float, float high) { return high >= TEXGS_INSIDE; });
}

template <class T>
__global__ __launch_bounds__(kThreads) void cells_kernel(const texgs_volume volume, const uint8_t* distance,
                                                         const texgs_transfer transfer, int64_t words,
                                                         uint32_t* cells) {
    const int64_t i = thread_index();
    if (i < words) cells[i] = distance[i / 2] ? 0 : shown_cells<T>(volume, transfer, i);
}

// -- Rays --------------------------------------------------------------------------------------------------------

// What reaches sample k of the light.
__device__ inline Exposure<float> exposed(const texgs_cast_view& view, const LightCells& cells, const CastRay& ray,
                                          float k, Vec3<float> normal, const Lamp& lamp) {
    if (!view.light) return {};
    const Vec3<float> out = outward(ray, k, normal, lamp);
    const float outs[3] = {out.x, out.y, out.z};
    float place[3];
    for (int a = 0; a < 3; ++a)
        place[a] = fma(fma(k + 0.5f, ray.step[a], ray.entry[a]), cells.scale[a],
                       fma(outs[a], cells.outset[a], cells.shift[a]));
    const Shares shares = shares_at(view.light, view.light_size, place);
    return exposure_of(view, shares.lamp, shares.sky);
}

// kMost: 1, which needs no memory for values of channels, or TEXGS_CHANNELS.
template <class T, int kMost>
__global__ __launch_bounds__(kThreads) void cast_kernel(const texgs_volume volume, const Channels channels,
                                                        const uint8_t* distance, const uint32_t* cells,
                                                        const uint32_t* own, const texgs_cast_view view,
                                                        const LightCells light_cells, int tiles) {
    const int x = static_cast<int>(blockIdx.x) % tiles * kTileX + static_cast<int>(threadIdx.x) % kTileX;
    const int y = static_cast<int>(blockIdx.x) / tiles * kTileY + static_cast<int>(threadIdx.x) / kTileX;
    if (x >= view.width || y >= view.height) return;
    const Lattice lattice = lattice_of(volume);
    const Lamp lamp = lamp_of(view);
    const CastRay ray = cast_ray(lattice, view, x, y);
    const int n = kMost == 1 ? 1 : channels.n;
    const int64_t bricks = int64_t(lattice.bricks[0]) * lattice.bricks[1] * lattice.bricks[2];
    float light = 1.0f, depth = 0.0f, median = 0.0f, color[3] = {}, normal[3] = {};
    for (int k = ray.first; k < ray.samples && light >= kOpaque;) {
        float place[3];
        int brick[3];
        for (int a = 0; a < 3; ++a) {
            place[a] = fma(static_cast<float>(k) + 0.5f, ray.step[a], ray.entry[a]);
            const int own = static_cast<int>(fmaxf(place[a], 0.0f)) / TEXGS_BRICK;
            brick[a] = own < lattice.bricks[a] ? own : lattice.bricks[a] - 1;
        }
        const int64_t row = int64_t(brick[2]) * lattice.bricks[1] + brick[1],
                      at_brick = row * lattice.bricks[0] + brick[0];
        if (const int far = distance[at_brick]) {
            k = leap(ray, k, place, brick, far);
            continue;
        }
        const Spot spot(lattice.last, place);
        if (cells && !spot.is_among(cells + 2 * at_brick, brick)) {
            ++k;
            continue;
        }
        const float at = static_cast<float>(k), z = ray.near + (at + 0.5f) * ray.z;
        const float lengths = view.step / view.opacity_unit * share(ray, at);
        float value[kMost], through[kMost], all = 0.0f;
        for (int c = 0; c < n; ++c) {
            through[c] = 0.0f;
            if (kMost > 1 && own && !spot.is_among(own + 2 * (c * bricks + at_brick), brick)) continue;
            if (!channels.has(c, spot)) continue;
            value[c] = spot.value(channels.samples<T>(c));
            through[c] = log2_through_at(channels.transfer[c], value[c], lengths);
            all += through[c];
        }
        ++k;
        if (all == 0.0f) continue;
        const float weight = light * opacity_of(all), left = light - weight;
        if (light > 0.5f && left <= 0.5f) median = z;
        light = left;
        depth += weight * z;
        for (int c = 0; c < n; ++c) {
            if (through[c] == 0.0f) continue;
            const texgs_transfer& transfer = channels.transfer[c];
            const Samples<T> samples = channels.samples<T>(c);
            const float part = weight * (through[c] / all);
            const float scale = 1.0f / (transfer.points[5 * (transfer.n - 1)] - transfer.points[0]);
            Vec3<float> slope{spot.difference(samples, 0), spot.difference(samples, 1), spot.difference(samples, 2)};
            slope.x *= static_cast<float>(lattice.per_unit[0]) * scale;
            slope.y *= static_cast<float>(lattice.per_unit[1]) * scale;
            slope.z *= static_cast<float>(lattice.per_unit[2]) * scale;
            Vec3<float> n_c = unit(slope);
            const Interval interval(transfer, value[c]);
            const Vec3<float> own{interval.column(2), interval.column(3), interval.column(4)};
            const Exposure<float> exposure = exposed(view, light_cells, ray, at, n_c, lamp);
            const Vec3<float> shown = lit(ray, at, own, n_c, lamp, exposure);
            const Vec3<float> against = turned(n_c, -along(n_c, ray.direction));
            color[0] = fma(part, shown.x, color[0]), normal[0] = fma(part, against.x, normal[0]);
            color[1] = fma(part, shown.y, color[1]), normal[1] = fma(part, against.y, normal[1]);
            color[2] = fma(part, shown.z, color[2]), normal[2] = fma(part, against.z, normal[2]);
        }
    }
    const int64_t pixel = int64_t(y) * view.width + x;
    const float alpha = 1.0f - light, per_alpha = alpha > 0.0f ? 1.0f / alpha : 0.0f;
    for (int c = 0; c < 3; ++c) view.rgba[4 * pixel + c] = color[c];
    view.rgba[4 * pixel + 3] = alpha;
    if (view.depth) view.depth[pixel] = depth * per_alpha;
    if (view.median) view.median[pixel] = median;
    if (view.normal)
        for (int c = 0; c < 3; ++c) view.normal[3 * pixel + c] = normal[c] * per_alpha;
}

// -- Points ------------------------------------------------------------------------------------------------------

template <class T>
__global__ __launch_bounds__(kThreads) void lookup_kernel(const texgs_volume volume, const texgs_transfer transfer,
                                                          int64_t n, const float* points, const texgs_lookup to) {
    const int64_t i = thread_index();
    if (i >= n) return;
    const Lattice lattice = lattice_of(volume);
    const Samples<T> samples{volume.values, volume.type, {volume.size[0], volume.size[1], volume.size[2]}};
    float at[3];
    for (int a = 0; a < 3; ++a)
        at[a] = fma(points[3 * i + a], static_cast<float>(lattice.per_unit[a]), static_cast<float>(lattice.middle[a]));
    const Spot spot(lattice.last, at);
    const float value = spot.value(samples), low = transfer.points[0], high = transfer.points[5 * (transfer.n - 1)];
    if (to.values) to.values[i] = value;
    if (to.colors) {
        const Interval interval(transfer, fminf(fmaxf(value, low), high));
        for (int c = 0; c < 3; ++c) to.colors[3 * i + c] = interval.column(2 + c);
    }
    if (!to.gradients && !to.quats) return;
    float gradient[3];
    for (int a = 0; a < 3; ++a) {
        gradient[a] = spot.difference(samples, a) * static_cast<float>(0.5 * lattice.per_unit[a]);
        if (to.gradients) to.gradients[3 * i + a] = gradient[a];
    }
    if (!to.quats) return;
    const float scale = 1.0f / (high - low);
    const Vec3<float> normal = unit(Vec3<float>{gradient[0] * scale, gradient[1] * scale, gradient[2] * scale});
    float quat[4];
    turn_z_to(normal, quat);
    for (int k = 0; k < 4; ++k) to.quats[4 * i + k] = quat[k];
}

}  // namespace
}  // namespace texgs::cuda

int64_t texgs_volume_bricks(const texgs_volume* volume, int32_t size[3]) { return count_bricks(*volume, size); }

int32_t texgs_volume_extremes(const texgs_volume* volume, float* extremes, int64_t* missing, void* on) {
    return on_device_of(extremes, on, [&](cudaStream_t stream) {
        check_volume(*volume);
        int32_t size[3];
        const int64_t bricks = count_bricks(*volume, size);
        check(cudaMemsetAsync(missing, 0, sizeof(*missing), stream), "clearing a count");
        auto* count = reinterpret_cast<unsigned long long*>(missing);
        with_type(volume->type, [&](auto sample) {
            launch(extremes_kernel<decltype(sample)>, blocks_for(bricks, kThreads), kThreads, stream, *volume, bricks,
                   extremes, count);
        });
    });
}

int32_t texgs_volume_distance(const texgs_volume* volume, const float* extremes, const texgs_transfer* transfer,
                              uint8_t* distance, void* on) {
    return with_workspace(extremes, on, [&](Workspace& workspace, cudaStream_t stream) {
        check_volume(*volume);
        check_points(*transfer);
        int32_t size[3];
        const int64_t bricks = count_bricks(*volume, size);
        auto* shown = reinterpret_cast<uint8_t*>(workspace.planes.ensure<uint32_t>(blocks_for(bricks, 4)));
        launch(shown_kernel, blocks_for(bricks, 4 * kThreads), kThreads, stream, *transfer, bricks, extremes, shown);
        spread_distances({size[2], size[1], size[0]}, shown, distance, stream);
    });
}

int32_t texgs_volume_cells(const texgs_volume* volume, const uint8_t* distance, const texgs_transfer* transfer,
                           uint32_t* cells, void* on) {
    return on_device_of(cells, on, [&](cudaStream_t stream) {
        check_volume(*volume);
        check_points(*transfer);
        int32_t size[3];
        const int64_t words = 2 * count_bricks(*volume, size);
        with_type(volume->type, [&](auto sample) {
            launch(cells_kernel<decltype(sample)>, blocks_for(words, kThreads), kThreads, stream, *volume, distance,
                   *transfer, words, cells);
        });
    });
}

int32_t texgs_cast(const texgs_volume* volume, const texgs_transfer* transfer, int32_t n, const uint8_t* distance,
                   const uint32_t* cells, const uint32_t* own, const texgs_cast_view* view, void* on) {
    return on_device_of(view->rgba, on, [&](cudaStream_t stream) {
        check_channels(volume, transfer, n);
        check_cast(*view);
        const Channels channels(volume, transfer, n);
        const LightCells light_cells = light_cells_of(lattice_of(*volume), *view);
        const int tiles = (view->width + kTileX - 1) / kTileX, rows = (view->height + kTileY - 1) / kTileY;
        with_type_of(volume, n, [&](auto sample) {
            const auto kernel =
                n == 1 ? cast_kernel<decltype(sample), 1> : cast_kernel<decltype(sample), TEXGS_CHANNELS>;
            launch(kernel, int64_t(tiles) * rows, kThreads, stream, *volume, channels, distance, cells, own, *view,
                   light_cells, tiles);
        });
    });
}

int32_t texgs_volume_lookup(const texgs_volume* volume, const texgs_transfer* transfer, int64_t n, const float* points,
                            const texgs_lookup* to, void* on) {
    return on_device_of(points, on, [&](cudaStream_t stream) {
        check_volume(*volume);
        check_points(*transfer);
        with_type(volume->type, [&](auto sample) {
            launch(lookup_kernel<decltype(sample)>, blocks_for(n, kThreads), kThreads, stream, *volume, *transfer, n,
                   points, *to);
        });
    });
}
