// SPDX-License-Identifier: Apache-2.0
// Device memory that only grows, and what orders its use between streams and the host.
#pragma once
#include "device.cuh"

namespace texgs::cuda {

// Scratch memory on the current device. Growing frees the old memory, which waits for the device to finish with it:
// the headroom makes that rare.
class Buffer {
public:
    Buffer() = default;
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;
    ~Buffer() { reset(); }

    // At least `count` elements, aligned to 256 bytes; contents are lost when it grows. Throws OutOfMemory.
    template <class T>
    T* ensure(int64_t count) {
        reserve(count * static_cast<int64_t>(sizeof(T)));
        return static_cast<T*>(data_);
    }

private:
    void reserve(int64_t bytes);
    void reset();
    void* data_ = nullptr;
    int64_t capacity_ = 0;
};

// A mark in a stream, for other streams and the host to wait for. Before the first record() it is reached.
class Mark {
public:
    Mark();
    ~Mark();
    Mark(const Mark&) = delete;
    Mark& operator=(const Mark&) = delete;

    void record(cudaStream_t stream);
    void hold(
        cudaStream_t stream) const;  // what is put into `stream` from now on waits for the mark; the host does not
    bool reached() const;
    void wait() const;

private:
    friend class Turn;
    cudaEvent_t event_ = nullptr;
};

// As long as it lives, what shares `last_use` is used on one stream: after all that was put into others before, and
// before all that comes.
class Turn {
public:
    Turn(Mark& last_use, cudaStream_t stream);
    ~Turn();
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

private:
    Mark& last_use_;
    cudaStream_t stream_;
};

// A number on the device that the host receives some time later.
class Late {
public:
    Late();
    ~Late();
    Late(const Late&) = delete;
    Late& operator=(const Late&) = delete;

    void fetch(const uint64_t* from, cudaStream_t stream);
    bool arrived() const { return fetched_ && mark_.reached(); }
    int64_t wait() const;

private:
    Mark mark_;
    uint64_t* value_ = nullptr;  // page-locked, so that the copy does not wait
    bool fetched_ = false;
};

// The most bytes that all buffers held since `reset`.
int64_t memory_peak(bool reset);
// Throws OutOfMemory where the current device has less than `bytes` left.
void require_memory(int64_t bytes);

}  // namespace texgs::cuda
