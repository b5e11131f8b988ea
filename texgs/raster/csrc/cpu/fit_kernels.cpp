// SPDX-License-Identifier: Apache-2.0
// The step of Adam on a range of floats, and the part of the screen that a range of spheres can cover.
#include "interleaved.h"
#include "loss_kernels.h"

#include "../maths.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr float kHuge = 1e18f;  // places and sizes from here on count as infinite: products of them are not finite

// The columns of up to kLanes rows; lanes beyond n repeat the first row.
template <int K>
TEXGS_INLINE void load_rows(const float* p, int n, vf column[K]) {
    load_columns<K>(p, n, column);
    const vm present = to_float(iota()) < vf(static_cast<float>(n));
    for (int k = 0; k < K; ++k) column[k] = select(present, column[k], p[k]);
}

TEXGS_INLINE vf largest_scale(const float* scales, int axes, int64_t i, int n) {
    vf s[3];
    if (axes == 2) {
        load_rows<2>(scales + 2 * i, n, s);
        s[2] = s[0];
    } else {
        load_rows<3>(scales + 3 * i, n, s);
    }
    const vf most = max(max(s[0], s[1]), s[2]), any_nan = s[0] + s[1] + s[2];
    return select(any_nan <= any_nan, most, any_nan);
}

}  // namespace

void adam_range(const AdamJob& job, const texgs_learned& p, int64_t begin, int64_t end) {
    const vf take1 = job.take1, take2 = job.take2, epsilon = job.epsilon;
    float *const firsts = p.moments, *const seconds = p.moments + p.n;
    const vf keep = p.keep, rate = p.rate, correction = p.correction;
    for (int64_t i = begin; i < end; i += kLanes) {
        const int n = static_cast<int>(end - i < kLanes ? end - i : kLanes);
        const vf g = load_part(p.gradient + i, n), m = load_part(firsts + i, n), v = load_part(seconds + i, n);
        const vf first = fma(take1, g - m, m), second = fma(take2, fma(g, g, -v), v);
        const vf step = rate * first / fma(correction, sqrt(second), epsilon);
        store_part(firsts + i, first, n);
        store_part(seconds + i, second, n);
        store_part(p.values + i, fma(keep, load_part(p.values + i, n), -step), n);
    }
}

ScreenBounds screen_bounds_range(const SpheresJob& job, int64_t begin, int64_t end) {
    const View view = make_view(job.viewmat, job.viewmat);  // without a lens
    vf nearest = kHuge, low[2] = {kHuge, kHuge}, high[2] = {-kHuge, -kHuge};
    vm is_void = vf(0.0f) < vf(0.0f);
    for (int64_t i = begin; i < end; i += kLanes) {
        const int n = static_cast<int>(end - i < kLanes ? end - i : kLanes);
        vf mean[3];
        load_rows<3>(job.means + 3 * i, n, mean);
        const vf scale = largest_scale(job.scales, job.axes, i, n);
        const vf reach = vf(job.reach) * exp(scale);
        const Vec3<vf> p =
            rotate(view, Vec3<vf>{mean[0], mean[1], mean[2]}) + Vec3<vf>{vf(view.t[0]), vf(view.t[1]), vf(view.t[2])};
        const vf near = p.z - reach, over_near = vf(1.0f) / near, over_far = vf(1.0f) / (p.z + reach);
        is_void = is_void | ~(vf(0.0f) < near) | ~(abs(p.x) + abs(p.y) + p.z + reach < vf(kHuge));
        nearest = min(nearest, near);
        const vf place[2] = {p.x, p.y};
        for (int k = 0; k < 2; ++k) {
            const vf l = place[k] - reach, h = place[k] + reach;
            low[k] = min(low[k], min(l * over_near, l * over_far));
            high[k] = max(high[k], max(h * over_near, h * over_far));
        }
    }
    const auto least = [](vf a) { return -largest(-a); };
    return {any(is_void) ? 0.0f : least(nearest), least(low[0]), largest(high[0]), least(low[1]), largest(high[1])};
}

}  // namespace texgs::TEXGS_ISA
