// SPDX-License-Identifier: Apache-2.0
// What volume.cpp hands to the kernels of an instruction set, the table of those kernels, and what it shares with
// bricks.cpp.
#pragma once
#include <cstdint>

#include "../texgs_volume.h"

namespace texgs {

// Points of a transfer function, one array for each number, with the width of the interval behind each. The arrays
// are as long as a power of two, at least kTablePoints; values of points behind the last are infinite.
constexpr int kTablePoints = 16;
struct CastTable {
    int32_t n, length;
    const float *value, *per_width, *opacity, *color[3];
};

// Refuses transfer functions whose values do not ascend.
void check_transfer(const texgs_transfer&);

// A volume as its transfer function shows it.
struct CastChannel {
    const void* values;
    int32_t type;
    const uint8_t* within;  // mask, or NULL
    const uint32_t* cells;  // [bricks, 2] its own, or NULL
    CastTable table;
};

struct CastJob {
    texgs_volume volume;  // the first; others have its lattice
    texgs_cast_view view;
    int32_t n;
    CastChannel channels[TEXGS_CHANNELS];
    const uint8_t* distance;   // [bricks]
    const uint32_t* cells;     // [bricks, 2] of any channel, or NULL
    float lower[3], upper[3];  // corners of a box that holds all bricks in which something shows, in samples
};

struct LookupJob {
    texgs_volume volume;
    CastTable table;
    const float* points;  // [n, 3]
    texgs_lookup to;
};

struct VolumeKernels {
    // Casts the rays of the pixels [begin, end) of row y.
    void (*cast)(const CastJob&, int y, int begin, int end);
    // Looks the points [begin, end) up.
    void (*lookup)(const LookupJob&, int64_t begin, int64_t end);
};

// One table per instruction set, each in cast.cpp, and what stands in it besides.
namespace portable {
extern const VolumeKernels kVolumeKernels;
void lookup(const LookupJob&, int64_t begin, int64_t end);
}  // namespace portable
namespace avx2 {
extern const VolumeKernels kVolumeKernels;
void lookup(const LookupJob&, int64_t begin, int64_t end);
}  // namespace avx2
namespace avx512 {
extern const VolumeKernels kVolumeKernels;
void lookup(const LookupJob&, int64_t begin, int64_t end);
}  // namespace avx512

}  // namespace texgs
