// SPDX-License-Identifier: Apache-2.0
// Backward pass over tiles: gradient sums of each surfel of a tile into the pair's slot.
//
// A fragment adds w_i c_i to its pixel, so with q_i = dL/dw_i
//     dL/dalpha_i = T_i q_i - (sum over j behind i of w_j q_j) / (1 - alpha_i).
// The sum over all fragments is known from the rendered image; subtracting w_i q_i front to back leaves the rest. One
// number per pixel is thus all that is carried besides the transmittance, which is replayed as in the forward pass.
#include "gradients.cuh"
#include "slots.cuh"

namespace texgs::cuda {
namespace {

// What a slot holds: moments as far as they are wanted, channels, gradient of the gain.
template <class P, int C, bool Geometry, bool Depth, bool Textured>
struct Layout {
    static constexpr int kChannels = !Geometry ? 0 : Depth ? P::Sums::kAll : P::Sums::kGeometry;
    static constexpr int kGain = kChannels + C;
    static constexpr int kWidth = kGain + (Textured ? 1 : 0);
};

// dL/d(u, v) of a fragment through its texture coordinates, per weight.
struct Slope {
    float u = 0.0f, v = 0.0f;
};

// Adds to q what the texture contributes to a fragment's colour; returns dL/dgain per weight.
template <class Gradient>
__device__ float weigh_texture(const TextureTable& t, const Fragment& f, const Gradient& g, float& q, Slope& slope) {
    const TexelCoordinates at(t, f.u, f.v);
    float by_gain = 0.0f, by_x = 0.0f, by_y = 0.0f;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        const Taps taps(t, at, c);
        by_gain = fma(g.channels[c], taps.value(at), by_gain);
        by_x = fma(g.channels[c], taps.by_x(at), by_x);
        by_y = fma(g.channels[c], taps.by_y(at), by_y);
    }
    q = fma(t.gain, by_gain, q);
    if (at.free_x) slope.u = t.gain * by_x * (t.columns / 6.0f);
    if (at.free_y) slope.v = t.gain * by_y * (t.rows / 6.0f);
    return by_gain;
}

// Adds a fragment to the moments of its surfel (surfel.h); e = alpha dL/dalpha, gz = dL/d(depth).
template <bool Depth, int Width>
__device__ __forceinline__ void add_geometry(Type<Surfel<float>>, const Record& record, const Fragment& f, float w,
                                             float e, float gz, const Slope& slope, float (&sums)[Width]) {
    using K = SurfelSums;
    float gU = w * f.r * slope.u, gV = w * f.r * slope.v, gW = -fma(gU, f.u, gV * f.v);
    if (f.filtered) {
        sums[K::kDiscDx] = fma(e, f.dx, sums[K::kDiscDx]);
        sums[K::kDiscDy] = fma(e, f.dy, sums[K::kDiscDy]);
    } else {
        const float t = e * f.r;
        gU = fma(-t, f.u, gU), gV = fma(-t, f.v, gV), gW = fma(t, f.rho, gW);
    }
    if constexpr (Depth) {
        const float by_zc = f.filtered ? 0.0f : gz * f.r;
        gW = fma(-by_zc, depth_of<Surfel<float>>(record, f), gW);
        sums[K::kZc] += by_zc;
        sums[K::kZp] += f.filtered ? gz : 0.0f;
    }
    sums[K::kUdx] = fma(gU, f.dx, sums[K::kUdx]), sums[K::kUdy] = fma(gU, f.dy, sums[K::kUdy]), sums[K::kU] += gU;
    sums[K::kVdx] = fma(gV, f.dx, sums[K::kVdx]), sums[K::kVdy] = fma(gV, f.dy, sums[K::kVdy]), sums[K::kV] += gV;
    sums[K::kWdx] = fma(gW, f.dx, sums[K::kWdx]), sums[K::kWdy] = fma(gW, f.dy, sums[K::kWdy]);
    sums[K::kE] += e;
}

// Of its Gaussian (gaussian.h).
template <bool Depth, int Width>
__device__ __forceinline__ void add_geometry(Type<Gaussian<float>>, const Record&, const Fragment& f, float, float e,
                                             float gz, const Slope&, float (&sums)[Width]) {
    using K = GaussianSums;
    const float by_u = e * f.u, by_v = e * f.v;
    sums[K::kE] += e, sums[K::kU] += by_u, sums[K::kV] += by_v;
    sums[K::kUU] = fma(by_u, f.u, sums[K::kUU]);
    sums[K::kUV] = fma(by_u, f.v, sums[K::kUV]);
    sums[K::kVV] = fma(by_v, f.v, sums[K::kVV]);
    if constexpr (Depth) sums[K::kZ] += gz;
}

// A fragment of weight w that `before` of the light reaches.
template <class P, int C, bool Geometry, bool Depth, bool Textured, class Chunk>
__device__ __forceinline__ void add_fragment(const Raster& r, const Chunk& chunk, int place, const Fragment& f, float w,
                                             float before, PixelGradient<C, Depth>& g,
                                             float (&sums)[Layout<P, C, Geometry, Depth, Textured>::kWidth]) {
    using L = Layout<P, C, Geometry, Depth, Textured>;
    const Record& record = chunk.records[place];
    float q = g.constant;
    Slope slope;
    if constexpr (Textured) sums[L::kGain] += w * weigh_texture(chunk.textures[place], f, g, q, slope);
#pragma unroll
    for (int c = 0; c < C; ++c) sums[L::kChannels + c] = fma(w, g.channels[c], sums[L::kChannels + c]);
    if constexpr (Geometry) {
        const float* channels = chunk.channels + place * C;
#pragma unroll
        for (int c = 0; c < C; ++c) q = fma(g.channels[c], channels[c], q);
        float gz = 0.0f;
        if constexpr (Depth) gz = g.weigh_depth(r.options, depth_of<P>(record, f), w, record.id, q);
        g.remaining = fma(-w, q, g.remaining);
        // The clamp of alpha blocks the gradient.
        const float by_alpha = fma(before, q, -g.remaining * reciprocal(1.0f - f.alpha));
        const float e = f.alpha < kLargestAlpha ? f.alpha * by_alpha : 0.0f;
        add_geometry<Depth>(Type<P>{}, record, f, w, e, gz, slope, sums);
    }
}

template <class P, int C, bool Geometry, bool Depth, bool Textured>
__global__ __launch_bounds__(kThreads, 1) void backward_kernel(const Raster r) {
    using L = Layout<P, C, Geometry, Depth, Textured>;
    __shared__ Chunk<kSlotChunk, C, Textured> chunk;
    __shared__ SlotSums<L::kWidth> sums;
    const int tile = static_cast<int>(r.tile_order[blockIdx.x]);
    const Place at(r, tile);
    const float limit = r.options.transmittance_min;
    PixelGradient<C, Depth> g[kPixels];
    float transmittance[kPixels];
#pragma unroll
    for (int p = 0; p < kPixels; ++p) {
        transmittance[p] = at.inside(r, p) ? 1.0f : -1.0f;
        if (at.inside(r, p)) g[p].template load<Geometry>(r, at.pixel(r, p));
    }
    const auto visit = [&](int place) {
        float v[L::kWidth] = {};
        bool seen = false;
#pragma unroll
        for (int p = 0; p < kPixels; ++p) {
            if (!(chunk.masks[place] & at.blocks[p])) continue;
            const Fragment f = evaluate<P>(r, chunk.records[place], at, p);
            const float before = transmittance[p], w = blend(f.alpha, limit, transmittance[p]);
            if (!(w > 0.0f)) continue;
            seen = true;
            add_fragment<P, C, Geometry, Depth, Textured>(r, chunk, place, f, w, before, g[p], v);
        }
        if (__any_sync(kAllLanes, seen)) sums.add(place, v);
    };
    const int used = r.surfels.channels + (Geometry && r.grad.normal ? 3 : 0);
    for_pairs(
        r, tile, used, -1, at, chunk, sums, [&] { return transmittance[0] >= limit || transmittance[1] >= limit; },
        visit);
}

// Calls visit(kernel, width of its slots) for the kernel that serves the gradients in `r`.
template <class P, int C, bool Textured, class Visit>
void choose(const Raster& r, Visit visit) {
    const bool depth = r.grad.depth || r.grad.median || r.grad.distortion;
    if (!r.geometry)
        visit(backward_kernel<P, C, false, false, Textured>, Layout<P, C, false, false, Textured>::kWidth);
    else if (depth)
        visit(backward_kernel<P, C, true, true, Textured>, Layout<P, C, true, true, Textured>::kWidth);
    else
        visit(backward_kernel<P, C, true, false, Textured>, Layout<P, C, true, false, Textured>::kWidth);
}

template <class P, bool Textured, class Visit>
void choose(const Raster& r, Visit visit) {
    const int channels = r.surfels.channels + (r.geometry && r.grad.normal ? 3 : 0);
    if (channels <= 3) return choose<P, 3, Textured>(r, visit);
    if (channels <= 6) return choose<P, 6, Textured>(r, visit);
    if (channels <= 16) return choose<P, 16, Textured>(r, visit);
    choose<P, TEXGS_MAX_CHANNELS + 3, Textured>(r, visit);
}

template <class Visit>
void choose(const Raster& r, Visit visit) {
    with_primitive<float>(r.surfels.axes, [&](auto primitive) {
        using P = typename decltype(primitive)::type;
        if constexpr (!P::kAffine)
            if (r.surfels.base) return choose<P, true>(r, visit);
        choose<P, false>(r, visit);
    });
}

}  // namespace

int backward_slot_width(const Raster& r) {
    int chosen = 0;
    choose(r, [&](auto, int width) { chosen = width; });
    return chosen;
}

void backward(const Raster& r, cudaStream_t stream) {
    choose(r, [&](auto kernel, int) { launch(kernel, r.tiles, kThreads, stream, r); });
}

}  // namespace texgs::cuda
