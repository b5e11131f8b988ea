// SPDX-License-Identifier: Apache-2.0
#include "frame.cuh"

#include <algorithm>
#include <bit>

#include "../status.h"

using namespace texgs::cuda;
using texgs::OutOfMemory;

namespace {

constexpr int64_t kMostPairs = (int64_t(1) << 32) - 1;  // slots have 32 bits

void zero(void* data, int64_t bytes, cudaStream_t stream) {
    if (bytes) check(cudaMemsetAsync(data, 0, static_cast<size_t>(bytes), stream), "clearing memory");
}

}  // namespace

void texgs_frame::attach(const texgs_surfels& surfels, const texgs_camera& camera, const texgs_options& options) {
    raster.surfels = surfels;
    raster.camera = camera;
    raster.options = options;
    raster.image = raster.grad = {};
    raster.out = {};
    raster.contributions = {};
}

void* texgs_frame::sort_scratch(int64_t n) { return scratch_.ensure<char>(static_cast<int64_t>(sort_bytes(n))); }

// Records, footprints, and the surfels in order of depth; culled ones come last.
void texgs_frame::project(cudaStream_t stream) {
    const int64_t n = raster.surfels.n;
    raster.records = records_.ensure<Record>(n);
    raster.footprints = footprints_.ensure<Footprint>(n);
    raster.normals = raster.with_normal ? normals_.ensure<float>(3 * n) : nullptr;
    raster.depth_keys = keys_.ensure<uint32_t>(n);
    PingPong keys{raster.depth_keys, keys2_.ensure<uint32_t>(n)};
    PingPong order{order_.ensure<uint32_t>(n), order2_.ensure<uint32_t>(n)};
    raster.order = order.current;
    texgs::cuda::project(raster, stream);
    if (n) sort_pairs(keys, order, n, 32, sort_scratch(n), stream);
    raster.order = order.current;
}

void texgs_frame::count_pairs(cudaStream_t stream) {
    const int64_t n = raster.surfels.n;
    raster.pair_begin = pair_begin_.ensure<uint64_t>(n + 1);
    texgs::cuda::count_pairs(raster, stream);
    void* scratch = scratch_.ensure<char>(static_cast<int64_t>(prefix_sums_bytes(n + 1)));
    prefix_sums(raster.pair_begin, n + 1, scratch, stream);
    n_pairs_.fetch(raster.pair_begin + n, stream);
}

// Room for the pairs of this view, as far as they are known (with `wait`: exactly), and a quarter more. What was seen
// of earlier views counts for those that are not larger, until memory is trimmed: sizes change from view to view where
// views are cropped to their content, and to wait each time would cost more than room that is not used.
int64_t texgs_frame::room_for_pairs(bool wait) {
    const int64_t n = raster.surfels.n;
    const bool larger = 4 * n > 5 * most_surfels_ || raster.tiles > most_tiles_;
    if (wait || larger) {
        most_pairs_ = std::max(most_pairs_, n_pairs_.wait());
        most_surfels_ = std::max(most_surfels_, n), most_tiles_ = std::max<int64_t>(most_tiles_, raster.tiles);
    }
    if (most_pairs_ > kMostPairs) throw OutOfMemory{most_pairs_ * int64_t(sizeof(Listed) + 4 * sizeof(uint32_t))};
    return std::clamp<int64_t>(most_pairs_ + most_pairs_ / 4, 1024, kMostPairs);
}

// Lists the pairs that `capacity` slots can hold, tile by tile in order of depth.
void texgs_frame::list_pairs(int64_t capacity, cudaStream_t stream) {
    raster.capacity = capacity;
    raster.listed = listed_.ensure<Listed>(capacity);
    PingPong tiles{tiles_.ensure<uint32_t>(capacity), tiles2_.ensure<uint32_t>(capacity)};
    PingPong slots{tile_slots_.ensure<uint32_t>(capacity), tile_slots2_.ensure<uint32_t>(capacity)};
    // Places without a pair sort behind all tiles.
    check(cudaMemsetAsync(tiles.current, 0xff, capacity * sizeof(uint32_t), stream), "clearing memory");
    texgs::cuda::list_pairs(raster, tiles.current, slots.current, stream);
    sort_pairs(tiles, slots, capacity, std::bit_width(static_cast<unsigned>(raster.tiles)), sort_scratch(capacity),
               stream);
    uint32_t* tile_begin = tile_begin_.ensure<uint32_t>(raster.tiles + 1);
    find_tiles(tiles.current, capacity, raster.tiles, tile_begin, stream);
    raster.tile_slots = slots.current;
    raster.tile_begin = tile_begin;

    const int64_t n = raster.tiles;
    PingPong keys{tile_keys_.ensure<uint32_t>(n), tile_keys2_.ensure<uint32_t>(n)};
    PingPong order{tile_order_.ensure<uint32_t>(n), tile_order2_.ensure<uint32_t>(n)};
    key_tiles(raster, keys.current, order.current, stream);
    sort_pairs(keys, order, n, 32, sort_scratch(n), stream);
    raster.tile_order = order.current;
}

void texgs_frame::list_all_pairs(cudaStream_t stream) {
    const int64_t needed = n_pairs_.wait();
    if (needed > raster.capacity) list_pairs(room_for_pairs(true), stream);
}

void texgs_frame::bin(const texgs_surfels& surfels, const texgs_camera& camera, const texgs_options& options,
                      const texgs_image& image, cudaStream_t stream) {
    if (n_pairs_.arrived()) most_pairs_ = std::max(most_pairs_, n_pairs_.wait());
    raster = {};
    attach(surfels, camera, options);
    raster.image = image;
    raster.tiles_x = (camera.width + kTile - 1) / kTile;
    raster.tiles = raster.tiles_x * ((camera.height + kTile - 1) / kTile);
    raster.plane = int64_t(camera.width) * camera.height;
    raster.with_normal = image.normal != nullptr;
    raster.with_depth = image.depth || image.median || image.distortion;
    project(stream);
    count_pairs(stream);
    list_pairs(room_for_pairs(false), stream);
}

void texgs_frame::render(cudaStream_t stream) {
    raster.median_surfel = raster.image.median ? median_.ensure<int32_t>(raster.plane) : nullptr;
    raster.distortion_moments = raster.image.distortion ? moments_.ensure<float>(3 * raster.plane) : nullptr;
    texgs::cuda::forward(raster, stream);
}

void texgs_frame::slots(int width) {
    raster.slot_width = width;
    raster.slots = slots_.ensure<float>(raster.capacity * width);
    raster.sums = sums_.ensure<float>(raster.surfels.n * width);
}

void texgs_frame::differentiate(const texgs_image& image, const texgs_image& grad, const texgs_gradients& out,
                                cudaStream_t stream) {
    list_all_pairs(stream);
    raster.image = image, raster.grad = grad, raster.out = out;
    raster.geometry = out.means || out.quats || out.scales || out.opacities || out.shift;
    if (raster.geometry || out.features || out.base || out.gain) {
        slots(backward_slot_width(raster));
        texgs::cuda::backward(raster, stream);
        sum_slots(raster, -1, stream);
        surfel_gradients(raster, stream);
    }
    if (out.texels) texel_gradients(stream);
}

void texgs_frame::texel_gradients(cudaStream_t stream) {
    const int64_t floats = 3 * raster.surfels.n_texels;
    if (!raster.grad.color) return zero(raster.out.texels, floats * static_cast<int64_t>(sizeof(float)), stream);
    raster.texel_sums = texel_sums_.ensure<int64_t>(floats);
    uint32_t* magnitudes = magnitudes_.ensure<uint32_t>(2);
    raster.magnitudes = magnitudes;
    zero(raster.texel_sums, floats * static_cast<int64_t>(sizeof(int64_t)), stream);
    zero(magnitudes, 2 * sizeof *magnitudes, stream);
    largest_magnitude(raster.grad.color, 3 * raster.plane, false, magnitudes, stream);
    largest_magnitude(raster.surfels.gain, raster.surfels.n, true, magnitudes + 1, stream);
    texgs::cuda::texel_gradients(raster, stream);
}

void texgs_frame::contribute(const texgs_contributions& out, cudaStream_t stream) {
    list_all_pairs(stream);
    raster.contributions = out;
    if (!out.image) raster.contributions.channels = 0;
    slots(contribute_slot_width(raster));
    texgs::cuda::contribute(raster, stream);
}
