// SPDX-License-Identifier: Apache-2.0
// Convolutions on CPUs: batches of tiles in parallel, each computed by one worker.
#include <algorithm>

#include "../status.h"
#include "convolution_kernels.h"
#include "dispatch.h"
#include "memory.h"
#include "parallel.h"

namespace texgs {
namespace {

constexpr int32_t kMostChannels = 4096;
constexpr int64_t kMostTiles = INT32_MAX;
constexpr int64_t kLeastBatch = 24, kMostBatch = 96, kPairsPerTile = 680;  // by measurement

auto convolve_kernel() {
#if defined(__x86_64__) || defined(_M_X64)
    if (active_isa() == Isa::avx512) return avx512::convolve_tiles;
    if (active_isa() == Isa::avx2) return avx2::convolve_tiles;
#endif
    return portable::convolve_tiles;
}

bool are_blocks(int32_t channels) {
    return channels >= kChannelBlock && channels <= kMostChannels && channels % kChannelBlock == 0;
}

// Tiles to a batch: few, so that their points stay in the caches; but each batch reads the whole kernel, which for many
// channels is larger than they are. Threads get equal shares.
int batch_of(const ConvolutionJob& job) {
    const int64_t kernel = int64_t(job.shape.inputs) * job.shape.outputs, tiles = job.tiles(), team = threads();
    const int64_t wanted = std::clamp(kernel / kPairsPerTile, kLeastBatch, kMostBatch);
    const int64_t rounds = std::max<int64_t>(1, (tiles + wanted * team / 2) / (wanted * team));
    const int64_t share = (tiles + rounds * team - 1) / (rounds * team);
    return static_cast<int>((share + kTileRows - 1) / kTileRows * kTileRows);
}

}  // namespace
}  // namespace texgs

using namespace texgs;

int32_t texgs_convolve(const texgs_convolution* shape, const float* image, const float* gate, float* result, void*) {
    return guarded([&] {
        require(shape->width >= 1 && shape->height >= 1, "image: expected at least one pixel");
        require(shape->width <= TEXGS_MAX_SIDE && shape->height <= TEXGS_MAX_SIDE, "image: too large");
        require(are_blocks(shape->inputs) && are_blocks(shape->outputs),
                "channels: expected multiples of 16 up to 4096");
        require(reinterpret_cast<uintptr_t>(result) % 64 == 0, "result: expected an address that 64 divides");
        ConvolutionJob job{*shape, image, gate, result, 0};
        require(job.tiles() < kMostTiles, "image: too large");
        job.batch = batch_of(job);
        const int64_t tiles = job.tiles(), batches = (tiles + job.batch - 1) / job.batch;
        Buffer memory;
        float* scratch = memory.ensure<float>(threads() * job.scratch());
        const auto kernel = convolve_kernel();
        parallel_for(batches, 1, [&](int64_t first, int64_t last, int worker) {
            for (int64_t i = first; i < last; ++i)
                kernel(job, static_cast<int>(i * job.batch), static_cast<int>(std::min((i + 1) * job.batch, tiles)),
                       scratch + worker * job.scratch());
        });
    });
}
