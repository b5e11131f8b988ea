// SPDX-License-Identifier: Apache-2.0
// Parallel radix sort. Depths of a scene share their leading bits, so the digits cover only the range that occurs:
// two passes instead of three for a depth range within a factor of two.
#include "sort.h"

#include <algorithm>
#include <bit>

#include "kernels.h"
#include "parallel.h"

namespace texgs {
namespace {

constexpr int kLargestDigit = 12;
constexpr int64_t kSmallestPart = 8192;

struct Item {
    uint32_t key, id;
};

struct Range {
    uint32_t low = kCulled, high = 0;
    int64_t visible = 0;
};

Range find_range(const uint32_t* keys, int64_t begin, int64_t end) {
    Range r;
    for (int64_t i = begin; i < end; ++i) {
        if (keys[i] == kCulled) continue;
        r.low = std::min(r.low, keys[i]), r.high = std::max(r.high, keys[i]);
        ++r.visible;
    }
    return r;
}

// Turns counts [parts][digits] into the place where each part puts its first item of each digit.
void place(uint32_t* counts, int parts, int digits) {
    uint32_t next = 0;
    for (int d = 0; d < digits; ++d)
        for (int p = 0; p < parts; ++p) {
            const uint32_t count = counts[p * digits + d];
            counts[p * digits + d] = next;
            next += count;
        }
}

}  // namespace

const uint32_t* DepthSort::run(const uint32_t* keys, int64_t n, int64_t& visible) {
    const int parts = static_cast<int>(std::clamp<int64_t>(n / kSmallestPart, 1, threads()));
    const auto for_parts = [&](int64_t count, auto body) {
        parallel_for(parts, 1, [&](int64_t p, int64_t, int) { body(p, count * p / parts, count * (p + 1) / parts); });
    };
    Range* ranges = counts_.ensure<Range>(parts);
    for_parts(n, [&](int64_t p, int64_t begin, int64_t end) { ranges[p] = find_range(keys, begin, end); });
    Range all;
    for (int p = 0; p < parts; ++p) {
        all.low = std::min(all.low, ranges[p].low), all.high = std::max(all.high, ranges[p].high);
        all.visible += ranges[p].visible;
    }
    visible = all.visible;

    const int bits = visible ? std::bit_width(all.high - all.low) : 0;
    const int passes = std::max(1, (bits + kLargestDigit - 1) / kLargestDigit);
    const int digit_bits = (bits + passes - 1) / passes, digits = 1 << digit_bits;
    uint32_t* order = order_.ensure<uint32_t>(n);
    Item* from = first_.ensure<Item>(n);
    Item* to = second_.ensure<Item>(n);
    uint32_t* counts = counts_.ensure<uint32_t>(int64_t(parts) * digits);
    for (int pass = 0; pass < passes; ++pass) {
        const bool first = pass == 0, last = pass + 1 == passes;
        const int shift = pass * digit_bits;
        // Visits the part's items in order as (key from the lowest, id).
        const auto visit = [&](int64_t begin, int64_t end, auto use) {
            for (int64_t i = begin; i < end; ++i) {
                if (!first) use(from[i].key, from[i].id);
                if (first && keys[i] != kCulled) use(keys[i] - all.low, static_cast<uint32_t>(i));
            }
        };
        const int64_t count = first ? n : visible;
        for_parts(count, [&](int64_t p, int64_t begin, int64_t end) {
            uint32_t* own = counts + p * digits;
            std::fill(own, own + digits, 0u);
            visit(begin, end, [&](uint32_t key, uint32_t) { ++own[key >> shift & (digits - 1)]; });
        });
        place(counts, parts, digits);
        for_parts(count, [&](int64_t p, int64_t begin, int64_t end) {
            uint32_t* own = counts + p * digits;
            visit(begin, end, [&](uint32_t key, uint32_t id) {
                const uint32_t at = own[key >> shift & (digits - 1)]++;
                if (last)
                    order[at] = id;
                else
                    to[at] = {key, id};
            });
        });
        std::swap(from, to);
    }
    return order;
}

}  // namespace texgs
