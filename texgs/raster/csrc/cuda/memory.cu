// SPDX-License-Identifier: Apache-2.0
#include "memory.cuh"

#include <atomic>

#include "../status.h"

namespace texgs::cuda {
namespace {

constexpr int64_t kAlign = 512;
constexpr int64_t kLarge = int64_t(256) << 20;  // below, asking the driver costs more than it can save
std::atomic<int64_t> held{0}, peak{0};

}  // namespace

int64_t memory_peak(bool reset) {
    const int64_t result = peak;
    if (reset) peak = held.load();
    return result;
}

void require_memory(int64_t bytes) {
    if (bytes < kLarge) return;
    size_t available = 0, total = 0;
    check(cudaMemGetInfo(&available, &total), "asking for the free memory");
    if (bytes > static_cast<int64_t>(available)) throw OutOfMemory{bytes};
}

void Buffer::reset() {
    if (!data_) return;
    cudaFree(data_);  // fails only for an error of earlier work, which the next call reports
    held -= capacity_;
    data_ = nullptr;
    capacity_ = 0;
}

void Buffer::reserve(int64_t bytes) {
    if (bytes <= capacity_) return;
    reset();
    const int64_t wanted = (bytes + bytes / 8 + kAlign - 1) / kAlign * kAlign;  // sizes creep up during training
    require_memory(wanted);
    const cudaError_t status = cudaMalloc(&data_, static_cast<size_t>(wanted));
    if (status != cudaSuccess) {
        data_ = nullptr;
        cudaGetLastError();  // the exception tells of it; later calls must not report it again
        if (status == cudaErrorMemoryAllocation) throw OutOfMemory{wanted};
        check(status, "allocating memory");
    }
    capacity_ = wanted;
    const int64_t now = held += wanted;
    int64_t most = peak;
    while (now > most && !peak.compare_exchange_weak(most, now)) {
    }
}

Mark::Mark() { check(cudaEventCreateWithFlags(&event_, cudaEventDisableTiming), "creating an event"); }
Mark::~Mark() { cudaEventDestroy(event_); }
void Mark::record(cudaStream_t stream) { check(cudaEventRecord(event_, stream), "recording an event"); }
void Mark::hold(cudaStream_t stream) const { check(cudaStreamWaitEvent(stream, event_, 0), "waiting for a stream"); }
void Mark::wait() const { check(cudaEventSynchronize(event_), "waiting for the device"); }
bool Mark::reached() const {
    const cudaError_t status = cudaEventQuery(event_);
    if (status == cudaErrorNotReady) return false;
    check(status, "asking for an event");
    return true;
}

Turn::Turn(Mark& last_use, cudaStream_t stream) : last_use_(last_use), stream_(stream) { last_use.hold(stream); }
Turn::~Turn() { cudaEventRecord(last_use_.event_, stream_); }

Late::Late() {
    check(cudaMallocHost(reinterpret_cast<void**>(&value_), sizeof *value_), "allocating page-locked memory");
}
Late::~Late() { cudaFreeHost(value_); }
void Late::fetch(const uint64_t* from, cudaStream_t stream) {
    check(cudaMemcpyAsync(value_, from, sizeof *value_, cudaMemcpyDeviceToHost, stream), "fetching a number");
    mark_.record(stream);
    fetched_ = true;
}
int64_t Late::wait() const {
    mark_.wait();
    return static_cast<int64_t>(*value_);
}

}  // namespace texgs::cuda
