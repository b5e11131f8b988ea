// SPDX-License-Identifier: Apache-2.0
// What marks functions that run on the host and on a GPU.
#pragma once

#ifdef __CUDACC__
#define TEXGS_MATHS __host__ __device__ inline
#else
#define TEXGS_MATHS inline
#endif
