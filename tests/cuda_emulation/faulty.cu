// SPDX-License-Identifier: Apache-2.0
// Kernels with one typical error each, and one without: what the emulation has to report.
#include <cuda_runtime.h>

namespace {

constexpr unsigned kBlock = 64, kBlocks = 4, kValues = kBlock * kBlocks;

__device__ unsigned last_lane() { return kBlock - 1 - threadIdx.x; }

// Reverses the values of each block.
__global__ void right(float* values) {
    __shared__ float staged[kBlock];
    const unsigned i = blockIdx.x * kBlock + threadIdx.x;
    staged[threadIdx.x] = values[i];
    __syncthreads();
    values[i] = staged[last_lane()];
}

__global__ void barrier_missing(float* values) {
    __shared__ float staged[kBlock];
    const unsigned i = blockIdx.x * kBlock + threadIdx.x;
    staged[threadIdx.x] = values[i];
    values[i] = staged[last_lane()];
}

// The next round writes what some threads still read.
__global__ void barrier_missing_in_loop(float* values) {
    __shared__ float staged[kBlock];
    const unsigned i = blockIdx.x * kBlock + threadIdx.x;
    for (int round = 0; round < 2; ++round) {
        staged[threadIdx.x] = values[i];
        __syncthreads();
        values[i] = staged[last_lane()];
    }
}

__global__ void barrier_for_some(float* values) {
    if (threadIdx.x < 32) __syncthreads();
    values[blockIdx.x * kBlock + threadIdx.x] = 1.0f;
}

__global__ void different_barriers(float* values) {
    if (threadIdx.x < 32)
        __syncthreads();
    else
        __syncthreads();
    values[blockIdx.x * kBlock + threadIdx.x] = 1.0f;
}

__global__ void lane_mask_too_small(float* values) {
    const unsigned i = blockIdx.x * kBlock + threadIdx.x;
    values[i] += __shfl_xor_sync(0x0000ffffu, values[i], 1);
}

__global__ void lanes_missing(float* values) {
    const unsigned i = blockIdx.x * kBlock + threadIdx.x;
    if (threadIdx.x % 2) values[i] += __shfl_xor_sync(0xffffffffu, values[i], 1);
}

__global__ void shuffle_from_nowhere(float* values) {
    const unsigned i = blockIdx.x * kBlock + threadIdx.x;
    if (threadIdx.x % 32 < 16) values[i] += __shfl_xor_sync(0x0000ffffu, values[i], 16);
}

__global__ void atomic_missing(float* values) {
    if (threadIdx.x == 0) values[0] += 1.0f;
}

__global__ void atomic_and_plain(float* values) {
    if (threadIdx.x == 0) atomicAdd(values, 1.0f);
    if (threadIdx.x == 1) values[1] = values[0];
}

__global__ void neighbour_of_another_block(float* values) {
    const unsigned i = blockIdx.x * kBlock + threadIdx.x;
    values[i] = i + 1 < kValues ? values[i + 1] : 0.0f;
}

__global__ void shared_not_written(float* values) {
    __shared__ float staged[kBlock];
    if (threadIdx.x != 5) staged[threadIdx.x] = 1.0f;
    __syncthreads();
    values[blockIdx.x * kBlock + threadIdx.x] = staged[last_lane()];
}

__global__ void past_the_end_of_shared(float* values) {
    __shared__ struct {
        float first[kBlock], second[kBlock];
    } staged;
    staged.first[threadIdx.x] = staged.second[threadIdx.x] = 1.0f;
    __syncthreads();
    values[blockIdx.x * kBlock + threadIdx.x] = staged.first[threadIdx.x + 1];
}

__global__ void past_the_end_of_memory(float* values) { values[blockIdx.x * kBlock + threadIdx.x + 1024] = 1.0f; }

__global__ void memory_not_written(float* values) {
    const unsigned i = blockIdx.x * kBlock + threadIdx.x;
    values[i] = values[i + kValues];
}

constexpr struct {
    const char* name;
    void (*kernel)(float*);
} kernels[] = {
    {"right", right},
    {"barrier missing", barrier_missing},
    {"barrier missing in loop", barrier_missing_in_loop},
    {"barrier for some", barrier_for_some},
    {"different barriers", different_barriers},
    {"lane mask too small", lane_mask_too_small},
    {"lanes missing", lanes_missing},
    {"shuffle from nowhere", shuffle_from_nowhere},
    {"atomic missing", atomic_missing},
    {"atomic and plain", atomic_and_plain},
    {"neighbour of another block", neighbour_of_another_block},
    {"shared not written", shared_not_written},
    {"past the end of shared", past_the_end_of_shared},
    {"past the end of memory", past_the_end_of_memory},
    {"memory not written", memory_not_written},
};

void queue(void (*kernel)(float*), float* values) {
    cudaLaunchConfig_t config{};
    config.gridDim = kBlocks;
    config.blockDim = kBlock;
    cudaLaunchKernelEx(&config, kernel, values);
}

}  // namespace

#define EXPORT extern "C" __attribute__((visibility("default")))

// Runs a kernel on 256 zeros, with room for as many more that nothing has written; false where there is no such kernel.
EXPORT bool run(const char* name) {
    for (const auto& [known, kernel] : kernels) {
        if (std::strcmp(known, name)) continue;
        void* values = nullptr;
        cudaMalloc(&values, 2 * kValues * sizeof(float));
        cudaMemsetAsync(values, 0, kValues * sizeof(float), nullptr);
        queue(kernel, static_cast<float*>(values));
        cudaFree(values);
        return true;
    }
    return false;
}

// Copies a number to the host and looks at it at once; returns what is there.
EXPORT float read_too_early() {
    void *device = nullptr, *host = nullptr;
    cudaMalloc(&device, sizeof(float)), cudaMallocHost(&host, sizeof(float));
    cudaMemsetAsync(device, 0, sizeof(float), nullptr);
    cudaMemcpyAsync(host, device, sizeof(float), cudaMemcpyDeviceToHost, nullptr);
    const float found = *static_cast<float*>(host);
    cudaFree(device), cudaFreeHost(host);
    return found;
}

// Works on freed memory.
EXPORT void use_freed_memory() {
    void* values = nullptr;
    cudaMalloc(&values, kValues * sizeof(float));
    cudaMemsetAsync(values, 0, kValues * sizeof(float), nullptr);
    cudaFree(values);
    queue(right, static_cast<float*>(values));
}

// Puts work into a second stream, which does or does not wait for the first.
EXPORT void two_streams(bool waits) {
    static int first, second;
    const auto one = reinterpret_cast<cudaStream_t>(&first), two = reinterpret_cast<cudaStream_t>(&second);
    void *values = nullptr, *host = nullptr;
    cudaEvent_t written;
    cudaMalloc(&values, sizeof(float)), cudaMallocHost(&host, sizeof(float));
    cudaEventCreateWithFlags(&written, cudaEventDisableTiming);
    cudaMemsetAsync(values, 0, sizeof(float), one);
    cudaEventRecord(written, one);
    if (waits) cudaStreamWaitEvent(two, written, 0);
    cudaMemcpyAsync(host, values, sizeof(float), cudaMemcpyDeviceToHost, two);
    cudaFree(values), cudaFreeHost(host), cudaEventDestroy(written);
}
