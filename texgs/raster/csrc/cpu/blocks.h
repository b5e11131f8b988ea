// SPDX-License-Identifier: Apache-2.0
// Blocks: the unit of culling and of vector work. A square of 4x4 pixels, or, where vectors are shorter, its upper or
// lower half: of that, fewer pixels lie outside of a surfel.
#pragma once
#include "kernels.h"
#include "simd.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kBlockPixels = kLanes < kSquarePixels ? kSquarePixels / 2 : kSquarePixels;
constexpr int kBlocks = kTilePixels / kBlockPixels;  // per tile, a bit of a mask each
constexpr int kHalves = kSquarePixels / kBlockPixels;  // blocks in a square
constexpr int kParts = kBlockPixels / kLanes;          // vectors in a block
static_assert(kBlocks <= 32);

// Where a block begins in its tile, in pixels. Blocks are numbered square by square, as planes of pixels are stored.
inline int block_column(int block) { return block / kHalves % 4 * 4; }
inline int block_row(int block) { return block / kHalves / 4 * 4 + block % kHalves * 2; }

// Blocks of squares, one bit each.
TEXGS_INLINE uint32_t blocks_of(uint32_t squares) {
    if constexpr (kHalves == 1) return squares;
    squares = (squares | squares << 8) & 0x00ff00ff;  // a zero between any two bits
    squares = (squares | squares << 4) & 0x0f0f0f0f;
    squares = (squares | squares << 2) & 0x33333333;
    squares = (squares | squares << 1) & 0x55555555;
    return squares | squares << 1;
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
