// SPDX-License-Identifier: Apache-2.0
// Exceptions turned into the status codes of the C interface, the same in every library.
#pragma once
#include <cstdint>
#include <exception>
#include <new>
#include <string>

#include "texgs.h"

namespace texgs {

inline thread_local std::string last_error;  // what texgs_error() returns

struct InvalidArgument {
    const char* what;
};
inline void require(bool condition, const char* what) {
    if (!condition) throw InvalidArgument{what};
}

// Thrown before anything is allocated when `bytes` more than there is are asked for.
struct OutOfMemory {
    int64_t bytes;
};

// Thrown by a loop that its caller has stopped.
struct Stopped {};

template <class Body>
int32_t guarded(const Body& body) {
    try {
        body();
        return TEXGS_OK;
    } catch (const InvalidArgument& e) {
        last_error = e.what;
        return TEXGS_INVALID_ARGUMENT;
    } catch (const OutOfMemory& e) {
        last_error = "not enough memory: this needs " + std::to_string(e.bytes) + " bytes more";
        return TEXGS_OUT_OF_MEMORY;
    } catch (const std::bad_alloc&) {
        last_error = "not enough memory";
        return TEXGS_OUT_OF_MEMORY;
    } catch (const Stopped&) {
        last_error = "stopped by its caller";
        return TEXGS_STOPPED;
    } catch (const std::exception& e) {
        last_error = e.what();
        return TEXGS_DEVICE_ERROR;
    }
}

}  // namespace texgs
