// SPDX-License-Identifier: Apache-2.0
// Forward pass: one thread block per tile, colours and transmittance in registers.
//
// Surfels whose pairs did not fit into the lists (raster.cuh) come after all others in depth. A tile that is still
// transparent then looks for them itself, footprint by footprint: slower, but the image is the same, bit for bit, and
// the host need not know in advance how many pairs there are.
#include "blocks.cuh"
#include "chunk.cuh"

namespace texgs::cuda {
namespace {

constexpr int kSize = kThreads;  // surfels staged at a time

template <int C, bool Depth>
struct Pixel {
    float transmittance, alpha = 0.0f, color[C] = {};
    struct {
        float depth = 0.0f, median = 0.0f, m = 0.0f, m2 = 0.0f, origin = 1.0f;
        int32_t median_surfel = -1;
    } z;
};

// Moments of the distortion are taken about the first fragment: no cancellation.
template <class P, class Pixel>
__device__ void blend_depth(const texgs_options& o, const Record& record, const Fragment& f, float w, Pixel& pixel) {
    const float z = depth_of<P>(record, f);
    if (pixel.alpha == 0.0f) pixel.z.origin = z;
    const float m = NormalizedDepth(o, z, pixel.z.origin).m;
    pixel.z.depth = fma(w, z, pixel.z.depth);
    pixel.z.m = fma(w, m, pixel.z.m);
    pixel.z.m2 = fma(w * m, m, pixel.z.m2);
    if (pixel.alpha < 0.5f) pixel.z.median = z, pixel.z.median_surfel = record.id;
}

template <int C>
__device__ void blend_texture(const TextureTable& t, const Fragment& f, float w, float (&color)[C]) {
    const TexelCoordinates at(t, f.u, f.v);
#pragma unroll
    for (int c = 0; c < 3; ++c) color[c] = fma(w * t.gain, Taps(t, at, c).value(at), color[c]);
}

// Blends the chunk's surfels into the thread's pixels; returns whether any of them goes on.
template <class P, int C, bool Depth, bool Textured>
__device__ bool blend_chunk(const Raster& r, const Chunk<kSize, C, Textured>& chunk, int n, const Place& place,
                            Pixel<C, Depth> (&pixels)[kPixels]) {
    const float limit = r.options.transmittance_min;
    for (int first = 0; first < n; first += kWarp) {
        for (uint32_t hits = chunk.reach(first, place.quadrant()); hits; hits &= hits - 1) {
            const int i = first + __ffs(static_cast<int>(hits)) - 1;
            const Record& record = chunk.records[i];
            const uint32_t mask = chunk.masks[i];
#pragma unroll
            for (int p = 0; p < kPixels; ++p) {
                if (!(mask & place.blocks[p])) continue;
                Pixel<C, Depth>& pixel = pixels[p];
                const Fragment f = evaluate<P>(r, record, place, p);
                const float w = blend(f.alpha, limit, pixel.transmittance);
                if (!(w > 0.0f)) continue;
                const float* channels = chunk.channels + i * C;
#pragma unroll
                for (int c = 0; c < C; ++c) pixel.color[c] = fma(w, channels[c], pixel.color[c]);
                if constexpr (Textured) blend_texture(chunk.textures[i], f, w, pixel.color);
                if constexpr (Depth) blend_depth<P>(r.options, record, f, w, pixel);
                pixel.alpha += w;
            }
        }
        if (__all_sync(kAllLanes, pixels[0].transmittance < limit && pixels[1].transmittance < limit)) return false;
    }
    return true;
}

// What is left of a tile's surfels: of its list, then of those that no list has.
struct Remaining {
    uint32_t begin, end;
    int64_t rank, ranks;

    __device__ Remaining(const Raster& r, int tile)
        : begin(r.tile_begin[tile]), end(r.tile_begin[tile + 1]), rank(r.surfels.n), ranks(r.surfels.n) {
        if (const uint64_t capacity = r.capacity; r.pair_begin[ranks] > capacity)
            rank = lower_bound(r.pair_begin, ranks + 1, capacity + 1) - 1;  // the first that ends beyond it
    }
    __device__ bool any() const { return begin < end || rank < ranks; }

    // Stages the next surfels; returns how many.
    template <class Chunk>
    __device__ int stage(const Raster& r, int tile, int used, Chunk& chunk) {
        if (begin < end) {
            const int n = static_cast<int>(min(end - begin, uint32_t(kSize)));
            chunk.stage(r, n, used, FromList{r, begin});
            begin += n;
            return n;
        }
        const int n = static_cast<int>(min(ranks - rank, int64_t(kSize)));
        chunk.stage(r, n, used, [&](int place) -> Pair {
            const uint32_t surfel = r.order[rank + place];
            return {surfel, 0, tile_mask(r.footprints[surfel], tile % r.tiles_x, tile / r.tiles_x)};
        });
        rank += n;
        return n;
    }
};

template <int C, bool Depth>
__device__ void finish_color(const Raster& r, const Pixel<C, Depth>& pixel, int64_t at) {
    const int own = r.surfels.channels;
#pragma unroll
    for (int c = 0; c < C; ++c) {
        if (c < own) {
            const float background = r.options.background ? r.options.background[c] : 0.0f;
            r.image.color[c * r.plane + at] = fma(1.0f - pixel.alpha, background, pixel.color[c]);
        } else if (r.with_normal && c < own + 3) {
            r.image.normal[(c - own) * r.plane + at] = pixel.color[c];
        }
    }
    if (r.image.alpha) r.image.alpha[at] = pixel.alpha;
}

template <int C, bool Depth>
__device__ void finish_depth(const Raster& r, const Pixel<C, Depth>& pixel, int64_t at) {
    const auto& z = pixel.z;
    if (r.image.depth) r.image.depth[at] = pixel.alpha > 0.0f ? z.depth / pixel.alpha : 0.0f;
    if (r.image.median) {
        r.image.median[at] = z.median;
        r.median_surfel[at] = z.median_surfel;
    }
    if (r.image.distortion) {
        r.image.distortion[at] = fma(-z.m, z.m, pixel.alpha * z.m2);
        float* moments = r.distortion_moments + at;
        moments[0] = z.m, moments[r.plane] = z.m2, moments[2 * r.plane] = z.origin;
    }
}

template <class P, int C, bool Depth, bool Textured>
__global__ __launch_bounds__(kThreads, 1) void forward_kernel(const Raster r) {
    __shared__ Chunk<kSize, C, Textured> chunk;
    const int tile = static_cast<int>(r.tile_order[blockIdx.x]);
    const Place place(r, tile);
    const int used = r.surfels.channels + (r.with_normal ? 3 : 0);
    Pixel<C, Depth> pixels[kPixels];
    bool alive = false;
#pragma unroll
    for (int p = 0; p < kPixels; ++p) {
        const bool inside = place.inside(r, p);
        pixels[p].transmittance = inside ? 1.0f : -1.0f;
        alive |= inside;
    }
    Remaining remaining(r, tile);
    while (remaining.any() && __syncthreads_or(alive)) {
        const int n = remaining.stage(r, tile, used, chunk);
        __syncthreads();
        // Not the thread's but the warp's: all lanes take part in votes.
        if (__any_sync(kAllLanes, alive)) alive = blend_chunk<P, C, Depth, Textured>(r, chunk, n, place, pixels);
    }
#pragma unroll
    for (int p = 0; p < kPixels; ++p) {
        if (!place.inside(r, p)) continue;
        finish_color(r, pixels[p], place.pixel(r, p));
        if constexpr (Depth) finish_depth(r, pixels[p], place.pixel(r, p));
    }
}

template <class P, int C>
void forward_with(const Raster& r, cudaStream_t stream) {
    if constexpr (!P::kAffine) {
        if (r.surfels.base) {
            const auto kernel = r.with_depth ? forward_kernel<P, C, true, true> : forward_kernel<P, C, false, true>;
            return launch(kernel, r.tiles, kThreads, stream, r);
        }
    }
    const auto kernel = r.with_depth ? forward_kernel<P, C, true, false> : forward_kernel<P, C, false, false>;
    launch(kernel, r.tiles, kThreads, stream, r);
}

}  // namespace

// Compiled for colours, colours and normals, a material, and all that there may be.
void forward(const Raster& r, cudaStream_t stream) {
    with_primitive<float>(r.surfels.axes, [&](auto primitive) {
        using P = typename decltype(primitive)::type;
        const int channels = r.surfels.channels + (r.with_normal ? 3 : 0);
        if (channels <= 3) return forward_with<P, 3>(r, stream);
        if (channels <= 6) return forward_with<P, 6>(r, stream);
        if (channels <= 16) return forward_with<P, 16>(r, stream);
        forward_with<P, TEXGS_MAX_CHANNELS + 3>(r, stream);
    });
}

}  // namespace texgs::cuda
