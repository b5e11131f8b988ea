// SPDX-License-Identifier: Apache-2.0
// What kernels are written with: qualifiers, indices, barriers, votes, shuffles, atomics, arithmetic.
#pragma once
#include <math.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <source_location>

#define __host__
#define __device__
#define __global__
#define __constant__
#define __forceinline__ inline __attribute__((always_inline))
#define __launch_bounds__(...)
#define __shared__ static  // one block runs at a time

struct uint3 {
    unsigned x, y, z;
};
struct alignas(16) float4 {
    float x, y, z, w;
};

extern uint3 threadIdx, blockIdx, blockDim, gridDim;

namespace emulation {

using Site = std::source_location;
enum class Barrier { plain, any };
enum class Exchange { ballot, any, all, shuffle };

// Waits for all threads of the block; returns whether `predicate` held for any.
bool synchronize(Barrier, bool predicate, const Site&);
// Waits for the lanes of `mask`; what each of them brought is then in `exchanged()`.
void exchange(Exchange, uint32_t mask, uint64_t value, const Site&);
uint64_t exchanged(int lane);
inline int lane() { return static_cast<int>(threadIdx.x % 32); }
// The thread's access to `address` is atomic.
void note_atomic(const void* address, size_t bytes);
[[noreturn]] void fail(const char* what, const Site&);

inline uint32_t vote(Exchange kind, uint32_t mask, bool predicate, const Site& site) {
    exchange(kind, mask, predicate, site);
    uint32_t votes = 0;
    for (int lane = 0; lane < 32; ++lane)
        if (mask >> lane & 1) votes |= static_cast<uint32_t>(exchanged(lane)) << lane;
    return votes;
}

// An access of `change` to *address that no other thread comes between.
template <class T, class Change>
__attribute__((no_sanitize("thread"))) T atomically(T* address, Change change) {
    note_atomic(address, sizeof(T));
    const T before = *address;
    *address = change(before);
    return before;
}

}  // namespace emulation

// -- barriers, votes, shuffles
inline void __syncthreads(const emulation::Site& site = emulation::Site::current()) {
    emulation::synchronize(emulation::Barrier::plain, false, site);
}
inline int __syncthreads_or(int predicate, const emulation::Site& site = emulation::Site::current()) {
    return emulation::synchronize(emulation::Barrier::any, predicate != 0, site);
}
inline uint32_t __ballot_sync(uint32_t mask, int predicate, const emulation::Site& site = emulation::Site::current()) {
    return emulation::vote(emulation::Exchange::ballot, mask, predicate != 0, site);
}
inline int __any_sync(uint32_t mask, int predicate, const emulation::Site& site = emulation::Site::current()) {
    return emulation::vote(emulation::Exchange::any, mask, predicate != 0, site) != 0;
}
inline int __all_sync(uint32_t mask, int predicate, const emulation::Site& site = emulation::Site::current()) {
    return emulation::vote(emulation::Exchange::all, mask, predicate != 0, site) == mask;
}
template <class T>
T __shfl_xor_sync(uint32_t mask, T value, int lanes, const emulation::Site& site = emulation::Site::current()) {
    static_assert(sizeof(T) <= 8);
    uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof(T));
    emulation::exchange(emulation::Exchange::shuffle, mask, bits, site);
    const int from = emulation::lane() ^ lanes;
    if (from > 31 || !(mask >> from & 1)) emulation::fail("a shuffle from a lane that takes no part", site);
    bits = emulation::exchanged(from);
    std::memcpy(&value, &bits, sizeof(T));
    return value;
}

// -- atomics
template <class T>
T atomicAdd(T* address, T value) {
    return emulation::atomically(address, [value](T before) { return before + value; });
}
template <class T>
T atomicMax(T* address, T value) {
    return emulation::atomically(address, [value](T before) { return std::max(before, value); });
}

// -- arithmetic
template <class T>
constexpr T min(T a, T b) {
    return std::min(a, b);
}
template <class T>
constexpr T max(T a, T b) {
    return std::max(a, b);
}
template <class T>
T __ldg(const T* address) {
    return *address;
}
inline int __ffs(int a) { return a ? std::countr_zero(static_cast<unsigned>(a)) + 1 : 0; }
inline int __clzll(long long a) { return std::countl_zero(static_cast<unsigned long long>(a)); }
inline uint32_t __float_as_uint(float a) { return std::bit_cast<uint32_t>(a); }
inline int32_t __float_as_int(float a) { return std::bit_cast<int32_t>(a); }
inline float __uint_as_float(uint32_t a) { return std::bit_cast<float>(a); }
inline long long __float2ll_rn(float a) { return llrintf(a); }
inline float __fmul_rn(float a, float b) { return a * b; }
inline float __fdividef(float a, float b) { return a / b; }
