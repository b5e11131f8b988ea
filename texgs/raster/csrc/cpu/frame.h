// SPDX-License-Identifier: Apache-2.0
// One view: its buffers, and the order of the passes over it.
#pragma once
#include <memory>
#include <vector>

#include "kernels.h"
#include "memory.h"
#include "sort.h"
#include "texel_arena.h"

// Grow-only buffers of one view. Frames are reused: a training loop works with the same one or two.
struct texgs_frame {
    // Projects, sorts and bins the surfels; leaves everything that rendering needs in `raster`.
    void bin(const texgs_surfels&, const texgs_camera&, const texgs_options&, const texgs_image&);
    void render();
    void differentiate(const texgs_image& image, const texgs_image& grad, const texgs_gradients& out);
    void contribute(const texgs_contributions&);

    // The caller's memory may have moved since the last call.
    void attach(const texgs_surfels& surfels, const texgs_camera& camera, const texgs_options& options);

    texgs::Raster raster{};
    int64_t pairs = 0;

private:
    int64_t project();
    void bound_depths();
    void bin_tiles(const uint32_t* order, int64_t visible, int64_t most_candidates);
    const uint32_t* sort(int64_t& visible);
    template <class Kernel>
    void for_tiles(Kernel kernel);
    template <class Kernel>
    void backward_pass(Kernel kernel);
    template <class Kernel>
    void reduce_pass(Kernel kernel);
    void ensure_slots(int floats);
    void geometry_gradients();
    void feature_gradients();
    void texture_gradients();

    texgs::DepthSort sort_;
    texgs::Buffer records_, footprints_, flags_, normals_, keys_, candidates_, part_begin_, per_tile_, per_surfel_,
        tile_begin_, pairs_, slot_begin_, square_ranges_, scratch_, median_stop_, moments_, slots_, texel_parts_,
        zeros_;
    std::vector<std::unique_ptr<texgs::BlockArena>> arenas_;
};
