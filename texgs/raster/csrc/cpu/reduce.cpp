// SPDX-License-Identifier: Apache-2.0
// Sums the slots of each surfel or Gaussian, in order, and carries the sums back through the projection. Many at a
// time.
#include "isa.h"
#include "kernels.h"
#include "primitives.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kMaxSlot = 64;

// Sums of a group of surfels, one row per number of the slot.
struct alignas(64) Rows {
    float row[kMaxSlot][kLanes];

    void gather(const Raster& r, int64_t first, int n) {
        for (int i = 0; i < kLanes; ++i) {
            vf line[kMaxSlot / kLanes];
            const int vectors = r.slot_stride / kLanes;
            for (int k = 0; k < vectors; ++k) line[k] = 0.0f;
            if (i < n)
                for (uint32_t slot = r.slot_begin[first + i]; slot < r.slot_begin[first + i + 1]; ++slot)
                    for (int k = 0; k < vectors; ++k)
                        line[k] += load(r.slots + int64_t(slot) * r.slot_stride + k * kLanes);
            float flat[kMaxSlot];
            for (int k = 0; k < vectors; ++k) store(flat + k * kLanes, line[k]);
            for (int k = 0; k < r.slot_stride; ++k) row[k][i] = flat[k];
        }
    }
    vf operator[](int k) const { return load(row[k]); }
};

void store_strided(float* p, int stride, int n, vf a) {
    float lanes[kLanes];
    store(lanes, a);
    for (int i = 0; i < n; ++i) p[stride * i] = lanes[i];
}

// Which of n surfels are drawn: the others may have no finite projection.
vm drawn(const Raster& r, int64_t first, int n) {
    float visible[kLanes] = {};
    for (int i = 0; i < n; ++i) visible[i] = r.slot_begin[first + i + 1] > r.slot_begin[first + i] ? 1.0f : 0.0f;
    return load(visible) > vf(0.0f);
}

template <int N>
void store_gradients(const texgs_gradients& out, int64_t first, int n, vm drawn, const Gradient<vf, N>& g) {
    const auto put = [&](float* to, int width, int k, vf value) {
        if (to) store_strided(to + width * first + k, width, n, zero_unless(drawn, value));
    };
    put(out.means, 3, 0, g.mean.x), put(out.means, 3, 1, g.mean.y), put(out.means, 3, 2, g.mean.z);
    for (int k = 0; k < 4; ++k) put(out.quats, 4, k, g.quat[k]);
    for (int k = 0; k < N; ++k) put(out.scales, N, k, g.scale[k]);
    put(out.opacities, 1, 0, g.opacity);
    put(out.shift, 2, 0, g.shift_x), put(out.shift, 2, 1, g.shift_y);
}

template <class P>
void reduce(const Raster& r, int64_t begin, int64_t end) {
    const View view = make_view(r.camera.viewmat, r.camera.K);
    const bool depth = r.grad.depth || r.grad.median || r.grad.distortion;
    const int channels = depth ? P::Sums::kAll : P::Sums::kGeometry, own = r.surfels.channels;
    const int textured = r.surfels.base ? 3 : 0, plain = own - textured;  // the texture's gradients are another pass
    Rows s;
    for (int64_t first = begin; first < end; first += kLanes) {
        const int n = static_cast<int>(end - first < kLanes ? end - first : kLanes);
        s.gather(r, first, n);
        for (int c = 0; r.out.features && c < plain; ++c)
            store_strided(r.out.features + plain * first + c, plain, n, s[channels + textured + c]);
        const P primitive = load_primitives<P>(r.surfels, first, n);
        auto m = read_moments(primitive, s, depth);
        if constexpr (!P::kAffine) {
            const int normal = channels + own;
            if (r.with_normal) m.normal = {s[normal], s[normal + 1], s[normal + 2]};
        }
        const auto q = project(view, primitive, r.camera, r.options);
        auto gradient = project_backward(view, primitive, q, m, r.options);
        if (r.surfels.raw) activate_backward(primitive, gradient);
        store_gradients(r.out, first, n, drawn(r, first, n), gradient);
    }
}

}  // namespace

void reduce_gradients(const Raster& r, int64_t begin, int64_t end) {
    with_primitive<vf>(r.surfels.axes,
                       [&](auto primitive) { reduce<typename decltype(primitive)::type>(r, begin, end); });
}

}  // namespace texgs::TEXGS_ISA
