// SPDX-License-Identifier: Apache-2.0
// Rays through a volume. Samples in bricks where something may show wait until there is a vector of them; so do those
// among them that show something, which are shaded: no lane is empty but at the end of a ray.
#include "simd.h"

#include "../volume_maths.h"
#include "cell_samples.h"
#include "volume_kernels.h"

namespace texgs::TEXGS_ISA {
namespace {

// Samples of a ray that wait for a vector to be full, by their numbers.
struct Queue {
    int n = 0;
    float k[2 * kLanes], value[2 * kLanes], weight[2 * kLanes];

    // Takes the first samples away.
    void drop(int count) {
        n = n > count ? n - count : 0;
        for (int i = 0; i < n; ++i) k[i] = k[count + i], value[i] = value[count + i], weight[i] = weight[count + i];
    }
    // The numbers of the first `used` samples; other lanes repeat the last one.
    vf numbers(int used) const {
        float lanes[kLanes];
        for (int i = 0; i < kLanes; ++i) lanes[i] = k[i < used ? i : used - 1];
        return load(lanes);
    }
};

// Samples of few bytes in rows that are shorter than the words they would be loaded by.
template <class T>
struct Short {
    T value;
    explicit operator float() const { return static_cast<float>(value); }
};

// The intervals of a transfer function that values are in, and how far.
struct Intervals {
    vi first;  // points
    vf place;

    TEXGS_INLINE Intervals(const CastTable& t, vf value) {
        vf passed = 0.0f;
        for (int i = 1; i < t.n - 1; ++i) passed = add_where(vf(t.value[i]) <= value, passed, 1.0f);
        first = truncate(passed);
        place = (value - gather(t.value, first)) * gather(t.per_width, first);
    }
    TEXGS_INLINE vf mixed(const float* column) const {
        return mix(gather(column, first), gather(column, first + splat(1)), place);
    }
};

// What a ray gathers.
struct Sums {
    vf color[3], normal[3];
    float depth = 0.0f, median = 0.0f, light = 1.0f;
};

template <class T>
class Caster {
public:
    Caster(const CastJob& job)
        : job_(job),
          lattice_(lattice_of(job.volume)),
          lamp_(lamp_of(job.view)),
          values_(static_cast<const T*>(job.volume.values)) {
        for (int a = 0; a < 3; ++a) box_.lower[a] = job.lower[a], box_.upper[a] = job.upper[a];
        const CastTable& t = job.table;
        for (int a = 0; a < 3; ++a)
            slope_[a] = static_cast<float>(lattice_.per_unit[a] / (t.value[t.n - 1] - t.value[0]));
        const int64_t bytes = int64_t(sizeof(T)) * job.volume.size[0] * job.volume.size[1];
        most_slices_ = static_cast<int32_t>((int64_t(1) << 31) / bytes) - 4;
    }

    void cast(int x, int y) {
        const CastRay ray = cast_ray(lattice_, job_.view, x, y);
        Sums sums;
        for (int a = 0; a < 3; ++a) sums.color[a] = 0.0f, sums.normal[a] = 0.0f;
        Queue waiting, seen;
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
            if (waiting.n >= kLanes) weigh(ray, waiting, kLanes, seen, sums);
            k += kLanes;
        }
        if (waiting.n && sums.light >= kOpaque) weigh(ray, waiting, waiting.n, seen, sums);
        if (seen.n) shade(ray, seen, seen.n, sums);
        write(int64_t(y) * job_.view.width + x, sums);
    }

private:
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

    // Whether samples are in bricks in which something shows.
    vm are_visible(const CastRay& ray, vf k) const {
        vi brick[3];
        for (int a = 0; a < 3; ++a) {
            const vf place = max(fma(k + vf(0.5f), ray.step[a], ray.entry[a]), 0.0f);
            const float last = static_cast<float>(lattice_.bricks[a] - 1);
            brick[a] = truncate(min(place * vf(1.0f / TEXGS_BRICK), last));
        }
        const vi row = brick[2] * splat(lattice_.bricks[1]) + brick[1];
        const vi distance = gather_bytes(job_.distance, row * splat(lattice_.bricks[0]) + brick[0]) & splat(255);
        return to_float(distance) < vf(0.5f);
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

    // The first of the slices that `used` samples need; below 0 where these are too far apart for 32-bit offsets.
    int32_t first_slice(vf cell_z, int used) const {
        float lanes[kLanes];
        store(lanes, cell_z);
        const int32_t one = static_cast<int32_t>(lanes[0]), other = static_cast<int32_t>(lanes[used - 1]);
        const int32_t low = one < other ? one : other, high = one < other ? other : one;
        return high - low > most_slices_ ? -1 : low > 0 ? low - 1 : 0;
    }

    // Finds what the first samples weigh, and lets those that show something wait.
    void weigh(const CastRay& ray, Queue& waiting, int used, Queue& seen, Sums& sums) {
        vf cell[3], inside[3];
        locate(ray, waiting.numbers(used), cell, inside);
        const int32_t first = first_slice(cell[2], used);
        if (first < 0) return one_by_one(ray, waiting, used, seen, sums);
        const CastTable& t = job_.table;
        const vf value = values_in(slices(first), Cells(job_.volume.size, cell, first), inside);
        const vf opacity = Intervals(t, value).mixed(t.opacity);
        const vm visible = (vf(t.value[0]) <= value) & (value <= vf(t.value[t.n - 1])) & (vf(0.0f) < opacity);
        float alpha[kLanes], values[kLanes];
        store(alpha, zero_unless(visible, step_opacity(opacity, job_.view.step / job_.view.opacity_unit)));
        store(values, value);
        for (int lane = 0; lane < used && sums.light >= kOpaque; ++lane) {
            const float weight = sums.light * alpha[lane], z = ray.near + (waiting.k[lane] + 0.5f) * ray.z;
            if (!(weight > 0.0f)) continue;
            seen.k[seen.n] = waiting.k[lane], seen.value[seen.n] = values[lane], seen.weight[seen.n++] = weight;
            const float left = sums.light - weight;
            if (sums.light > 0.5f && left <= 0.5f) sums.median = z;
            sums.light = left;
            sums.depth += weight * z;
        }
        waiting.drop(used);
        if (seen.n >= kLanes) shade(ray, seen, kLanes, sums);
    }

    void one_by_one(const CastRay& ray, Queue& waiting, int used, Queue& seen, Sums& sums) {
        for (; used > 0 && sums.light >= kOpaque; --used) weigh(ray, waiting, 1, seen, sums);
    }

    // Adds what the first samples that show something look like.
    void shade(const CastRay& ray, Queue& seen, int used, Sums& sums) {
        vf cell[3], inside[3], slope[3];
        locate(ray, seen.numbers(used), cell, inside);
        const int32_t first = first_slice(cell[2], used);
        if (first < 0) {
            for (; used > 0; --used) shade(ray, seen, 1, sums);
            return;
        }
        differences_in(slices(first), Cells(job_.volume.size, cell, first), inside, slope);
        const Vec3<vf> n = unit(Vec3<vf>{slope[0] * vf(slope_[0]), slope[1] * vf(slope_[1]), slope[2] * vf(slope_[2])});
        const CastTable& t = job_.table;
        const vf weight = load_part(seen.weight, used);
        const Intervals intervals(t, load(seen.value));
        const Vec3<vf> color{intervals.mixed(t.color[0]), intervals.mixed(t.color[1]), intervals.mixed(t.color[2])};
        const Vec3<vf> shown = lit(color, n, lamp_);
        const Vec3<vf> against = turned(n, vf(0.0f) - along(n, ray.direction));
        const vf looks[3] = {shown.x, shown.y, shown.z}, normals[3] = {against.x, against.y, against.z};
        const vm is_used = vf(0.0f) < weight;  // other lanes may hold anything
        for (int c = 0; c < 3; ++c) {
            sums.color[c] = fma_where(is_used, weight, looks[c], sums.color[c]);
            sums.normal[c] = fma_where(is_used, weight, normals[c], sums.normal[c]);
        }
        seen.drop(used);
    }

    const T* slices(int32_t first) const {
        return values_ + int64_t(first) * job_.volume.size[0] * job_.volume.size[1];
    }

    void write(int64_t pixel, const Sums& sums) const {
        const texgs_cast_view& v = job_.view;
        const float alpha = 1.0f - sums.light, per_alpha = alpha > 0.0f ? 1.0f / alpha : 0.0f;
        for (int c = 0; c < 3; ++c) v.rgba[4 * pixel + c] = sum(sums.color[c]);
        v.rgba[4 * pixel + 3] = alpha;
        if (v.depth) v.depth[pixel] = sums.depth * per_alpha;
        if (v.median) v.median[pixel] = sums.median;
        if (v.normal)
            for (int c = 0; c < 3; ++c) v.normal[3 * pixel + c] = sum(sums.normal[c]) * per_alpha;
    }

    const CastJob& job_;
    const Lattice lattice_;
    const Lamp lamp_;
    Extent box_;
    const T* values_;
    float slope_[3];
    int32_t most_slices_;
};

template <class T>
void cast_row(const CastJob& job, int y, int begin, int end) {
    Caster<T> caster(job);
    for (int x = begin; x < end; ++x) caster.cast(x, y);
}

void cast(const CastJob& job, int y, int begin, int end) {
    using Cast = void (*)(const CastJob&, int, int, int);
    static constexpr Cast kShort[] = {
        cast_row<Short<uint8_t>>,
        cast_row<Short<int8_t>>,
        cast_row<Short<uint16_t>>,
        cast_row<Short<int16_t>>,
    };
    static constexpr Cast kCast[] = {
        cast_row<uint8_t>, cast_row<int8_t>,   cast_row<uint16_t>, cast_row<int16_t>, cast_row<uint32_t>,
        cast_row<int32_t>, cast_row<uint64_t>, cast_row<int64_t>,  cast_row<float>,   cast_row<double>,
    };
    const bool is_short = job.volume.size[0] < 4 && job.volume.type <= TEXGS_I16;
    (is_short ? kShort : kCast)[job.volume.type](job, y, begin, end);
}

}  // namespace

const VolumeKernels kVolumeKernels = {cast};

}  // namespace texgs::TEXGS_ISA
