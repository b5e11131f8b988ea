// SPDX-License-Identifier: Apache-2.0
// Distances on a lattice, by the largest of the three axes.
#pragma once
#include "device.cuh"

namespace texgs::cuda {

// How far it is from each place of a lattice to the nearest with 0 in `shown`, at most 255; all others have 255 there.
// Sides from the slowest axis to the fastest. `shown` is overwritten; both have whole words.
void spread_distances(const int (&sides)[3], uint8_t* shown, uint8_t* distance, cudaStream_t);

}  // namespace texgs::cuda
