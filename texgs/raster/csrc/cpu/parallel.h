// SPDX-License-Identifier: Apache-2.0
// Parallel loops with dynamic scheduling on one thread pool: the caller's OpenMP runtime where there is one.
#pragma once
#include <cstdint>
#include <type_traits>

namespace texgs {

// Number of threads a loop may use; workers are numbered 0 to threads() - 1.
int threads();

using Job = void (*)(void* context, int64_t begin, int64_t end, int worker);
void run_parallel(int64_t n, int64_t grain, Job job, void* context);

// Calls body(begin, end, worker) on disjoint ranges of at most `grain` that cover [0, n). Which worker gets which
// range varies: a result must not depend on it. Throws Stopped where the caller has stopped its loops meanwhile.
template <class Body>
void parallel_for(int64_t n, int64_t grain, Body&& body) {
    using Plain = std::remove_reference_t<Body>;
    run_parallel(
        n, grain,
        [](void* context, int64_t begin, int64_t end, int worker) {
            (*static_cast<Plain*>(context))(begin, end, worker);
        },
        &body);
}

}  // namespace texgs
