// SPDX-License-Identifier: Apache-2.0
// Scratch memory that only grows, so that a training loop stops allocating after its first steps.
#pragma once
#include <cstddef>
#include <cstdint>

namespace texgs {

class Buffer {
public:
    Buffer() = default;
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;
    ~Buffer() { reset(); }

    // At least `count` elements, aligned to cache lines; contents are lost when it grows.
    template <class T>
    T* ensure(int64_t count) {
        reserve(count * static_cast<int64_t>(sizeof(T)));
        return static_cast<T*>(data_);
    }

    void swap(Buffer& other);

private:
    void reserve(int64_t bytes);
    void reset();
    void* data_ = nullptr;
    int64_t capacity_ = 0;
};

// The most bytes held by all buffers together since `reset`.
int64_t memory_peak(bool reset);
// Throws OutOfMemory where the machine says that it has less than `bytes` left.
void require_memory(int64_t bytes);

}  // namespace texgs
