// SPDX-License-Identifier: Apache-2.0
// Distances on a lattice, by the largest of the three axes.
#pragma once
#include <cstdint>

namespace texgs {

// How far it is from each place of a lattice to the nearest with 0, at most 255; all others have 255 before. Sides from
// the slowest axis to the fastest.
void spread_distances(const int64_t (&sides)[3], uint8_t* distance);

}  // namespace texgs
