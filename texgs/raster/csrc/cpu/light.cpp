// SPDX-License-Identifier: Apache-2.0
// Light inside of volumes on CPUs, rows of cells or of columns in parallel.
#include "../light_maths.h"

#include <algorithm>
#include <vector>

#include "../cuts.h"
#include "../volume_bricks.h"
#include "dispatch.h"
#include "light_kernels.h"
#include "memory.h"
#include "parallel.h"
#include "point_table.h"

namespace texgs {
namespace {

constexpr int kTile = 16;  // sides of tiles in which rows become columns

const LightKernels& light_kernels() {
#if defined(__x86_64__) || defined(_M_X64)
    if (active_isa() == Isa::avx512) return avx512::kLightKernels;
    if (active_isa() == Isa::avx2) return avx2::kLightKernels;
#endif
    return portable::kLightKernels;
}

// Calls body(w, v, u, cell) for all cells in the order of an axis's columns, by tiles and slices in parallel; `cell` is
// its number in [z, y, x].
template <class Body>
void for_cells(const texgs_cells& cells, const Columns& c, const Body& body) {
    const int64_t strides[3] = {1, cells.size[0], int64_t(cells.size[0]) * cells.size[1]};
    const auto slices = [&](int64_t begin, int64_t end) {
        for (int v = 0; v < c.n_v; ++v)
            for (int first = 0; first < c.n_u; first += kTile)
                for (int64_t w = begin; w < end; ++w)
                    for (int u = first; u < std::min(first + kTile, c.n_u); ++u)
                        body(w, v, u, w * strides[c.w] + v * strides[c.v] + u * strides[c.u]);
    };
    parallel_for(c.slices, kTile, [&](int64_t begin, int64_t end, int) { slices(begin, end); });
}

// Extinctions in the order of an axis's columns, between zeros.
class Matter {
public:
    Matter(const texgs_cells& cells, const Columns& c, const float* extinction) : stride_(c.n_u + 2 + kMargin) {
        const int64_t count = int64_t(c.slices) * (c.n_v + 2) * stride_;
        float* const to = buffer_.ensure<float>(count);
        std::fill_n(to, count, 0.0f);
        for_cells(cells, c, [&](int64_t w, int v, int u, int64_t cell) {
            to[(w * (c.n_v + 2) + v + 1) * stride_ + u + 1] = extinction[cell];
        });
        numbers_ = to;
    }
    // Adds the shares of lights along columns to sums [w, v, u].
    void follow(const texgs_cells& cells, const Columns& c, int reach, float* sums) const {
        const SweepJob job{c, numbers_, stride_, c.length / shortest_edge(cells), reach, sums};
        const int64_t scratch = sweep_scratch(c);
        Buffer buffer;
        float* const of_workers = buffer.ensure<float>(scratch * threads());
        parallel_for(c.high - 1, kBand, [&](int64_t begin, int64_t end, int worker) {
            light_kernels().sweep(job, static_cast<int>(begin), static_cast<int>(end), of_workers + worker * scratch);
        });
    }

private:
    Buffer buffer_;
    const float* numbers_;
    int64_t stride_;
};

uint8_t byte(float share) { return static_cast<uint8_t>(std::min(share, 1.0f) * 255.0f + 0.5f); }

}  // namespace
}  // namespace texgs

using namespace texgs;

int32_t texgs_extinction(const texgs_volume* volume, const texgs_transfer* transfer, int32_t n, const uint8_t* distance,
                         float opacity_unit, const float* planes, int32_t n_planes, const texgs_cells* cells,
                         float* extinction, void*) {
    return guarded([&] {
        check_channels(volume, transfer, n);
        for (int c = 0; c < n; ++c) check_transfer(transfer[c]);
        check_cells(*cells);
        check_planes(n_planes);
        require(opacity_unit > 0.0f, "light: expected an opacity unit above 0");
        const std::vector<PointTable> tables(transfer, transfer + n);
        CastChannel channels[TEXGS_CHANNELS];
        for (int c = 0; c < n; ++c)
            channels[c] = {volume[c].values, volume[c].type, transfer[c].within, nullptr, tables[c].view};
        const ExtinctionJob job{*volume, n, channels, distance, opacity_unit, planes, n_planes, *cells, extinction};
        parallel_for(int64_t(cells->size[1]) * cells->size[2], 4, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i)
                light_kernels().extinction(job, static_cast<int>(i % cells->size[1]),
                                           static_cast<int>(i / cells->size[1]));
        });
    });
}

int32_t texgs_transmittance(const texgs_cells* cells, const float* extinction, const float to_light[3], uint8_t* light,
                            void*) {
    return guarded([&] {
        check_cells(*cells);
        const Columns columns = columns_of(*cells, {to_light[0], to_light[1], to_light[2]});
        std::vector<float> sums(count_cells(*cells), 0.0f);
        Matter(*cells, columns, extinction).follow(*cells, columns, columns.slices, sums.data());
        for_cells(*cells, columns, [&](int64_t w, int v, int u, int64_t cell) {
            light[2 * cell] = byte(sums[(w * columns.n_v + v) * columns.n_u + u]);
        });
    });
}

int32_t texgs_openness(const texgs_cells* cells, const float* extinction, int32_t n, const float* directions,
                       float reach, uint8_t* light, void*) {
    return guarded([&] {
        check_cells(*cells);
        require(n > 0 && reach > 0.0f, "light: expected directions and a reach above 0");
        std::vector<Columns> columns;
        for (int i = 0; i < n; ++i)
            columns.push_back(columns_of(*cells, {directions[3 * i], directions[3 * i + 1], directions[3 * i + 2]}));
        const float share = share_of(n);
        std::vector<float> all(count_cells(*cells), 0.0f), sums(all.size());
        for (int axis = 0; axis < 3; ++axis) {
            const auto first = std::find_if(columns.begin(), columns.end(), [&](auto& c) { return c.w == axis; });
            if (first == columns.end()) continue;
            const Matter matter(*cells, *first, extinction);
            std::fill(sums.begin(), sums.end(), 0.0f);
            for (const Columns& c : columns)
                if (c.w == axis) matter.follow(*cells, c, reach_in_slices(c, reach), sums.data());
            for_cells(*cells, *first, [&](int64_t w, int v, int u, int64_t cell) {
                all[cell] += share * sums[(w * first->n_v + v) * first->n_u + u];
            });
        }
        parallel_for(int64_t(all.size()), 1 << 16, [&](int64_t begin, int64_t end, int) {
            for (int64_t i = begin; i < end; ++i) light[2 * i + 1] = byte(all[i]);
        });
    });
}

int32_t texgs_light_lookup(const texgs_cells* cells, const uint8_t* light, int64_t n, const float* points,
                           float* shares, void*) {
    return guarded([&] {
        check_cells(*cells);
        const LightLookupJob job{*cells, light, points, shares};
        parallel_for(n, 256, [&](int64_t begin, int64_t end, int) { light_kernels().lookup(job, begin, end); });
    });
}
