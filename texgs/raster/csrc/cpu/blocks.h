// SPDX-License-Identifier: Apache-2.0
// Blocks: the unit of culling and of vector work. A square of 4x4 pixels, or, where vectors are shorter, its upper or
// lower half: of that, fewer pixels lie outside of a surfel.
#pragma once
#include "kernels.h"
#include "simd.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kBlockPixels = kLanes < kSquarePixels ? kSquarePixels / 2 : kSquarePixels;
constexpr int kBlocks = kTilePixels / kBlockPixels;    // per tile, a bit of a mask each
constexpr int kHalves = kSquarePixels / kBlockPixels;  // blocks in a square
constexpr int kBlocksDown = kBlocks / 4;               // across there are four
constexpr int kParts = kBlockPixels / kLanes;          // vectors in a block
static_assert(kBlocks <= 32);

// Where a block begins in its tile, in pixels, and which block a pixel is in. Squares are numbered row by row, halves
// of them column by column: then a vector holds a row or a column.
inline int block_column(int block) { return 4 * (kHalves == 1 ? block % 4 : block / kBlocksDown); }
inline int block_row(int block) { return kHalves == 1 ? block / 4 * 4 : block % kBlocksDown * 2; }
TEXGS_INLINE int block_of(int x, int y) { return kHalves == 1 ? y / 4 * 4 + x / 4 : x / 4 * kBlocksDown + y / 2; }

// Blocks of squares, one bit each.
TEXGS_INLINE uint32_t blocks_of(uint32_t squares) {
    if constexpr (kHalves == 1) return squares;
    const auto swap = [&](int places, uint32_t which) {
        const uint32_t differ = (squares ^ squares >> places) & which;
        squares ^= differ ^ differ << places;
    };
    swap(3, 0x0a0a), swap(6, 0x00cc);                 // rows become columns
    squares = (squares | squares << 8) & 0x00ff00ff;  // a zero between any two bits
    squares = (squares | squares << 4) & 0x0f0f0f0f;
    squares = (squares | squares << 2) & 0x33333333;
    squares = (squares | squares << 1) & 0x55555555;
    return squares | squares << 1;
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
