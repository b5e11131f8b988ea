// SPDX-License-Identifier: Apache-2.0
// Rays through a volume. Samples in cells where something may show wait until there are some vectors of them; so do
// those among them that show something, which are shaded: no lane is empty but at the end of a ray.
#include "simd.h"

#include "../volume_maths.h"
#include "cell_samples.h"
#include "intervals.h"
#include "light_shares.h"
#include "volume_kernels.h"

namespace texgs::TEXGS_ISA {
namespace {

// Samples of a ray go through each stage in several vectors: the processor works on one while another waits.
constexpr int kVectors = 4, kSamples = kVectors * kLanes;

// Samples of a ray that wait until there are kSamples of them, by their numbers.
struct Queue {
    int n = 0;
    float k[kSamples + kLanes], value[kSamples + kLanes], weight[kSamples + kLanes];

    bool is_full() const { return n >= kSamples; }
    // Vectors that hold the first kSamples samples, or all of them; other lanes repeat the last one, as what is not
    // finite there would reach sums that only set a weight to 0.
    int vectors() {
        if (!is_full()) {
            store(k + n, vf(k[n - 1]));
            store(value + n, vf(value[n - 1]));
        }
        return is_full() ? kVectors : (n + kLanes - 1) / kLanes;
    }
    // Adds those of a vector of samples that are chosen.
    void add(vf number, vf its_value, vf its_weight, vm chosen) {
        store_chosen(k + n, number, chosen);
        store_chosen(value + n, its_value, chosen);
        store_chosen(weight + n, its_weight, chosen);
        n += count(chosen);
    }
    // Takes these samples away.
    void drop() {
        n = is_full() ? n - kSamples : 0;
        float* const arrays[] = {k, value, weight};
        for (float* of : arrays) store(of, load(of + kSamples));
    }
};

// Where the samples of a stage are: their cells, and the places in these.
struct Places {
    vf cell[kVectors][3], inside[kVectors][3];
};

// Where cells are among those that may show something.
struct CellBits {
    vi brick, word, bit;

    TEXGS_INLINE CellBits(const Lattice& lattice, const vf (&cell)[3]) {
        const vi x = truncate(cell[0]), y = truncate(cell[1]), z = truncate(cell[2]);
        const vi row = (z >> 2) * splat(lattice.bricks[1]) + (y >> 2);
        brick = row * splat(lattice.bricks[0]) + (x >> 2);
        word = brick * splat(2) + ((z >> 1) & splat(1));
        bit = (z & splat(1)) * splat(16) + (y & splat(3)) * splat(4) + (x & splat(3));
    }
    TEXGS_INLINE vm are_in(const uint32_t* cells) const {
        return is_set(gather(reinterpret_cast<const int32_t*>(cells), word), bit);
    }
};

// What a ray gathers.
struct Sums {
    vf color[3], normal[3], depth = 0.0f;
    float median = 0.0f, light = 1.0f;
};

class Caster {
public:
    Caster(const CastJob& job)
        : job_(job),
          lattice_(lattice_of(job.volume)),
          lamp_(lamp_of(job.view)),
          light_cells_(light_cells_of(lattice_, job.view)) {
        for (int a = 0; a < 3; ++a) box_.lower[a] = job.lower[a], box_.upper[a] = job.upper[a];
        for (int c = 0; c < job.n; ++c) {
            const CastTable& t = job.channels[c].table;
            for (int a = 0; a < 3; ++a)
                slope_[c][a] = static_cast<float>(lattice_.per_unit[a] / (t.value[t.n - 1] - t.value[0]));
        }
    }

    void cast(int x, int y) {
        const int64_t pixel = int64_t(y) * job_.view.width + x;
        if (is_empty(pixel)) return;  // images start as zeros
        Sums sums;
        for (int a = 0; a < 3; ++a) sums.color[a] = 0.0f, sums.normal[a] = 0.0f;
        const CastRay ray = cast_ray(lattice_, job_.view, x, y);
        Queue waiting;
        int32_t k, end;
        clip(ray, box_, k, end);
        while (k < end && sums.light >= kOpaque) {
            float place[3];
            int32_t brick[3];
            if (const int distance = distance_at(ray, k, place, brick)) {
                k = leap(ray, k, place, brick, distance);
                continue;
            }
            const vf next = to_float(splat(k) + iota());
            const vm chosen = are_visible(ray, next) & (next < vf(static_cast<float>(end)));
            store_chosen(waiting.k + waiting.n, next, chosen);
            waiting.n += count(chosen);
            if (waiting.is_full()) weigh(ray, waiting, sums);
            k += kLanes;
        }
        if (waiting.n && sums.light >= kOpaque) weigh(ray, waiting, sums);
        for (int c = 0; c < job_.n; ++c)
            if (seen_[c].n) shade(ray, c, sums);
        write(pixel, sums);
    }

private:
    // Whether a cut leaves nothing of a pixel's ray.
    bool is_empty(int64_t pixel) const {
        const texgs_cast_view& v = job_.view;
        return v.depth_range && !(v.depth_range[pixel] < v.depth_range[int64_t(v.width) * v.height + pixel]);
    }

    // How far the brick of sample k is from one in which something shows.
    int distance_at(const CastRay& ray, int32_t k, float place[3], int32_t brick[3]) const {
        for (int a = 0; a < 3; ++a) {
            place[a] = ray.entry[a] + (static_cast<float>(k) + 0.5f) * ray.step[a];
            const int32_t cell = static_cast<int32_t>(place[a] > 0.0f ? place[a] : 0.0f) / TEXGS_BRICK;
            brick[a] = cell < lattice_.bricks[a] ? cell : lattice_.bricks[a] - 1;
        }
        const int64_t row = int64_t(brick[2]) * lattice_.bricks[1] + brick[1];
        return job_.distance[row * lattice_.bricks[0] + brick[0]];
    }

    // Whether samples are in cells in which something may show; where these are not known, in bricks.
    vm are_visible(const CastRay& ray, vf k) const {
        vf corner[3], inside[3];
        locate(ray, k, corner, inside);
        const CellBits at(lattice_, corner);
        if (!job_.cells) return to_float(gather_bytes(job_.distance, at.brick) & splat(255)) < vf(0.5f);
        return at.are_in(job_.cells);
    }

    // Cells of samples and the places in them.
    TEXGS_INLINE void locate(const CastRay& ray, vf k, vf (&cell)[3], vf (&inside)[3]) const {
        for (int a = 0; a < 3; ++a) {
            const vf last = lattice_.last[a], at = fma(k + vf(0.5f), ray.step[a], ray.entry[a]);
            const vf place = min(max(at, 0.0f), last);
            cell[a] = min(floor(place), last - vf(1.0f));
            inside[a] = place - cell[a];
        }
    }

    // Finds what the first samples weigh, and lets those that show something wait.
    void weigh(const CastRay& ray, Queue& waiting, Sums& sums) {
        const int vectors = waiting.vectors();
        vf value[TEXGS_CHANNELS][kVectors], through[TEXGS_CHANNELS][kVectors], all[kVectors];
        Places at;
        locate(ray, waiting, vectors, at);
        for (int c = 0; c < job_.n; ++c) {
            const CastTable& t = job_.channels[c].table;
            vm shown[kVectors];
            choose(ray, waiting, at, vectors, job_.channels[c], shown);
            fetch(ray, at, vectors, job_.channels[c], Rows::of_cell, shown);
            for (int i = 0; i < vectors; ++i) {
                if (c == 0) all[i] = 0.0f;
                value[c][i] = through[c][i] = 0.0f;
                if (!any(shown[i])) continue;
                const vf v = values_in(blocks_[i], at.inside[i]), opacity = Intervals(t, v).mixed(t.opacity);
                const vm visible = (vf(t.value[0]) <= v) & (v <= vf(t.value[t.n - 1])) & (vf(0.0f) < opacity);
                const vf lengths =
                    vf(job_.view.step / job_.view.opacity_unit) * share(ray, load(waiting.k + i * kLanes));
                value[c][i] = v;
                through[c][i] = zero_unless(visible & shown[i], log2_through(opacity, lengths));
                all[i] += through[c][i];
            }
        }
        for (int i = 0; i < vectors && sums.light >= kOpaque; ++i) {
            const float* const k = waiting.k + i * kLanes;
            const vf weight = absorb(ray, k, opacity_of(all[i]), sums);
            for (int c = 0; c < job_.n; ++c) {
                const vm is_seen = (vf(0.0f) < weight) & (through[c][i] < vf(0.0f));
                if (!any(is_seen)) continue;
                seen_[c].add(load(k), value[c][i], weight * (through[c][i] / all[i]), is_seen);
                if (seen_[c].is_full()) shade(ray, c, sums);
            }
        }
        waiting.drop();
    }

    // Takes light away where samples have some opacity; returns what each of them weighs.
    TEXGS_INLINE vf absorb(const CastRay& ray, const float* k, vf alpha, Sums& sums) const {
        const vf behind = running_product(vf(1.0f) - alpha) * vf(sums.light);
        float light[kLanes + 1];  // before each sample and behind it
        light[0] = sums.light;
        store(light + 1, behind);
        const vf before = load(light), weight = before * alpha;
        const vm is_seen = (vf(0.0f) < weight) & (vf(kOpaque) <= before);
        if (sums.light > 0.5f && light[kLanes] <= 0.5f)
            sums.median = ray.near + (k[count(vf(0.5f) < behind)] + 0.5f) * ray.z;
        sums.light = light[count(vf(kOpaque) <= before)];
        sums.depth = fma_where(is_seen, weight, fma(load(k) + vf(0.5f), ray.z, ray.near), sums.depth);
        return zero_unless(is_seen, weight);
    }

    // Adds what the first samples of a channel that show something look like.
    void shade(const CastRay& ray, int c, Sums& sums) {
        const CastTable& t = job_.channels[c].table;
        Queue& seen = seen_[c];
        const int vectors = seen.vectors();
        Places at;
        locate(ray, seen, vectors, at);
        fetch(ray, at, vectors, job_.channels[c], Rows::around);
        for (int i = 0; i < vectors; ++i) {
            vf slope[3];
            differences_in(blocks_[i], at.inside[i], slope);
            const float* const s = slope_[c];
            Vec3<vf> n = unit(Vec3<vf>{slope[0] * vf(s[0]), slope[1] * vf(s[1]), slope[2] * vf(s[2])});
            const Intervals intervals(t, load(seen.value + i * kLanes));
            const Vec3<vf> color{intervals.mixed(t.color[0]), intervals.mixed(t.color[1]), intervals.mixed(t.color[2])};
            const vf k = load(seen.k + i * kLanes);
            const Vec3<vf> shown = lit(ray, k, color, n, lamp_, exposed(ray, k, n));
            const Vec3<vf> against = turned(n, vf(0.0f) - along(n, ray.direction));
            const vf looks[3] = {shown.x, shown.y, shown.z}, normals[3] = {against.x, against.y, against.z};
            const vm is_used = to_float(iota()) < vf(static_cast<float>(seen.n - i * kLanes));
            for (int a = 0; a < 3; ++a) {
                sums.color[a] = fma_where(is_used, load(seen.weight + i * kLanes), looks[a], sums.color[a]);
                sums.normal[a] = fma_where(is_used, load(seen.weight + i * kLanes), normals[a], sums.normal[a]);
            }
        }
        seen.drop();
    }

    // What reaches samples k of the light.
    TEXGS_INLINE Exposure<vf> exposed(const CastRay& ray, vf k, Vec3<vf> normal) const {
        const texgs_cast_view& view = job_.view;
        if (!view.light) return {};
        const Vec3<vf> out = outward(ray, k, normal, lamp_);
        const vf outs[3] = {out.x, out.y, out.z};
        vf place[3];
        for (int a = 0; a < 3; ++a) {
            const vf at = fma(k + vf(0.5f), ray.step[a], ray.entry[a]);
            place[a] = fma(at, light_cells_.scale[a], fma(outs[a], light_cells_.outset[a], light_cells_.shift[a]));
        }
        const Shares shares = shares_at(view.light, view.light_size, place);
        return exposure_of(view, shares.lamp, shares.sky);
    }

    // Finds where the first samples are.
    TEXGS_INLINE void locate(const CastRay& ray, const Queue& samples, int vectors, Places& at) const {
        for (int i = 0; i < vectors; ++i) locate(ray, load(samples.k + i * kLanes), at.cell[i], at.inside[i]);
    }

    // Chooses those of the first samples that are in cells of a channel, and in its mask.
    TEXGS_INLINE void choose(const CastRay& ray, const Queue& waiting, const Places& at, int vectors,
                             const CastChannel& channel, vm (&chosen)[kVectors]) {
        for (int i = 0; i < vectors; ++i) {
            chosen[i] = to_float(iota()) < vf(static_cast<float>(waiting.n - i * kLanes));
            if (channel.cells) chosen[i] = chosen[i] & CellBits(lattice_, at.cell[i]).are_in(channel.cells);
            if (!channel.within || !any(chosen[i])) continue;
            blocks_[i].fetch(channel.within, job_.volume.size, at.cell[i], ray.ahead, Rows::of_cell);
            chosen[i] = chosen[i] & (vf(TEXGS_INSIDE) <= values_in(blocks_[i], at.inside[i]));
        }
    }

    // Loads the blocks around vectors of samples: all, or those of which some are chosen.
    TEXGS_INLINE void fetch(const CastRay& ray, const Places& at, int vectors, const CastChannel& channel, Rows rows,
                            const vm* chosen = nullptr) {
        with_type(channel.values, channel.type, [&](auto samples) {
            for (int i = 0; i < vectors; ++i)
                if (!chosen || any(chosen[i])) blocks_[i].fetch(samples, job_.volume.size, at.cell[i], ray.ahead, rows);
        });
    }

    void write(int64_t pixel, const Sums& sums) const {
        const texgs_cast_view& v = job_.view;
        const float alpha = 1.0f - sums.light, per_alpha = alpha > 0.0f ? 1.0f / alpha : 0.0f;
        for (int c = 0; c < 3; ++c) v.rgba[4 * pixel + c] = sum(sums.color[c]);
        v.rgba[4 * pixel + 3] = alpha;
        if (v.depth) v.depth[pixel] = sum(sums.depth) * per_alpha;
        if (v.median) v.median[pixel] = sums.median;
        if (v.normal)
            for (int c = 0; c < 3; ++c) v.normal[3 * pixel + c] = sum(sums.normal[c]) * per_alpha;
    }

    const CastJob& job_;
    const Lattice lattice_;
    const Lamp lamp_;
    const LightCells light_cells_;
    Extent box_;
    Blocks blocks_[kVectors];
    Queue seen_[TEXGS_CHANNELS];  // samples of each channel that show something; empty between rays
    float slope_[TEXGS_CHANNELS][3];
};

void cast(const CastJob& job, int y, int begin, int end) {
    Caster caster(job);
    for (int x = begin; x < end; ++x) caster.cast(x, y);
}

}  // namespace

const VolumeKernels kVolumeKernels = {cast, lookup};

}  // namespace texgs::TEXGS_ISA
