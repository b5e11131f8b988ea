// SPDX-License-Identifier: Apache-2.0
// The step of Adam and bounds on screen: ranges in parallel, whose results do not depend on who computes which.
#include "../texgs_fit.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "../rendered_loss.h"
#include "../status.h"
#include "loss_kernels.h"
#include "parallel.h"

namespace texgs {
namespace {

constexpr int64_t kFloatRange = 16384, kSphereRange = 4096;

ScreenBounds around(const ScreenBounds& a, const ScreenBounds& b) {
    return {std::min(a.nearest, b.nearest), std::min(a.left, b.left), std::max(a.right, b.right),
            std::min(a.top, b.top), std::max(a.bottom, b.bottom)};
}

}  // namespace
}  // namespace texgs

using namespace texgs;

int32_t texgs_adam(int64_t n_parameters, const texgs_learned* parameters, float take1, float take2, float epsilon,
                   void*) {
    return guarded([&] {
        const AdamJob job{take1, take2, epsilon};
        int64_t total = 0;
        for (int64_t k = 0; k < n_parameters; ++k) total += parameters[k].n;
        parallel_for(total, kFloatRange, [&](int64_t begin, int64_t end, int) {  // all parameters in a row
            for (const texgs_learned* p = parameters; begin < end && p != parameters + n_parameters; ++p) {
                if (begin < p->n) loss_kernels().adam(job, *p, begin, std::min(end, p->n));
                begin = std::max<int64_t>(begin - p->n, 0), end -= p->n;
            }
        });
    });
}

int32_t texgs_screen_bounds(int64_t n, int32_t axes, const float* means, const float* scales, const float* viewmat,
                            float reach, float* bounds, void*) {
    return guarded([&] {
        require(n >= 1 && (axes == 2 || axes == 3), "spheres: expected at least one, of 2 or 3 scales");
        const SpheresJob job{axes, means, scales, viewmat, reach};
        ScreenBounds all = loss_kernels().screen_bounds(job, 0, 1);
        std::mutex one;
        parallel_for(n, kSphereRange, [&](int64_t begin, int64_t end, int) {
            const ScreenBounds part = loss_kernels().screen_bounds(job, begin, end);
            const std::lock_guard lock(one);
            all = around(all, part);
        });
        const float found[5] = {all.nearest, all.left, all.right, all.top, all.bottom};
        std::copy(found, found + 5, bounds);
    });
}

int32_t texgs_observe(int64_t n, const float* gradient, float across, float down, float* sums, float* counts, void*) {
    return guarded([&] {
        parallel_for(n, kFloatRange, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i) {
                const float x = across * gradient[2 * i], y = down * gradient[2 * i + 1];
                const float length = std::sqrt(x * x + y * y);
                sums[i] += length, counts[i] += length > 0.0f ? 1.0f : 0.0f;
            }
        });
    });
}
