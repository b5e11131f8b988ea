// SPDX-License-Identifier: Apache-2.0
// The shared geometry with one surfel or Gaussian per thread.
#pragma once
#include <cuda_runtime.h>

#define TEXGS_ISA cuda

namespace texgs::cuda {

__host__ __device__ inline float fma(float a, float b, float c) { return ::fmaf(a, b, c); }
__host__ __device__ inline float fnma(float a, float b, float c) { return ::fmaf(-a, b, c); }
__host__ __device__ inline float sqrt(float a) { return ::sqrtf(a); }
__host__ __device__ inline float exp2(float a) { return ::exp2f(a); }
__host__ __device__ inline float exp(float a) { return ::expf(a); }
__host__ __device__ inline float sigmoid(float a) { return 1.0f / (1.0f + exp(-a)); }
__host__ __device__ inline float log2(float a) { return ::log2f(a); }
__host__ __device__ inline float abs(float a) { return ::fabsf(a); }
__host__ __device__ inline float select(bool condition, float yes, float no) { return condition ? yes : no; }
__device__ inline float clamp(float a, float low, float high) { return fminf(fmaxf(a, low), high); }
using ::max, ::min;  // of every type: functions for float here would hide those for integers

}  // namespace texgs::cuda

#include "../primitive.h"
