// SPDX-License-Identifier: Apache-2.0
// The thin layer between the passes and the CUDA runtime: the current device, launches, errors.
#pragma once
#include <cuda_runtime.h>

#include <cstdint>

namespace texgs::cuda {

constexpr int kWarp = 32;
constexpr uint32_t kAllLanes = 0xffffffffu;

// Throws std::runtime_error, saying what was being done, where the runtime reports a failure.
void check(cudaError_t status, const char* what);

// Works on one device for as long as it lives, then goes back to the one before.
class DeviceScope {
public:
    explicit DeviceScope(int device);
    ~DeviceScope();
    DeviceScope(const DeviceScope&) = delete;
    DeviceScope& operator=(const DeviceScope&) = delete;

private:
    int before_ = 0, device_;
};

// The device on which `pointer` lies.
int device_of(const void* pointer);

inline int64_t blocks_for(int64_t items, int per_block) { return (items + per_block - 1) / per_block; }

template <class... Parameters, class... Arguments>
void launch(void (*kernel)(Parameters...), int64_t blocks, int threads, cudaStream_t stream, Arguments... arguments) {
    if (blocks == 0) return;
    cudaLaunchConfig_t config{};
    config.gridDim = static_cast<unsigned>(blocks);
    config.blockDim = threads;
    config.stream = stream;
    check(cudaLaunchKernelEx(&config, kernel, arguments...), "launching a kernel");
}

}  // namespace texgs::cuda
