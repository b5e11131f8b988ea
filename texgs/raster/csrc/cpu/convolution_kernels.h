// SPDX-License-Identifier: Apache-2.0
// What convolution.cpp hands to the kernels of an instruction set.
#pragma once
#include <cstdint>

#include "../texgs_neural.h"

namespace texgs {

constexpr int kPoints = 36;        // of a tile after its transform: 6 x 6
constexpr int kTileRows = 12;      // divides the number of tiles of a batch
constexpr int kChannelBlock = 16;  // channels that lie side by side

struct ConvolutionJob {
    texgs_convolution shape;
    const float *image, *gate;
    float* result;
    int batch;  // tiles that go through the three steps together, a multiple of kTileRows

    int tiles_across() const { return (shape.width + 3) / 4; }
    int64_t tiles() const { return int64_t(tiles_across()) * ((shape.height + 3) / 4); }
    // Floats between the points of a batch. A whole number of pages would map all of them to the same cache lines.
    int64_t input_stride() const { return int64_t(shape.inputs) * batch + kChannelBlock; }
    int64_t output_stride() const { return int64_t(shape.outputs) * batch + kChannelBlock; }
    // Where a channel of a tile is among those of a point.
    int64_t place(int tile, int channel) const {
        return (int64_t(channel / kChannelBlock) * batch + tile) * kChannelBlock + channel % kChannelBlock;
    }
    // Floats of memory that a batch works in: its points before and after the product.
    int64_t scratch() const { return kPoints * (input_stride() + output_stride()); }
};

// One function per instruction set, each in winograd.cpp: tiles [begin, end), at most a batch.
namespace portable {
void convolve_tiles(const ConvolutionJob&, int begin, int end, float* scratch);
}
namespace avx2 {
void convolve_tiles(const ConvolutionJob&, int begin, int end, float* scratch);
}
namespace avx512 {
void convolve_tiles(const ConvolutionJob&, int begin, int end, float* scratch);
}

}  // namespace texgs
