// SPDX-License-Identifier: Apache-2.0
// What a volume is at points that have nothing to do with each other.
#include "simd.h"

#include "../volume_maths.h"
#include "cell_samples.h"
#include "interleaved.h"
#include "intervals.h"
#include "volume_kernels.h"

namespace texgs::TEXGS_ISA {
namespace {

template <class T>
void lookup_range(const LookupJob& job, int64_t begin, int64_t end) {
    const Lattice lattice = lattice_of(job.volume);
    const CastTable& t = job.table;
    Blocks blocks;
    for (int64_t i = begin; i < end; i += kLanes) {
        const int n = static_cast<int>(end - i < kLanes ? end - i : kLanes);
        vf point[3], cell[3], inside[3], gradient[3];
        load_columns<3>(job.points + 3 * i, n, point);
        for (int a = 0; a < 3; ++a) {
            const vf at = fma(point[a], static_cast<float>(lattice.per_unit[a]), static_cast<float>(lattice.middle[a]));
            const vf last = lattice.last[a], place = min(max(at, 0.0f), last);
            cell[a] = min(floor(place), last - vf(1.0f));
            inside[a] = place - cell[a];
        }
        blocks.fetch_each(static_cast<const T*>(job.volume.values), job.volume.size, cell, n);
        const vf value = values_in(blocks, inside);
        if (job.to.values) store_part(job.to.values + i, value, n);
        if (job.to.colors) {
            const Intervals at(t, min(max(value, t.value[0]), t.value[t.n - 1]));
            const vf color[3] = {at.mixed(t.color[0]), at.mixed(t.color[1]), at.mixed(t.color[2])};
            store_columns<3>(job.to.colors + 3 * i, color, n);
        }
        if (!job.to.gradients && !job.to.quats) continue;
        differences_in(blocks, inside, gradient);
        for (int a = 0; a < 3; ++a) gradient[a] = gradient[a] * vf(static_cast<float>(0.5 * lattice.per_unit[a]));
        if (job.to.gradients) store_columns<3>(job.to.gradients + 3 * i, gradient, n);
        if (job.to.quats) {
            const vf scale = 1.0f / (t.value[t.n - 1] - t.value[0]);  // what `unit` takes for 0 is relative
            vf quat[4];
            turn_z_to(unit(Vec3<vf>{gradient[0] * scale, gradient[1] * scale, gradient[2] * scale}), quat);
            store_columns<4>(job.to.quats + 4 * i, quat, n);
        }
    }
}

}  // namespace

void lookup(const LookupJob& job, int64_t begin, int64_t end) {
    using Lookup = void (*)(const LookupJob&, int64_t, int64_t);
    static constexpr Lookup kLookup[] = {
        lookup_range<uint8_t>,  lookup_range<int8_t>,  lookup_range<uint16_t>, lookup_range<int16_t>,
        lookup_range<uint32_t>, lookup_range<int32_t>, lookup_range<uint64_t>, lookup_range<int64_t>,
        lookup_range<float>,    lookup_range<double>,
    };
    kLookup[job.volume.type](job, begin, end);
}

}  // namespace texgs::TEXGS_ISA
