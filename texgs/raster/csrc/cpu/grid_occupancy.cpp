// SPDX-License-Identifier: Apache-2.0
// Where a sparse voxel grid can show anything: cells with a density above 0 at a corner, and how far they are away.
#include <algorithm>
#include <cstring>

#include "chebyshev.h"
#include "grid_kernels.h"
#include "memory.h"
#include "parallel.h"

namespace texgs {
namespace {

struct Blocks {
    int64_t x, y, z;
    int64_t count() const { return x * y * z; }
    int64_t at(int64_t i, int64_t j, int64_t k) const { return (i * y + j) * z + k; }
};

// Calls body(x) for every plane of blocks.
template <class Body>
void for_planes(const Blocks& blocks, const Body& body) {
    parallel_for(blocks.x, 1, [&](int64_t begin, int64_t end, int) {
        for (int64_t x = begin; x < end; ++x) body(x);
    });
}

// One bit per voxel: its density is above 0.
uint64_t dense_voxels(const texgs_grid& grid, int64_t block) {
    uint64_t dense = 0;
    const float* density = grid.density + grid.first[block];
    for (int bit = 0; bit < 64; ++bit) {
        if (!(grid.masks[block] >> bit & 1)) continue;
        dense |= uint64_t(*density > 0.0f) << bit;
        ++density;
    }
    return dense;
}

// A block of voxels moved by one towards lower x, y or z (axis 0 to 2); `next` moves in from behind.
uint64_t shifted(uint64_t block, uint64_t next, int axis) {
    constexpr int shift[3] = {16, 4, 1};
    constexpr uint64_t last[3] = {0xffff000000000000u, 0xf000f000f000f000u, 0x8888888888888888u};
    return (block >> shift[axis] & ~last[axis]) | (next << 3 * shift[axis] & last[axis]);
}

// A plane of blocks, and the same moved along an axis, in one.
void spread(const Blocks& blocks, const uint64_t* from, uint64_t* to, int64_t x, int axis) {
    for (int64_t y = 0; y < blocks.y; ++y)
        for (int64_t z = 0; z < blocks.z; ++z) {
            const int64_t nx = x + (axis == 0), ny = y + (axis == 1), nz = z + (axis == 2);
            const bool inside = nx < blocks.x && ny < blocks.y && nz < blocks.z;
            const uint64_t own = from[blocks.at(x, y, z)], next = inside ? from[blocks.at(nx, ny, nz)] : 0;
            to[blocks.at(x, y, z)] = own | shifted(own, next, axis);
        }
}

}  // namespace

void occupy(const texgs_grid& grid, uint64_t* occupied, uint8_t* distance) {
    const Blocks blocks{grid.size[0] / 4, grid.size[1] / 4, grid.size[2] / 4};
    Buffer memory;
    auto* other = memory.ensure<uint64_t>(blocks.count());
    const int64_t plane = blocks.y * blocks.z;
    for_planes(blocks, [&](int64_t x) {
        for (int64_t i = x * plane; i < (x + 1) * plane; ++i) other[i] = dense_voxels(grid, i);
    });
    for_planes(blocks, [&](int64_t x) { spread(blocks, other, occupied, x, 2); });
    for_planes(blocks, [&](int64_t x) { spread(blocks, occupied, other, x, 1); });
    for_planes(blocks, [&](int64_t x) { spread(blocks, other, occupied, x, 0); });
    for (int64_t i = 0; i < blocks.count(); ++i) distance[i] = occupied[i] ? 0 : 255;
    spread_distances({blocks.x, blocks.y, blocks.z}, distance);
}

}  // namespace texgs
