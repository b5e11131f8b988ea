// SPDX-License-Identifier: Apache-2.0
// Stable order of visible surfels by depth.
#pragma once
#include <cstdint>

#include "memory.h"

namespace texgs {

class DepthSort {
public:
    // Indices of the keys that are not kCulled, by key, ties by index; `visible` receives their number.
    const uint32_t* run(const uint32_t* keys, int64_t n, int64_t& visible);

private:
    Buffer first_, second_, counts_, order_;
};

}  // namespace texgs
