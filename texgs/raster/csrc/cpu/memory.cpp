// SPDX-License-Identifier: Apache-2.0
#include "memory.h"

#include <atomic>
#include <cstdio>
#include <new>
#include <utility>

#include "../status.h"

#if defined(__linux__)
#include <sys/mman.h>
#elif defined(_WIN32)
#include <windows.h>
#endif

namespace texgs {
namespace {

constexpr int64_t kAlign = 64;
constexpr int64_t kLarge = int64_t(256) << 20;    // below, asking the system costs more than it can save
constexpr int64_t kHugePages = int64_t(4) << 20;  // from here on 2 MiB pages save page faults
std::atomic<int64_t> held{0}, peak{0};

#if defined(__linux__)
// The number in the first line of a file that `format` finds, or `otherwise`.
int64_t read_number(const char* path, const char* format, int64_t otherwise) {
    long long value = otherwise;
    if (FILE* file = std::fopen(path, "r")) {
        char line[128];
        while (std::fgets(line, sizeof line, file))
            if (std::sscanf(line, format, &value) == 1) break;
        std::fclose(file);
    }
    return value;
}
#endif

// Memory that can be had without swapping, or the largest number where the system does not say.
int64_t available_memory() {
#if defined(__linux__)
    const int64_t machine = read_number("/proc/meminfo", "MemAvailable: %lld kB", INT64_MAX >> 10) << 10;
    // a container or a batch job may get less than the machine has; pages of files are given back on demand
    const int64_t limit = read_number("/sys/fs/cgroup/memory.max", "%lld", INT64_MAX);
    if (limit == INT64_MAX) return machine;
    const int64_t cached = read_number("/sys/fs/cgroup/memory.stat", "active_file %lld", 0) +
                           read_number("/sys/fs/cgroup/memory.stat", "inactive_file %lld", 0);
    const int64_t left = limit - read_number("/sys/fs/cgroup/memory.current", "%lld", 0) + cached;
    return left < machine ? (left > 0 ? left : 0) : machine;
#elif defined(_WIN32)
    MEMORYSTATUSEX status{};
    status.dwLength = sizeof status;
    return GlobalMemoryStatusEx(&status) ? static_cast<int64_t>(status.ullAvailPhys) : INT64_MAX;
#else
    return INT64_MAX;
#endif
}

}  // namespace

int64_t memory_peak(bool reset) {
    const int64_t result = peak;
    if (reset) peak = held.load();
    return result;
}

void require_memory(int64_t bytes) {
    if (bytes >= kLarge && bytes > available_memory()) throw OutOfMemory{bytes};
}

void Buffer::reset() {
    if (!data_) return;
    ::operator delete(data_, std::align_val_t(kAlign));
    held -= capacity_;
    data_ = nullptr;
    capacity_ = 0;
}

void Buffer::swap(Buffer& other) {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
}

void Buffer::reserve(int64_t bytes) {
    if (bytes <= capacity_) return;
    reset();
    const int64_t wanted = (bytes + bytes / 8 + 4095) / 4096 * 4096;  // headroom: sizes creep up during training
    require_memory(wanted);
    data_ = ::operator new(static_cast<size_t>(wanted), std::align_val_t(kAlign), std::nothrow);
    if (!data_) throw OutOfMemory{wanted};
#if defined(__linux__)
    if (wanted >= kHugePages) {
        const auto first = (reinterpret_cast<uintptr_t>(data_) + 4095) / 4096 * 4096;
        const auto last = (reinterpret_cast<uintptr_t>(data_) + wanted) / 4096 * 4096;
        madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);
    }
#endif
    capacity_ = wanted;
    const int64_t now = held += wanted;
    int64_t most = peak;
    while (now > most && !peak.compare_exchange_weak(most, now)) {
    }
}

}  // namespace texgs
