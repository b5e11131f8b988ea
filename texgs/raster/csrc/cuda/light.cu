// SPDX-License-Identifier: Apache-2.0
// Light inside of volumes on GPUs: a thread for each cell, or for each column along which light goes.
#include "light.cuh"

#include <algorithm>
#include <vector>

#include "../cuts.h"
#include "../light_maths.h"
#include "../volume_bricks.h"
#include "workspace.cuh"

using namespace texgs;
using namespace texgs::cuda;

namespace texgs::cuda {
namespace {

// -- Extinctions -------------------------------------------------------------------------------------------------

// The places in cells whose extinctions count, and what takes some away.
struct Places {
    int size[3], per_cell[3];                    // cells, and places in each of them
    float spacing[3], middle[3], per_sample[3];  // in samples; world = (place - middle) * per_sample
    float lengths;                               // opacity units along the shortest edge of a cell
    int n_planes;
    float planes[TEXGS_MAX_PLANES][4] = {};

    Places(const texgs_volume& volume, const texgs_cells& cells, float opacity_unit, const float* cuts, int n)
        : lengths(shortest_edge(cells) / opacity_unit), n_planes(n) {
        const Lattice lattice = lattice_of(volume);
        for (int a = 0; a < 3; ++a) {
            size[a] = cells.size[a], per_cell[a] = places_per_cell(volume, cells, a);
            spacing[a] = spacing_of(volume, cells, a);
            middle[a] = static_cast<float>(lattice.middle[a]);
            per_sample[a] = static_cast<float>(1.0 / lattice.per_unit[a]);
        }
        for (int k = 0; k < n; ++k) std::copy_n(cuts + 4 * k, 4, planes[k]);
    }
    // Whether no cut takes a place away.
    __device__ bool is_left(const float (&at)[3]) const {
        float w[3];
        for (int a = 0; a < 3; ++a) w[a] = (at[a] - middle[a]) * per_sample[a];
        for (int k = 0; k < n_planes; ++k) {
            const float (&n)[4] = planes[k];
            if (!(fma(w[0], n[0], fma(w[1], n[1], w[2] * n[2])) <= n[3])) return false;
        }
        return true;
    }
};

// The extinction of all channels at a place.
template <class T>
__device__ float extinction_at(const Lattice& lattice, const Channels& channels, const uint8_t* distance,
                               const Places& places, const float (&at)[3]) {
    const Spot spot(lattice.last, at);
    const int64_t row = int64_t(spot.cell[2] / TEXGS_BRICK) * lattice.bricks[1] + spot.cell[1] / TEXGS_BRICK;
    if (distance[row * lattice.bricks[0] + spot.cell[0] / TEXGS_BRICK] || !places.is_left(at)) return 0.0f;
    float all = 0.0f;
    for (int c = 0; c < channels.n; ++c)
        if (channels.has(c, spot))
            all -= log2_through_at(channels.transfer[c], spot.value(channels.samples<T>(c)), places.lengths);
    return fminf(all, kMostExtinction);
}

template <class T>
__global__ __launch_bounds__(kThreads, 1) void extinction_kernel(const Lattice lattice, const Channels channels,
                                                                 const uint8_t* distance, const Places places,
                                                                 int64_t cells, float* extinction) {
    const int64_t i = thread_index();
    if (i >= cells) return;
    const int* const size = places.size;
    const int cell[3] = {static_cast<int>(i % size[0]), static_cast<int>(i / size[0] % size[1]),
                         static_cast<int>(i / size[0] / size[1])};
    const auto at = [&](int place, int a) {
        const float number = static_cast<float>(cell[a] * places.per_cell[a] + place);
        return fminf((number + 0.5f) * places.spacing[a], lattice.last[a]);
    };
    float sum = 0.0f;
    for (int x = 0; x < places.per_cell[0]; ++x) {
        float of_rows = 0.0f;
        for (int z = 0; z < places.per_cell[2]; ++z)
            for (int y = 0; y < places.per_cell[1]; ++y)
                of_rows += extinction_at<T>(lattice, channels, distance, places, {at(x, 0), at(y, 1), at(z, 2)});
        sum += of_rows;
    }
    extinction[i] = 1.0f / static_cast<float>(places.per_cell[0] * places.per_cell[1] * places.per_cell[2]) * sum;
}

// -- Columns -----------------------------------------------------------------------------------------------------

// A light, and the matter that it goes through.
struct Beam {
    Columns columns;
    const float* extinction;
    int u, v, w;  // from a cell to the next along each axis of the columns
    float per_slice;
    int reach;  // slices whose matter counts

    Beam(const texgs_cells& cells, const float* extinction, const Columns& columns, int reach)
        : columns(columns), extinction(extinction), per_slice(columns.length / shortest_edge(cells)), reach(reach) {
        const int strides[3] = {1, cells.size[0], cells.size[0] * cells.size[1]};
        u = strides[columns.u], v = strides[columns.v], w = strides[columns.w];
    }
    int64_t count_columns() const { return int64_t(columns.wide) * columns.high; }
    int64_t count_places() const { return columns.slices * count_columns(); }

    // What column (U, V) meets in a slice: what is between centres is linear, and 0 beyond them.
    __device__ float met(int U, int V, int slice) const {
        const Columns& c = columns;
        const Shift shift_u(shift_of(c, 0, slice)), shift_v(shift_of(c, 1, slice));
        const int first_u = U + shift_u.steps, first_v = V + shift_v.steps;
        const float* const from = extinction + int64_t(place_of(c, slice)) * w;
        const auto at = [&](int i, int j) {
            return i < 0 || i >= c.n_u || j < 0 || j >= c.n_v ? 0.0f : from[int64_t(j) * v + int64_t(i) * u];
        };
        return per_slice * mix(mix(at(first_u, first_v), at(first_u + 1, first_v), shift_u.rest),
                               mix(at(first_u, first_v + 1), at(first_u + 1, first_v + 1), shift_u.rest), shift_v.rest);
    }
};

// through [slice, V, U]: what reaches the middle of each column in each slice.
__global__ __launch_bounds__(kThreads) void through_kernel(const Beam beam, int64_t count, float* through) {
    const int64_t i = thread_index();
    if (i >= count) return;
    const int U = static_cast<int>(i % beam.columns.wide), V = static_cast<int>(i / beam.columns.wide);
    float sum = 0.0f;
    for (int slice = 0; slice < beam.columns.slices; ++slice) {
        const float more = beam.met(U, V, slice);
        const float less = slice >= beam.reach ? beam.met(U, V, slice - beam.reach) : 0.0f;
        through[slice * count + i] = exp2(-fmaxf(fma(more - less, 0.5f, sum), 0.0f));
        sum += more - less;
    }
}

// Adds the share that reaches each cell to sums [z, y, x].
__global__ __launch_bounds__(kThreads) void shares_kernel(const Beam beam, const float* through, int64_t cells,
                                                          float* sums) {
    const int64_t i = thread_index();
    if (i >= cells) return;
    const Columns& c = beam.columns;
    const int u = static_cast<int>(i / beam.u % c.n_u), v = static_cast<int>(i / beam.v % c.n_v),
              slice = place_of(c, static_cast<int>(i / beam.w % c.slices));
    const Shift shift_u(-shift_of(c, 0, slice)), shift_v(-shift_of(c, 1, slice));
    const float* const p = through + (int64_t(slice) * c.high + v + shift_v.steps) * c.wide + u + shift_u.steps;
    sums[i] += mix(mix(p[0], p[1], shift_u.rest), mix(p[c.wide], p[c.wide + 1], shift_u.rest), shift_v.rest);
}

// Writes the scaled sums of cells to every other byte of light, two of a word by each thread.
__global__ __launch_bounds__(kThreads) void bytes_kernel(const float* sums, float scale, int64_t cells,
                                                         uint8_t* light) {
    const int64_t first = 2 * thread_index();
    for (int64_t i = first; i < first + 2 && i < cells; ++i)
        light[2 * i] = static_cast<uint8_t>(fminf(scale * sums[i], 1.0f) * 255.0f + 0.5f);
}

// Writes the scaled sum of what beams leave of their light.
void write_shares(Workspace& workspace, const texgs_cells& cells, const std::vector<Beam>& beams, float scale,
                  uint8_t* light, cudaStream_t stream) {
    const int64_t count = count_cells(cells), blocks = blocks_for(count, kThreads);
    int64_t most = 0;
    for (const Beam& beam : beams) most = std::max(most, beam.count_places());
    float* const through = workspace.planes.ensure<float>(most);
    float* const sums = workspace.sums.ensure<float>(count);
    check(cudaMemsetAsync(sums, 0, sizeof(float) * static_cast<size_t>(count), stream), "clearing sums");
    for (const Beam& beam : beams) {
        const int64_t columns = beam.count_columns();
        launch(through_kernel, blocks_for(columns, kThreads), kThreads, stream, beam, columns, through);
        launch(shares_kernel, blocks, kThreads, stream, beam, through, count, sums);
    }
    launch(bytes_kernel, blocks_for(count, 2 * kThreads), kThreads, stream, sums, scale, count, light);
}

// -- Points ------------------------------------------------------------------------------------------------------

__global__ __launch_bounds__(kThreads) void light_lookup_kernel(const texgs_cells cells, const uint8_t* light,
                                                                int64_t n, const float* points, float* shares) {
    const int64_t i = thread_index();
    if (i >= n) return;
    float place[3];
    for (int a = 0; a < 3; ++a) {
        const float size = static_cast<float>(cells.size[a]);
        place[a] = fma(points[3 * i + a], size / (2.0f * cells.half[a]), 0.5f * (size - 1.0f));
    }
    const Shares both = shares_at(light, cells.size, place);
    shares[2 * i] = both.lamp * (1.0f / 255.0f), shares[2 * i + 1] = both.sky * (1.0f / 255.0f);
}

}  // namespace
}  // namespace texgs::cuda

int32_t texgs_extinction(const texgs_volume* volume, const texgs_transfer* transfer, int32_t n, const uint8_t* distance,
                         float opacity_unit, const float* planes, int32_t n_planes, const texgs_cells* cells,
                         float* extinction, void* on) {
    return on_device_of(extinction, on, [&](cudaStream_t stream) {
        check_channels(volume, transfer, n);
        check_cells(*cells);
        check_planes(n_planes);
        require(opacity_unit > 0.0f, "light: expected an opacity unit above 0");
        const Places places(*volume, *cells, opacity_unit, planes, n_planes);
        const int64_t count = count_cells(*cells);
        with_type_of(volume, n, [&](auto sample) {
            launch(extinction_kernel<decltype(sample)>, blocks_for(count, kThreads), kThreads, stream,
                   lattice_of(*volume), Channels(volume, transfer, n), distance, places, count, extinction);
        });
    });
}

int32_t texgs_transmittance(const texgs_cells* cells, const float* extinction, const float to_light[3], uint8_t* light,
                            void* on) {
    return with_workspace(light, on, [&](Workspace& workspace, cudaStream_t stream) {
        check_cells(*cells);
        const Columns columns = columns_of(*cells, {to_light[0], to_light[1], to_light[2]});
        write_shares(workspace, *cells, {Beam(*cells, extinction, columns, columns.slices)}, 1.0f, light, stream);
    });
}

int32_t texgs_openness(const texgs_cells* cells, const float* extinction, int32_t n, const float* directions,
                       float reach, uint8_t* light, void* on) {
    return with_workspace(light, on, [&](Workspace& workspace, cudaStream_t stream) {
        check_cells(*cells);
        require(n > 0 && reach > 0.0f, "light: expected directions and a reach above 0");
        std::vector<Beam> beams;
        for (int i = 0; i < n; ++i) {
            const float* const to = directions + 3 * i;
            const Columns columns = columns_of(*cells, {to[0], to[1], to[2]});
            beams.emplace_back(*cells, extinction, columns, reach_in_slices(columns, reach));
        }
        write_shares(workspace, *cells, beams, share_of(n), light + 1, stream);
    });
}

int32_t texgs_light_lookup(const texgs_cells* cells, const uint8_t* light, int64_t n, const float* points,
                           float* shares, void* on) {
    return on_device_of(shares, on, [&](cudaStream_t stream) {
        check_cells(*cells);
        launch(light_lookup_kernel, blocks_for(n, kThreads), kThreads, stream, *cells, light, n, points, shares);
    });
}
