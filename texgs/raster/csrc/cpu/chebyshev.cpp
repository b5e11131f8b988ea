// SPDX-License-Identifier: Apache-2.0
#include "chebyshev.h"

#include <algorithm>
#include <vector>

namespace texgs {
namespace {

constexpr int kFarthest = 255;

// A copy of the lattice with one place more on each side, which is farthest.
class Padded {
public:
    explicit Padded(const int64_t (&sides)[3]) : sides_{sides[0], sides[1], sides[2]}, row_(sides[2] + 2) {
        plane_ = row_ * (sides[1] + 2);
        distance_.assign(plane_ * (sides[0] + 2), kFarthest);
        for (int64_t i = 0; i < 13; ++i)  // places 0 to 12 of 27: those before the middle
            before_[i] = (i / 9 - 1) * plane_ + (i / 3 % 3 - 1) * row_ + i % 3 - 1;
    }

    // Calls body(place of the first, row of it here) for all rows, forwards.
    template <class Body>
    void for_rows(const Body& body) {
        const int64_t rows = sides_[0] * sides_[1];
        for (int64_t i = 0; i < rows; ++i) body(i * sides_[2], row(i));
    }

    // Two sweeps, each looking at the 13 neighbours that it has passed: exact for these distances.
    void sweep() {
        const int64_t rows = sides_[0] * sides_[1], n = sides_[2];
        for (int64_t i = 0; i < rows; ++i)
            for (int64_t k = 0; k < n; ++k) update(row(i) + k, 1);
        for (int64_t i = rows; i-- > 0;)
            for (int64_t k = n; k-- > 0;) update(row(i) + k, -1);
    }

private:
    uint8_t* row(int64_t i) { return distance_.data() + (i / sides_[1] + 1) * plane_ + (i % sides_[1] + 1) * row_ + 1; }
    void update(uint8_t* place, int64_t side) {
        if (*place == 0) return;
        int least = kFarthest - 1;
        for (const int64_t offset : before_) least = std::min<int>(least, place[side * offset]);
        *place = std::min<uint8_t>(*place, static_cast<uint8_t>(least + 1));
    }

    int64_t sides_[3], row_, plane_, before_[13];
    std::vector<uint8_t> distance_;
};

}  // namespace

void spread_distances(const int64_t (&sides)[3], uint8_t* distance) {
    Padded padded(sides);
    const int64_t n = sides[2];
    padded.for_rows([&](int64_t first, uint8_t* row) { std::copy_n(distance + first, n, row); });
    padded.sweep();
    padded.for_rows([&](int64_t first, uint8_t* row) { std::copy_n(row, n, distance + first); });
}

}  // namespace texgs
