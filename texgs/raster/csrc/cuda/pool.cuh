// SPDX-License-Identifier: Apache-2.0
// Objects with device memory that wait to be used again.
#pragma once
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "memory.cuh"

namespace texgs::cuda {

// T is made from a device, which is its member `device`.
template <class T>
class Pool {
public:
    std::unique_ptr<T> take(int device) {
        std::lock_guard lock(mutex_);
        for (auto idle = idle_.rbegin(); idle != idle_.rend(); ++idle)
            if ((*idle)->device == device) {
                std::unique_ptr<T> taken = std::move(*idle);
                idle_.erase(std::next(idle).base());
                return taken;
            }
        return std::make_unique<T>(device);
    }

    void clear() {
        std::lock_guard lock(mutex_);
        for (auto& object : idle_) {
            const DeviceScope scope(object->device);
            object.reset();
        }
        idle_.clear();
    }

    // Keeps a few; more would only hold memory.
    void give(std::unique_ptr<T> object) {
        std::lock_guard lock(mutex_);
        idle_.push_back(std::move(object));  // first: where the device fails, its memory is not freed
        const DeviceScope scope(idle_.back()->device);
        if (idle_.size() > kMost) idle_.erase(idle_.begin());
    }

private:
    static constexpr size_t kMost = 4;
    std::mutex mutex_;
    std::vector<std::unique_ptr<T>> idle_;
};

// The pool of all T, never destroyed: the driver may be gone before static objects are.
template <class T>
Pool<T>& pool() {
    static Pool<T>* objects = new Pool<T>;
    return *objects;
}

}  // namespace texgs::cuda
