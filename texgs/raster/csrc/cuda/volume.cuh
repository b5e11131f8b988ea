// SPDX-License-Identifier: Apache-2.0
// Samples of volumes around a place, and what transfer functions make of their values, for one thread.
#pragma once
#include <cuda_runtime.h>

#include <cstdint>
#include <type_traits>

#include "maths.cuh"

#include "../volume_maths.h"

namespace texgs::cuda {
namespace {

constexpr int kThreads = 128;

__device__ inline int64_t thread_index() { return int64_t(blockIdx.x) * kThreads + threadIdx.x; }

// Calls body(sample) with a sample of a type. It runs where the body does, on the host or on the GPU.
#ifdef __CUDACC__
#pragma nv_exec_check_disable
#endif
template <class Body>
TEXGS_MATHS auto with_type(int32_t type, const Body& body) {
    switch (type) {
        case TEXGS_U8:
            return body(uint8_t());
        case TEXGS_I8:
            return body(int8_t());
        case TEXGS_U16:
            return body(uint16_t());
        case TEXGS_I16:
            return body(int16_t());
        case TEXGS_U32:
            return body(uint32_t());
        case TEXGS_I32:
            return body(int32_t());
        case TEXGS_U64:
            return body(uint64_t());
        case TEXGS_I64:
            return body(int64_t());
        case TEXGS_F32:
            return body(float());
        default:
            return body(double());
    }
}

// Stands for the type of samples that is known only where they are read.
struct AnyType {};

template <class T>
struct Samples {
    const void* values;
    int32_t type;
    int size[3];

    __device__ float at(int x, int y, int z) const {
        const int i[3] = {clamped(x, 0), clamped(y, 1), clamped(z, 2)};
        const int64_t place = (int64_t(i[2]) * size[1] + i[1]) * size[0] + i[0];
        if constexpr (std::is_same_v<T, AnyType>)
            return with_type(type, [&](auto s) { return value_at<decltype(s)>(place); });
        else
            return value_at<T>(place);
    }
    template <class S>
    __device__ float value_at(int64_t place) const {
        return static_cast<float>(static_cast<const S*>(values)[place]);
    }
    __device__ int clamped(int i, int axis) const { return i < 0 ? 0 : i < size[axis] ? i : size[axis] - 1; }
};

// A cell and the place in it; `last` are places of the last sample.
struct Spot {
    int cell[3];
    float inside[3];

    __device__ Spot(const float (&last)[3], const float (&at)[3]) {
        for (int a = 0; a < 3; ++a) {
            const float place = fminf(fmaxf(at[a], 0.0f), last[a]);
            cell[a] = static_cast<int>(fminf(floorf(place), last[a] - 1.0f));
            inside[a] = place - static_cast<float>(cell[a]);
        }
    }
    // Whether the cell is one of those chosen of a brick.
    __device__ bool is_among(const uint32_t* cells, const int (&brick)[3]) const {
        const int x = cell[0] - TEXGS_BRICK * brick[0], y = cell[1] - TEXGS_BRICK * brick[1],
                  z = cell[2] - TEXGS_BRICK * brick[2];
        return cells[z / 2] >> (16 * (z % 2) + 4 * y + x) & 1;
    }
    template <class T>
    __device__ float value(const Samples<T>& s) const {
        float v[8];
        for (int i = 0; i < 8; ++i) v[i] = s.at(cell[0] + (i & 1), cell[1] + (i >> 1 & 1), cell[2] + (i >> 2));
        return trilinear(v, inside);
    }
    template <class T>
    __device__ float difference(const Samples<T>& s, int axis) const {
        const int dx = axis == 0, dy = axis == 1, dz = axis == 2;
        float v[8];
        for (int i = 0; i < 8; ++i) {
            const int x = cell[0] + (i & 1), y = cell[1] + (i >> 1 & 1), z = cell[2] + (i >> 2);
            v[i] = s.at(x + dx, y + dy, z + dz) - s.at(x - dx, y - dy, z - dz);
        }
        return trilinear(v, inside);
    }
};

// The interval of a transfer function that a value is in, and how far.
struct Interval {
    const float *from, *to;
    float place;

    __device__ Interval(const texgs_transfer& t, float value) {
        int first = 0;
        for (int end = t.n - 1; end - first > 1;) {
            const int middle = (first + end) / 2;
            if (t.points[5 * middle] <= value)
                first = middle;
            else
                end = middle;
        }
        from = t.points + 5 * first, to = from + 5;
        place = to[0] > from[0] ? (value - from[0]) / (to[0] - from[0]) : 0.0f;
    }
    __device__ float column(int c) const { return mix(from[c], to[c], place); }
};

// The logarithm to base 2 of the light that a stretch of `lengths` opacity units lets through at a value; 0 where
// nothing shows.
__device__ inline float log2_through_at(const texgs_transfer& t, float value, float lengths) {
    if (!(value >= t.points[0] && value <= t.points[5 * (t.n - 1)])) return 0.0f;
    const float opacity = Interval(t, value).column(1);
    return opacity > 0.0f ? log2_through(opacity, lengths) : 0.0f;
}

// Volumes of one lattice that are shown together, each with its transfer function.
struct Channels {
    const void* values[TEXGS_CHANNELS] = {};
    int32_t type[TEXGS_CHANNELS] = {};
    texgs_transfer transfer[TEXGS_CHANNELS] = {};
    int size[3], n;

    Channels(const texgs_volume* volume, const texgs_transfer* functions, int32_t count) : n(count) {
        for (int a = 0; a < 3; ++a) size[a] = volume->size[a];
        for (int c = 0; c < n; ++c) values[c] = volume[c].values, type[c] = volume[c].type, transfer[c] = functions[c];
    }
    template <class T>
    __device__ Samples<T> samples(int c) const {
        return {values[c], type[c], {size[0], size[1], size[2]}};
    }
    // Whether a place is inside of the mask of a channel.
    __device__ bool has(int c, const Spot& spot) const {
        const uint8_t* mask = transfer[c].within;
        return !mask || spot.value(Samples<uint8_t>{mask, TEXGS_U8, {size[0], size[1], size[2]}}) >= TEXGS_INSIDE;
    }
};

// Calls body(sample) with a sample of the type that volumes have in common, or else with AnyType().
template <class Body>
void with_type_of(const texgs_volume* volume, int32_t n, const Body& body) {
    for (int c = 1; c < n; ++c)
        if (volume[c].type != volume->type) return body(AnyType());
    with_type(volume->type, body);
}

}  // namespace
}  // namespace texgs::cuda
