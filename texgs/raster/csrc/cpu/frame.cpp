// SPDX-License-Identifier: Apache-2.0
#include "frame.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <limits>

#include "../slot.h"
#include "../status.h"
#include "parallel.h"

using namespace texgs;

namespace {

constexpr int64_t kSurfelGrain = 1024;
constexpr int64_t kMostPairs = UINT32_MAX;  // they are counted in 32 bits

thread_local double pass_seconds[TEXGS_PASSES];

// Adds up how long its scopes of a frame took.
class PassTimer {
public:
    explicit PassTimer(texgs_pass pass) : pass_(pass) {}
    ~PassTimer() {
        pass_seconds[pass_] += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

private:
    texgs_pass pass_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

int tiles_of(const Raster& r) { return r.tiles_x * r.tiles_y; }

// Zeros `bytes` of memory, which costs as much as any other pass where it is fresh.
void clear(void* memory, int64_t bytes) {
    parallel_for(bytes, int64_t(1) << 18, [&](int64_t begin, int64_t end, int) {
        std::memset(static_cast<char*>(memory) + begin, 0, static_cast<size_t>(end - begin));
    });
}

// The smallest and the largest depth that counts in each square of a tile: none does outside of the image, nor where
// the range of a pixel is empty.
void square_ranges(const Raster& r, int tile, float* nearest) {
    float* farthest = nearest + kSquares;
    std::fill_n(nearest, kSquares, std::numeric_limits<float>::infinity());
    std::fill_n(farthest, kSquares, -std::numeric_limits<float>::infinity());
    const int width = r.camera.width, left = tile % r.tiles_x * kTile, top = tile / r.tiles_x * kTile;
    const int columns = std::min(kTile, width - left), rows = std::min(kTile, r.camera.height - top);
    for (int y = 0; y < rows; ++y) {
        const float* near = r.camera.depth_range + int64_t(top + y) * width + left;
        const float* far = near + int64_t(width) * r.camera.height;
        for (int x = 0; x < columns; ++x) {
            const int square = y / 4 * 4 + x / 4;
            if (!(near[x] < far[x])) continue;
            nearest[square] = std::min(nearest[square], near[x]);
            farthest[square] = std::max(farthest[square], far[x]);
        }
    }
}

// Exclusive prefix sums of n counts, with the total at the end.
uint32_t* accumulate(const uint32_t* counts, int64_t n, uint32_t* begin) {
    uint32_t total = 0;
    for (int64_t i = 0; i < n; ++i) {
        begin[i] = total;
        total += counts[i];
    }
    begin[n] = total;
    return begin;
}

}  // namespace

void texgs_pass_seconds(double seconds[TEXGS_PASSES]) { std::copy(pass_seconds, pass_seconds + TEXGS_PASSES, seconds); }

void texgs_frame::attach(const texgs_surfels& surfels, const texgs_camera& camera, const texgs_options& options) {
    raster.surfels = surfels;
    raster.camera = camera;
    raster.options = options;
    raster.image = raster.grad = {};
    raster.out = {};
    raster.contributions = {};
}

// Returns the number of tiles in all bounding boxes.
int64_t texgs_frame::project() {
    const PassTimer timer(TEXGS_PROJECT);
    const int64_t n = raster.surfels.n;
    raster.records = records_.ensure<Record>(n);
    raster.footprints = footprints_.ensure<Footprint>(n);
    raster.flags = flags_.ensure<uint8_t>(n);
    raster.normals = raster.with_normal ? normals_.ensure<float>(3 * n) : nullptr;
    raster.depth_keys = keys_.ensure<uint32_t>(n);
    std::atomic<int64_t> candidates{0};
    parallel_for(n, kSurfelGrain, [&](int64_t begin, int64_t end, int) {
        kernels().project(raster, begin, end);
        int64_t tiles = 0;
        for (int64_t i = begin; i < end; ++i) {
            const Footprint& f = raster.footprints[i];
            tiles += int64_t(f.x1 - f.x0) * (f.y1 - f.y0);
        }
        candidates += tiles;
    });
    return candidates;
}

// Finds the depths that count in each square, where there are ranges of them.
void texgs_frame::bound_depths() {
    if (!raster.camera.depth_range) return;
    float* ranges = square_ranges_.ensure<float>(int64_t(tiles_of(raster)) * 2 * kSquares);
    parallel_for(tiles_of(raster), 16, [&](int64_t begin, int64_t end, int) {
        for (int64_t tile = begin; tile < end; ++tile)
            square_ranges(raster, static_cast<int>(tile), ranges + tile * 2 * kSquares);
    });
    raster.square_ranges = ranges;
}

// A stable counting sort of the depth-ordered surfels into tiles. Each part of the order lists and counts its own
// candidates; offsets per (tile, part) then tell where they go, whatever the number of parts.
void texgs_frame::bin_tiles(const uint32_t* order, int64_t visible, int64_t most_candidates) {
    const PassTimer timer(TEXGS_BIN);
    const int tiles = tiles_of(raster);
    const int64_t n = raster.surfels.n;
    const int parts = static_cast<int>(std::clamp<int64_t>(visible / 4096, 1, 2 * threads()));
    if (most_candidates > kMostPairs) throw OutOfMemory{most_candidates * int64_t(sizeof(Candidate) + sizeof(Pair))};
    // A part writes one candidate past its last.
    Candidate* candidates = candidates_.ensure<Candidate>(most_candidates + parts);
    Candidate** part_begin = part_begin_.ensure<Candidate*>(2 * parts);
    Candidate** part_end = part_begin + parts;
    uint32_t* per_tile = per_tile_.ensure<uint32_t>(int64_t(parts) * tiles);
    uint32_t* per_surfel = per_surfel_.ensure<uint32_t>(n);
    std::memset(per_surfel, 0, n * sizeof *per_surfel);
    std::memset(per_tile, 0, int64_t(parts) * tiles * sizeof *per_tile);

    std::atomic<int64_t> reserved{0};
    parallel_for(parts, 1, [&](int64_t p, int64_t, int) {
        const int64_t begin = visible * p / parts, end = visible * (p + 1) / parts;
        int64_t most = 1;
        for (int64_t i = begin; i < end; ++i) {
            const Footprint& f = raster.footprints[order[i]];
            most += int64_t(f.x1 - f.x0) * (f.y1 - f.y0);
        }
        part_begin[p] = candidates + reserved.fetch_add(most);
        part_end[p] =
            part_begin[p] + kernels().bin(raster, order, begin, end, part_begin[p], per_tile + p * tiles, per_surfel);
    });

    uint32_t* tile_begin = tile_begin_.ensure<uint32_t>(tiles + 1);
    uint32_t next = 0;
    for (int t = 0; t < tiles; ++t) {
        tile_begin[t] = next;
        for (int p = 0; p < parts; ++p) {
            const uint32_t count = per_tile[int64_t(p) * tiles + t];
            per_tile[int64_t(p) * tiles + t] = next;
            next += count;
        }
    }
    tile_begin[tiles] = next;
    pairs = next;
    const uint32_t* slot_begin = accumulate(per_surfel, n, slot_begin_.ensure<uint32_t>(n + 1));
    Pair* out = pairs_.ensure<Pair>(pairs);
    parallel_for(parts, 1, [&](int64_t p, int64_t, int) {
        uint32_t* at = per_tile + p * tiles;
        for (const Candidate* c = part_begin[p]; c != part_end[p]; ++c)
            out[at[c->tile]++] = {c->surfel, slot_begin[c->surfel] + c->rank, c->mask};
    });
    raster.tile_begin = tile_begin;
    raster.slot_begin = slot_begin;
    raster.pairs = out;
}

const uint32_t* texgs_frame::sort(int64_t& visible) {
    const PassTimer timer(TEXGS_SORT);
    return sort_.run(raster.depth_keys, raster.surfels.n, visible);
}

void texgs_frame::bin(const texgs_surfels& surfels, const texgs_camera& camera, const texgs_options& options,
                      const texgs_image& image) {
    std::fill(pass_seconds, pass_seconds + TEXGS_PASSES, 0.0);
    raster = {};
    attach(surfels, camera, options);
    raster.image = image;
    raster.tiles_x = (camera.width + kTile - 1) / kTile;
    raster.tiles_y = (camera.height + kTile - 1) / kTile;
    raster.with_normal = image.normal != nullptr;
    raster.with_depth = image.depth || image.median || image.distortion;
    raster.channels = surfels.channels + (raster.with_normal ? 3 : 0);
    const int64_t candidates = project();
    int64_t visible = 0;
    const uint32_t* order = sort(visible);
    bound_depths();
    bin_tiles(order, visible, candidates);
}

// Runs kernel(tile, scratch, worker) on every tile.
template <class Kernel>
void texgs_frame::for_tiles(Kernel kernel) {
    const int64_t scratch_bytes = (kernels().scratch_bytes() + 4095) / 4096 * 4096;
    char* scratch = scratch_.ensure<char>(scratch_bytes * threads());
    // A few neighbours at a time: kernels prefetch what the next tile needs.
    const int64_t grain = std::clamp<int64_t>(tiles_of(raster) / (16 * threads()), 1, 8);
    parallel_for(tiles_of(raster), grain, [&](int64_t begin, int64_t end, int worker) {
        for (int64_t tile = begin; tile < end; ++tile)
            kernel(static_cast<int>(tile), scratch + scratch_bytes * worker, worker);
    });
}

void texgs_frame::render() {
    const PassTimer timer(TEXGS_FORWARD);
    const int64_t pixels = int64_t(tiles_of(raster)) * kTilePixels;
    raster.median_stop = raster.image.median ? median_stop_.ensure<float>(pixels) : nullptr;
    raster.distortion_moments = raster.image.distortion ? moments_.ensure<float>(3 * pixels) : nullptr;
    for_tiles([&](int tile, void* scratch, int) { kernels().forward(raster, tile, scratch); });
}

template <class Kernel>
void texgs_frame::backward_pass(Kernel kernel) {
    const PassTimer timer(TEXGS_BACKWARD);
    for_tiles(kernel);
}
template <class Kernel>
void texgs_frame::reduce_pass(Kernel kernel) {
    const PassTimer timer(TEXGS_REDUCE);
    parallel_for(raster.surfels.n, kSurfelGrain, kernel);
}

void texgs_frame::ensure_slots(int floats) {
    raster.slot_stride = (floats + kSlotAlign - 1) / kSlotAlign * kSlotAlign;
    raster.slots = slots_.ensure<float>(pairs * raster.slot_stride);
}

void texgs_frame::differentiate(const texgs_image& image, const texgs_image& grad, const texgs_gradients& out) {
    pass_seconds[TEXGS_BACKWARD] = pass_seconds[TEXGS_REDUCE] = 0;
    raster.image = image;
    raster.grad = grad;
    raster.out = out;
    const bool geometry = out.means || out.quats || out.scales || out.opacities || out.shift;
    if (geometry) geometry_gradients();
    if (!geometry && out.features) feature_gradients();
    if (out.base || out.gain || out.texels) texture_gradients();
}

void texgs_frame::geometry_gradients() {
    const bool depth = raster.grad.depth || raster.grad.median || raster.grad.distortion;
    ensure_slots(first_channel(raster.surfels.axes, depth) + raster.channels);
    backward_pass([&](int tile, void* scratch, int) { kernels().backward(raster, tile, scratch); });
    reduce_pass([&](int64_t begin, int64_t end, int) { kernels().reduce(raster, begin, end); });
}

// With the geometry frozen, features are what the gradient image splats onto.
void texgs_frame::feature_gradients() {
    const int textured = raster.surfels.base ? 3 : 0, channels = raster.surfels.channels - textured;
    if (!raster.grad.color) {
        std::memset(raster.out.features, 0, raster.surfels.n * channels * sizeof(float));
        return;
    }
    contribute({.image = raster.grad.color + int64_t(textured) * raster.camera.width * raster.camera.height,
                .channels = channels,
                .sums = raster.out.features,
                .weight_sum = nullptr,
                .weight_max = nullptr,
                .pixels = nullptr});
}

void texgs_frame::contribute(const texgs_contributions& out) {
    raster.contributions = out;
    if (!out.image) raster.contributions.channels = 0;
    ensure_slots(ContributionSums::kChannels + raster.contributions.channels);
    backward_pass([&](int tile, void* scratch, int) { kernels().contribute(raster, tile, scratch); });
    reduce_pass([&](int64_t begin, int64_t end, int) { kernels().reduce_contributions(raster, begin, end); });
}

void texgs_frame::texture_gradients() {
    const int64_t n = raster.surfels.n, pixels = int64_t(raster.camera.width) * raster.camera.height;
    if (!raster.grad.color) {
        float* zeros = zeros_.ensure<float>(3 * pixels);
        std::memset(zeros, 0, 3 * pixels * sizeof(float));
        raster.grad.color = zeros;
    }
    raster.texel_parts = texel_parts_.ensure<TexelPart>(pairs);
    clear(raster.texel_parts, pairs * sizeof(TexelPart));
    while (arenas_.size() < static_cast<size_t>(threads())) arenas_.push_back(std::make_unique<BlockArena>());
    for (auto& arena : arenas_) arena->restart();
    backward_pass([&](int tile, void* scratch, int worker) {
        kernels().texture_backward(raster, tile, scratch, *arenas_[worker]);
    });
    for (const auto& arena : arenas_)
        if (arena->missing) throw OutOfMemory{arena->missing};

    int64_t largest = 0, all = 0;
    for (int64_t i = 0; i < n; ++i) {
        const int64_t texels = int64_t(raster.surfels.sizes[2 * i]) * raster.surfels.sizes[2 * i + 1];
        largest = std::max(largest, texels), all += texels;
    }
    if (raster.out.texels && all < raster.surfels.n_texels)  // some texels belong to no surfel
        clear(raster.out.texels, 3 * raster.surfels.n_texels * sizeof(float));
    // where nobody asked for texels, a worker needs room for the sums of one texture
    if (raster.out.texels) largest = 0;
    float* sums = slots_.ensure<float>(3 * largest * threads());
    reduce_pass([&](int64_t begin, int64_t end, int worker) {
        kernels().reduce_textures(raster, begin, end, sums + 3 * largest * worker);
    });
}
