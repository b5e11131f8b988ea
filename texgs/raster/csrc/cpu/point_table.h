// SPDX-License-Identifier: Apache-2.0
// The points of a transfer function as the kernels read them.
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "volume_kernels.h"

namespace texgs {

// Points as arrays, see CastTable.
struct PointTable {
    std::vector<float> numbers;
    CastTable view;

    explicit PointTable(const texgs_transfer& transfer) {
        const int n = transfer.n;
        int length = kTablePoints;
        while (length < n) length *= 2;
        numbers.resize(6 * size_t(length), 0.0f);
        float* column[6];
        for (int c = 0; c < 6; ++c) column[c] = numbers.data() + c * length;
        std::fill_n(column[0], length, std::numeric_limits<float>::infinity());
        for (int i = 0; i < n; ++i) {
            const float* p = transfer.points + 5 * i;
            column[0][i] = p[0], column[2][i] = p[1];
            const float per_width = i + 1 < n && p[5] > p[0] ? 1.0f / (p[5] - p[0]) : 0.0f;
            column[1][i] = std::isfinite(per_width) ? per_width : 0.0f;  // too narrow to mix: a step
            for (int c = 0; c < 3; ++c) column[3 + c][i] = p[2 + c];
        }
        view = {n, length, column[0], column[1], column[2], {column[3], column[4], column[5]}};
    }
};

}  // namespace texgs
