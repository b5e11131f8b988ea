// SPDX-License-Identifier: Apache-2.0
#include "device.cuh"

#include <stdexcept>
#include <string>

namespace texgs::cuda {

void check(cudaError_t status, const char* what) {
    if (status == cudaSuccess) return;
    cudaGetLastError();  // the exception tells of it; later calls must not report it again
    throw std::runtime_error(std::string("CUDA, ") + what + ": " + cudaGetErrorString(status));
}

DeviceScope::DeviceScope(int device) : device_(device) {
    check(cudaGetDevice(&before_), "asking for the current device");
    if (device_ != before_) check(cudaSetDevice(device_), "choosing a device");
}

DeviceScope::~DeviceScope() {
    if (device_ != before_) cudaSetDevice(before_);
}

int device_of(const void* pointer) {
    cudaPointerAttributes attributes{};
    check(cudaPointerGetAttributes(&attributes, pointer), "looking up a pointer");
    if (attributes.type != cudaMemoryTypeDevice && attributes.type != cudaMemoryTypeManaged)
        throw std::runtime_error("expected tensors in the memory of a CUDA device");
    return attributes.device;
}

}  // namespace texgs::cuda
