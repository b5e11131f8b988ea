// SPDX-License-Identifier: Apache-2.0
// What a slot holds: sums over the fragments of one primitive in one tile. Every pass that fills, adds up or reads
// slots takes the places of its sums from here.
#pragma once

namespace texgs {

// A slot of gradients holds the sums of the geometry, those of the depth where it has a gradient, and one per channel:
// the channels begin at kGeometry, or with a depth at kAll.
// Of a surfel, see SurfelMoments (surfel.h):
struct SurfelSums {
    enum { kUdx, kUdy, kU, kVdx, kVdy, kV, kWdx, kWdy, kDiscDx, kDiscDy, kE, kGeometry, kZc = kGeometry, kZp, kAll };
};
// Of a 3D Gaussian, see GaussianMoments (gaussian.h):
struct GaussianSums {
    enum { kE, kU, kV, kUU, kUV, kVV, kGeometry, kZ = kGeometry, kAll };
};

inline int first_channel(int axes, bool depth) {
    if (axes == 3) return depth ? GaussianSums::kAll : GaussianSums::kGeometry;
    return depth ? SurfelSums::kAll : SurfelSums::kGeometry;
}

// A slot of contributions: sum and largest of the weights, number of pixels, and one sum per channel.
struct ContributionSums {
    enum { kWeight, kLargest, kPixels, kChannels };
};

}  // namespace texgs
