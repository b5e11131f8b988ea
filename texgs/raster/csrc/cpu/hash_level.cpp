// SPDX-License-Identifier: Apache-2.0
// One level of a hash encoding: batches of points, whose rows and weights are found together.
#include "hash_kernels.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kBatch = 32;

// The rows of the corners around some points, and their trilinear weights.
struct Corners {
    uint32_t row[8][kBatch];
    float weight[8][kBatch];
};

// Lattice points share rows by this hash (Mueller et al. 2022, eq. 4).
inline uint32_t hashed(uint32_t x, uint32_t y, uint32_t z) { return x ^ y * 2654435761u ^ z * 805459861u; }

void find_corners(const HashLevel& level, const float* points, int n, Corners& corners) {
    const float scale = static_cast<float>(level.resolution);
    const uint32_t side = level.resolution + 1, mask = level.rows - 1;
    uint32_t cell[3][kBatch];
    float inside[3][kBatch];
    for (int axis = 0; axis < 3; ++axis)
        for (int i = 0; i < kBatch; ++i) {
            const float at = scale * points[3 * (i < n ? i : n - 1) + axis], least = at > 0.0f ? at : 0.0f;
            const int first = static_cast<int>(least < scale ? least : scale), last = level.resolution - 1;
            cell[axis][i] = first < last ? first : last;
            const float place = (least < scale ? least : scale) - static_cast<float>(cell[axis][i]);
            inside[axis][i] = at == at ? place : at;  // NaN is to be seen
        }
    for (int corner = 0; corner < 8; ++corner) {
        const uint32_t dx = corner & 1, dy = corner >> 1 & 1, dz = corner >> 2;
        for (int i = 0; i < kBatch; ++i) {
            const uint32_t x = cell[0][i] + dx, y = cell[1][i] + dy, z = cell[2][i] + dz;
            corners.row[corner][i] = level.is_dense ? x + side * (y + side * z) : hashed(x, y, z) & mask;
            corners.weight[corner][i] = (dx ? inside[0][i] : 1.0f - inside[0][i]) *
                                        (dy ? inside[1][i] : 1.0f - inside[1][i]) *
                                        (dz ? inside[2][i] : 1.0f - inside[2][i]);
        }
    }
}

int batch(int64_t left) { return static_cast<int>(left < kBatch ? left : kBatch); }

void encode(const HashLevel& level, int64_t n, int64_t begin, int64_t end, float* features) {
    Corners corners;
    for (int64_t start = begin; start < end; start += kBatch) {
        const int count = batch(end - start);
        find_corners(level, level.points + 3 * start, count, corners);
        float sum[2][kBatch] = {};
        for (int corner = 0; corner < 8; ++corner)
            for (int i = 0; i < kBatch; ++i)
                for (int c = 0; c < 2; ++c)
                    sum[c][i] += corners.weight[corner][i] * level.table[2 * int64_t(corners.row[corner][i]) + c];
        for (int c = 0; c < 2; ++c)
            for (int i = 0; i < count; ++i) features[c * n + start + i] = sum[c][i];
    }
}

void scatter(const HashLevel& level, int64_t n, const float* grad_features) {
    Corners corners;
    for (int64_t start = 0; start < n; start += kBatch) {
        const int count = batch(n - start);
        find_corners(level, level.points + 3 * start, count, corners);
        for (int i = 0; i < count; ++i)
            for (int corner = 0; corner < 8; ++corner)
                for (int c = 0; c < 2; ++c)
                    level.gradient[2 * int64_t(corners.row[corner][i]) + c] +=
                        corners.weight[corner][i] * grad_features[c * n + start + i];
    }
}

}  // namespace

const HashKernels kHashKernels = {encode, scatter};

}  // namespace texgs::TEXGS_ISA
