// SPDX-License-Identifier: Apache-2.0
// One view: its buffers, and the order of the passes over it.
//
// The host never waits for the device to bin a view before it has queued the rendering. How many pairs of surfels and
// tiles there are is known on the device only; room for them is a guess from the views before, with headroom. Where it
// falls short, the forward pass finds the rest by itself (forward.cu); the true number reaches the host meanwhile, and
// the next view gets the room it needs. There are two exceptions:
// - the first view of a frame, or one with many more surfels or tiles than any before, waits for the number;
// - passes that need a slot for every pair (backward, contribute) wait for it too, but at that time the device is
//   rendering: it does not run dry.
#pragma once
#include "memory.cuh"
#include "raster.cuh"
#include "sort.cuh"

// Grow-only buffers of one view on one device. Frames are reused: a training loop works with the same one or two.
struct texgs_frame {
    explicit texgs_frame(int device) : device(device) {}

    // Projects, sorts and bins the surfels; leaves everything that rendering needs in `raster`.
    void bin(const texgs_surfels&, const texgs_camera&, const texgs_options&, const texgs_image&, cudaStream_t);
    void render(cudaStream_t);
    void differentiate(const texgs_image& image, const texgs_image& grad, const texgs_gradients& out, cudaStream_t);
    void contribute(const texgs_contributions&, cudaStream_t);

    // The caller's memory may have moved since the last call.
    void attach(const texgs_surfels& surfels, const texgs_camera& camera, const texgs_options& options);

    const int device;
    texgs::cuda::Mark last_use;  // what the last call put into its stream
    texgs::cuda::Raster raster{};

private:
    void project(cudaStream_t);
    void count_pairs(cudaStream_t);
    int64_t room_for_pairs(bool wait);
    void list_pairs(int64_t capacity, cudaStream_t);
    void list_all_pairs(cudaStream_t);
    void* sort_scratch(int64_t n);
    void slots(int width);
    void texel_gradients(cudaStream_t);

    texgs::cuda::Late n_pairs_;
    int64_t most_pairs_ = 0, most_surfels_ = 0, most_tiles_ = 0;  // of the views whose number of pairs is known
    texgs::cuda::Buffer records_, footprints_, normals_, keys_, keys2_, order_, order2_, pair_begin_, scratch_, listed_,
        tiles_, tiles2_, tile_slots_, tile_slots2_, tile_begin_, tile_keys_, tile_keys2_, tile_order_, tile_order2_,
        median_, moments_, slots_, sums_, texel_sums_, magnitudes_;
};
