// SPDX-License-Identifier: Apache-2.0
// The mean extinction of cells: of places in rows that go through all cells of a row.
#include "simd.h"

#include "../volume_maths.h"
#include "cell_samples.h"
#include "intervals.h"
#include "light_kernels.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kMostPlaces = 8 * TEXGS_LIGHT_SIDE;

// Places of a row of the finer lattice.
class Row {
public:
    Row(const ExtinctionJob& job, int places) : job_(job), lattice_(lattice_of(job.volume)), places_(places) {
        per_edge_ = shortest_edge(job.cells) / job.opacity_unit;
        for (int a = 0; a < 3; ++a) spacing_[a] = spacing_of(job.volume, job.cells, a);
    }

    // Adds the extinctions of its places at the j-th along y and the k-th along z to sums.
    void add(int j, int k, float* sums) {
        const float y = place_at(j, 1), z = place_at(k, 2), at[2] = {y, z};
        vf cell[3], inside[3];
        for (int a = 1; a < 3; ++a) {
            const vf place = at[a - 1], low = min(floor(place), vf(lattice_.last[a] - 1.0f));
            cell[a] = low, inside[a] = place - low;
        }
        const int64_t bricks = brick_row(y, z);
        for (int i = 0; i < places_; i += kLanes) {
            const vf number = to_float(splat(i) + iota());
            const vf place = min((number + vf(0.5f)) * vf(spacing_[0]), vf(lattice_.last[0]));
            cell[0] = min(floor(place), vf(lattice_.last[0] - 1.0f)), inside[0] = place - cell[0];
            const vm shown = (number < vf(static_cast<float>(places_))) & is_shown(bricks, cell[0]);
            if (!any(shown)) continue;
            const vm counts = shown & is_left(place, y, z);
            if (any(counts)) store(sums + i, load(sums + i) + zero_unless(counts, extinctions(cell, inside)));
        }
    }

private:
    float place_at(int number, int axis) const {
        const float place = (static_cast<float>(number) + 0.5f) * spacing_[axis];
        return place < lattice_.last[axis] ? place : lattice_.last[axis];
    }

    int64_t brick_row(float y, float z) const {
        const auto brick = [&](float at, int axis) {
            const int b = static_cast<int>(at) / TEXGS_BRICK;
            return b < lattice_.bricks[axis] ? b : lattice_.bricks[axis] - 1;
        };
        return (int64_t(brick(z, 2)) * lattice_.bricks[1] + brick(y, 1)) * lattice_.bricks[0];
    }

    vm is_shown(int64_t bricks, vf x) const {
        return to_float(gather_bytes(job_.distance + bricks, truncate(x) >> 2) & splat(255)) < vf(0.5f);
    }

    // Whether no cut takes places away.
    vm is_left(vf x, float y, float z) const {
        const auto world = [&](vf at, int a) {
            return (at - vf(static_cast<float>(lattice_.middle[a]))) *
                   vf(static_cast<float>(1.0 / lattice_.per_unit[a]));
        };
        const vf w[3] = {world(x, 0), world(y, 1), world(z, 2)};
        vm left = vf(0.0f) < vf(1.0f);
        for (int k = 0; k < job_.n_planes; ++k) {
            const float* n = job_.planes + 4 * k;
            left = left & (fma(w[0], n[0], fma(w[1], n[1], w[2] * vf(n[2]))) <= vf(n[3]));
        }
        return left;
    }

    vf extinctions(const vf (&cell)[3], const vf (&inside)[3]) {
        static constexpr float kAhead[3] = {1.0f, 1.0f, 1.0f};
        vf all = 0.0f;
        for (int c = 0; c < job_.n; ++c) {
            const CastTable& t = job_.channels[c].table;
            vm visible = vf(0.0f) < vf(1.0f);
            if (const uint8_t* mask = job_.channels[c].within) {
                blocks_.fetch(mask, job_.volume.size, cell, kAhead, Rows::of_cell);
                visible = vf(TEXGS_INSIDE) <= values_in(blocks_, inside);
            }
            with_type(job_.channels[c].values, job_.channels[c].type,
                      [&](auto values) { blocks_.fetch(values, job_.volume.size, cell, kAhead, Rows::of_cell); });
            const vf v = values_in(blocks_, inside), opacity = Intervals(t, v).mixed(t.opacity);
            visible = visible & (vf(t.value[0]) <= v) & (v <= vf(t.value[t.n - 1])) & (vf(0.0f) < opacity);
            all -= zero_unless(visible, log2_through(opacity, vf(per_edge_)));
        }
        return min(all, kMostExtinction);
    }

    const ExtinctionJob& job_;
    const Lattice lattice_;
    const int places_;
    float per_edge_, spacing_[3];
    Blocks blocks_;
};

}  // namespace

void extinction_row(const ExtinctionJob& job, int y, int z) {
    int places[3];
    for (int a = 0; a < 3; ++a) places[a] = places_per_cell(job.volume, job.cells, a);
    const int32_t* const size = job.cells.size;
    Row row(job, places[0] * size[0]);
    float sums[kMostPlaces + kLanes] = {};
    for (int k = 0; k < places[2]; ++k)
        for (int j = 0; j < places[1]; ++j) row.add(y * places[1] + j, z * places[2] + k, sums);
    float* const to = job.extinction + (int64_t(z) * size[1] + y) * size[0];
    const float share = 1.0f / static_cast<float>(places[0] * places[1] * places[2]);
    for (int x = 0; x < size[0]; ++x) {
        float sum = 0.0f;
        for (int i = 0; i < places[0]; ++i) sum += sums[x * places[0] + i];
        to[x] = share * sum;
    }
}

}  // namespace texgs::TEXGS_ISA
