// SPDX-License-Identifier: Apache-2.0
// Kernels of one instruction set, each defined in the file of its name and gathered in table.cpp.
#pragma once
#include <cstdint>

namespace texgs {
struct Raster;
struct Candidate;
struct TexelArena;
namespace TEXGS_ISA {

extern const int64_t kForwardScratch, kBackwardScratch, kContributeScratch, kTextureScratch;
void project_surfels(const Raster&, int64_t begin, int64_t end);
int64_t bin_surfels(const Raster&, const uint32_t* order, int64_t begin, int64_t end, Candidate* out,
                    uint32_t* per_tile, uint32_t* per_surfel);
void forward_tile(const Raster&, int tile, void* scratch);
void backward_tile(const Raster&, int tile, void* scratch);
void reduce_gradients(const Raster&, int64_t begin, int64_t end);
void contribute_tile(const Raster&, int tile, void* scratch);
void reduce_contributions(const Raster&, int64_t begin, int64_t end);
void texture_backward_tile(const Raster&, int tile, void* scratch, TexelArena&);
void reduce_textures(const Raster&, int64_t begin, int64_t end, float* largest_texture);

}  // namespace TEXGS_ISA
}  // namespace texgs
