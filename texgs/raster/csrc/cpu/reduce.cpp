// SPDX-License-Identifier: Apache-2.0
// Sums the slots of each surfel, in order, and carries the sums back through the projection. Many surfels at a time.
#include "isa.h"
#include "kernels.h"
#include "surfels.h"

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

void store_gradients(const texgs_gradients& out, int64_t first, int n, const SurfelGradient<vf>& g) {
    const auto put = [&](float* to, int width, int k, vf value) {
        if (to) store_strided(to + width * first + k, width, n, value);
    };
    put(out.means, 3, 0, g.mean.x), put(out.means, 3, 1, g.mean.y), put(out.means, 3, 2, g.mean.z);
    for (int k = 0; k < 4; ++k) put(out.quats, 4, k, g.quat[k]);
    put(out.scales, 2, 0, g.su), put(out.scales, 2, 1, g.sv);
    put(out.opacities, 1, 0, g.opacity);
    put(out.shift, 2, 0, g.shift_x), put(out.shift, 2, 1, g.shift_y);
}

SurfelGradient<vf> visible_only(const Raster& r, int64_t first, int n, SurfelGradient<vf> g) {
    float visible[kLanes] = {};  // a surfel that is not drawn may have no finite projection
    for (int i = 0; i < n; ++i) visible[i] = r.slot_begin[first + i + 1] > r.slot_begin[first + i] ? 1.0f : 0.0f;
    const vm keep = load(visible) > vf(0.0f);
    vf* const all[] = {&g.mean.x,  &g.mean.y, &g.mean.z, &g.quat[0], &g.quat[1], &g.quat[2],
                       &g.quat[3], &g.su,     &g.sv,     &g.opacity, &g.shift_x, &g.shift_y};
    for (vf* x : all) *x = zero_unless(keep, *x);
    return g;
}

}  // namespace

void reduce_gradients(const Raster& r, int64_t begin, int64_t end) {
    const View view = make_view(r.camera.viewmat, r.camera.K);
    const bool depth = r.grad.depth || r.grad.median || r.grad.distortion;
    const int channels = depth ? 13 : 11, own = r.surfels.channels;
    Rows s;
    for (int64_t first = begin; first < end; first += kLanes) {
        const int n = static_cast<int>(end - first < kLanes ? end - first : kLanes);
        s.gather(r, first, n);
        for (int c = 0; r.out.features && c < own; ++c)
            store_strided(r.out.features + own * first + c, own, n, s[channels + c]);
        Moments<vf> m{s[0], s[1], s[2], s[3],  s[4], s[5], s[6],
                      s[7], s[8], s[9], s[10], 0.0f, 0.0f, {0.0f, 0.0f, 0.0f}};
        if (depth) m.zc = s[11], m.zp = s[12];
        const int normal = channels + own;
        if (r.with_normal) m.normal = {s[normal], s[normal + 1], s[normal + 2]};
        const Surfel<vf> surfel = load_surfels(r.surfels, first, n);
        const Projection<vf> q = project(view, surfel, r.options.filter_sigma);
        store_gradients(r.out, first, n,
                        visible_only(r, first, n, project_backward(view, surfel, q, m, r.options.low_pass)));
    }
}

}  // namespace texgs::TEXGS_ISA
