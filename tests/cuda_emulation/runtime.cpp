// SPDX-License-Identifier: Apache-2.0
// The runtime's calls: streams are queues of work, which the "device" does some time between the call and the moment
// somebody waits for it. When, and of which stream first, is up to chance.
#include <unistd.h>

#include <algorithm>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "emulation.h"

// How often it was recorded, and which of those the device has come to.
struct CUevent_st {
    std::shared_ptr<std::pair<uint64_t, uint64_t>> state = std::make_shared<std::pair<uint64_t, uint64_t>>(0, 0);
};

namespace emulation {
namespace {

struct Work {
    std::function<void()> run;
    std::function<bool()> may_begin = [] { return true; };
};

std::recursive_mutex mutex;  // of everything: one host thread at a time
std::map<cudaStream_t, std::deque<Work>> streams;
std::string failure;  // the first; after it kernels and copies are skipped

// Does what comes next in one of the streams that wait for no other; false where there is none.
bool work_once() {
    std::vector<std::deque<Work>*> able;
    for (auto& [_, work] : streams)
        if (!work.empty() && work.front().may_begin()) able.push_back(&work);
    if (able.empty()) return false;
    std::deque<Work>& stream = *able[chance(static_cast<uint32_t>(able.size()))];
    const Work work = std::move(stream.front());
    stream.pop_front();
    work.run();
    return true;
}

void work_until(const std::function<bool()>& done) {
    while (!done() && work_once()) {
    }
}
void work_off() {
    work_until([] { return false; });
}

}  // namespace

void enqueue(cudaStream_t stream, std::function<void()> work) {
    const std::lock_guard lock(mutex);
    streams[stream].push_back({[work = std::move(work)] {
        if (!failure.empty()) return;
        try {
            work();
        } catch (const Failure& e) {
            failure = e.what();
        }
    }});
    advance();
}

void advance() {
    const std::lock_guard lock(mutex);
    while (chance(2) && work_once()) {
    }
}

cudaError_t launch(const cudaLaunchConfig_t& config, std::function<void()> kernel) {
    enqueue(config.stream, [config, kernel = std::move(kernel)] { run_grid(config.gridDim, config.blockDim, kernel); });
    return cudaGetLastError();
}

}  // namespace emulation

using namespace emulation;

// -- errors
cudaError_t cudaGetLastError() { return failure.empty() ? cudaSuccess : cudaErrorLaunchFailure; }
const char* cudaGetErrorString(cudaError_t status) {
    return status == cudaErrorLaunchFailure ? failure.c_str() : "the emulation refuses a call";
}

// -- the device
cudaError_t cudaGetDevice(int* device) { return *device = 0, cudaSuccess; }
cudaError_t cudaSetDevice(int) { return cudaSuccess; }
cudaError_t cudaPointerGetAttributes(cudaPointerAttributes* found, const void*) {
    return *found = {cudaMemoryTypeDevice, 0}, cudaSuccess;
}
cudaError_t cudaMemGetInfo(size_t* available, size_t* total) {
    const auto page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
    *available = page * static_cast<size_t>(sysconf(_SC_AVPHYS_PAGES));
    *total = page * static_cast<size_t>(sysconf(_SC_PHYS_PAGES));
    return cudaSuccess;
}

// -- memory
cudaError_t cudaMalloc(void** p, size_t bytes) {
    const std::lock_guard lock(mutex);
    advance();
    *p = allocate(bytes);
    return *p ? cudaSuccess : cudaErrorMemoryAllocation;
}
cudaError_t cudaFree(void* p) {
    const std::lock_guard lock(mutex);
    work_off();
    return !p || release(p) ? cudaGetLastError() : cudaErrorInvalidValue;
}
cudaError_t cudaMallocHost(void** p, size_t bytes) {
    *p = std::malloc(bytes);
    if (!*p) return cudaErrorMemoryAllocation;
    mark_unwritten(*p, bytes);
    return cudaSuccess;
}
cudaError_t cudaFreeHost(void* p) { return std::free(p), cudaSuccess; }
cudaError_t cudaMemsetAsync(void* p, int value, size_t bytes, cudaStream_t stream) {
    enqueue(stream, [=] {
        require_allocated(p, bytes, "clearing");
        std::fill_n(static_cast<char*>(p), bytes, static_cast<char>(value));
        mark_written(p, bytes);
    });
    return cudaGetLastError();
}
cudaError_t cudaMemcpyAsync(void* to, const void* from, size_t bytes, cudaMemcpyKind, cudaStream_t stream) {
    enqueue(stream, [=] {
        require_allocated(from, bytes, "copying");
        if (!is_written(from)) throw Failure("copying device memory that nothing wrote");
        std::copy_n(static_cast<const char*>(from), bytes, static_cast<char*>(to));
    });
    return cudaGetLastError();
}

// -- events
cudaError_t cudaEventCreateWithFlags(cudaEvent_t* event, unsigned) { return *event = new CUevent_st, cudaSuccess; }
cudaError_t cudaEventDestroy(cudaEvent_t event) { return delete event, cudaSuccess; }
cudaError_t cudaEventRecord(cudaEvent_t event, cudaStream_t stream) {
    const std::lock_guard lock(mutex);
    const uint64_t count = ++event->state->first;
    streams[stream].push_back({[state = event->state, count] { state->second = std::max(state->second, count); }});
    advance();
    return cudaGetLastError();
}
cudaError_t cudaEventQuery(cudaEvent_t event) {
    const std::lock_guard lock(mutex);
    advance();
    if (!failure.empty()) return cudaErrorLaunchFailure;
    return event->state->second < event->state->first ? cudaErrorNotReady : cudaSuccess;
}
cudaError_t cudaEventSynchronize(cudaEvent_t event) {
    const std::lock_guard lock(mutex);
    work_until([&] { return event->state->second >= event->state->first; });
    return cudaGetLastError();
}
cudaError_t cudaStreamWaitEvent(cudaStream_t stream, cudaEvent_t event, unsigned) {
    const std::lock_guard lock(mutex);
    streams[stream].push_back(
        {[] {}, [state = event->state, count = event->state->first] { return state->second >= count; }});
    return cudaGetLastError();
}

// -- what the tests call
extern "C" __attribute__((visibility("default"))) void emulation_seed(uint64_t value) {
    const std::lock_guard lock(mutex);
    seed(value);
}
// Does all work that is left. The first failure since the last call, or null.
extern "C" __attribute__((visibility("default"))) const char* emulation_synchronize() {
    const std::lock_guard lock(mutex);
    static std::string told;
    work_off();
    told = std::exchange(failure, {});
    return told.empty() ? nullptr : told.c_str();
}
