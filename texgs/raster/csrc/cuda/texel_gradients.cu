// SPDX-License-Identifier: Apache-2.0
// Gradients of texels. Each pixel gives weight * gain * gradient to the four texels it was interpolated from.
//
// Sums are kept in 64-bit fixed point: integers add up to the same number in any order, and atomics stay usable. No sum
// is larger than pixels * largest |gain| * largest |gradient|, since the weights of a pixel add up to at most 1; that
// fixes the scale, and leaves 40 bits or so below the largest contribution of a pixel where a float has 24.
#include "slots.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 256;
constexpr int kSmall = 16;  // textures of so few texels are summed over a warp first

// 2^exponent * (sum of a texel) is its fixed-point sum. All are NaN if the gradient of any pixel is not finite; a
// surfel whose gain is not finite has none.
struct FixedPoint {
    int exponent;
    bool finite;

    __device__ explicit FixedPoint(const Raster& r) {
        const float gradient = __uint_as_float(r.magnitudes[0]), gain = __uint_as_float(r.magnitudes[1]);
        finite = isfinite(gradient);
        const int bits = 64 - __clzll(r.plane) + above(gradient) + above(gain);
        exponent = max(-126, min(126, 62 - bits));
    }
    __device__ float scale() const { return finite ? ldexpf(1.0f, exponent) : 0.0f; }
    __device__ float value(int64_t sum) const {
        return finite ? static_cast<float>(ldexp(static_cast<double>(sum), -exponent)) : __uint_as_float(0x7fc00000u);
    }

private:
    __device__ static int above(float a) { return a > 0.0f && isfinite(a) ? ilogbf(a) + 1 : 0; }  // a <= 2^above
};

__device__ void add_fixed(int64_t* sum, float scaled) {
    atomicAdd(reinterpret_cast<unsigned long long*>(sum), static_cast<unsigned long long>(__float2ll_rn(scaled)));
}

// The pixels of a thread, as a texture receives them.
struct Given {
    float x[kPixels], y[kPixels];
    float weighted[kPixels][3];  // weight * gradient * gain, scaled; 0 where the fragment does not count
};

// Bilinear weights are products of tents around the texels.
__device__ inline float tent(float distance) { return fmaxf(0.0f, 1.0f - fabsf(distance)); }

__device__ void give_small(const TextureTable& t, const Given& given, int64_t* sums) {
    float weights[kPixels][kSmall];
    int column = 0, row = 0;
#pragma unroll
    for (int texel = 0; texel < kSmall; ++texel) {
#pragma unroll
        for (int p = 0; p < kPixels; ++p) weights[p][texel] = tent(given.x[p] - column) * tent(given.y[p] - row);
        if (++column == t.columns) column = 0, ++row;
    }
    const int lane = lane_index(), mine = lane / 2;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
        float v[kSmall];
#pragma unroll
        for (int texel = 0; texel < kSmall; ++texel)
            v[texel] = fma(weights[0][texel], given.weighted[0][c], weights[1][texel] * given.weighted[1][c]);
        const float sum = sum16(v);
        if (lane % 2 == 0 && mine < t.count() && sum != 0.0f) add_fixed(sums + 3 * mine + c, sum);
    }
}

__device__ void give_large(const TextureTable& t, const Given& given, int64_t* sums) {
#pragma unroll
    for (int p = 0; p < kPixels; ++p) {
        if (given.weighted[p][0] == 0.0f && given.weighted[p][1] == 0.0f && given.weighted[p][2] == 0.0f) continue;
        const float left = floorf(given.x[p]), top = floorf(given.y[p]);
        for (int tap = 0; tap < 4; ++tap) {
            const float x = left + (tap & 1), y = top + (tap >> 1);
            const float weight = tent(given.x[p] - x) * tent(given.y[p] - y);
            if (weight == 0.0f) continue;  // also those beyond the border
            int64_t* at = sums + 3 * (static_cast<int64_t>(y) * t.columns + static_cast<int64_t>(x));
            for (int c = 0; c < 3; ++c) add_fixed(at + c, weight * given.weighted[p][c]);
        }
    }
}

// Six blocks on a multiprocessor: as many as there are with all numbers in registers.
__global__ __launch_bounds__(kThreads, 6) void texel_kernel(const Raster r) {
    __shared__ Chunk<kThreads, 1, true> chunk;
    const int tile = static_cast<int>(r.tile_order[blockIdx.x]);
    const Place at(r, tile);
    const float limit = r.options.transmittance_min, scale = FixedPoint(r).scale();
    float transmittance[kPixels], gradient[kPixels][3] = {};
#pragma unroll
    for (int p = 0; p < kPixels; ++p) {
        transmittance[p] = at.inside(r, p) ? 1.0f : -1.0f;
        for (int c = 0; c < 3; ++c)
            if (at.inside(r, p)) gradient[p][c] = r.grad.color[c * r.plane + at.pixel(r, p)];
    }
    const auto visit = [&](int place) {
        const TextureTable& texture = chunk.textures[place];
        const bool gain_is_finite = isfinite(texture.gain);
        Given given{};
        bool seen = false;
#pragma unroll
        for (int p = 0; p < kPixels; ++p) {
            if (!(chunk.masks[place] & at.blocks[p])) continue;
            const Fragment f = evaluate<Surfel<float>>(r, chunk.records[place], at, p);
            const float w = blend(f.alpha, limit, transmittance[p]);
            if (!(w > 0.0f && gain_is_finite)) continue;
            seen = true;
            const TexelCoordinates coordinates(texture, f.u, f.v);
            given.x[p] = coordinates.x, given.y[p] = coordinates.y;
#pragma unroll
            for (int c = 0; c < 3; ++c) given.weighted[p][c] = w * texture.gain * gradient[p][c] * scale;
        }
        if (!__any_sync(kAllLanes, seen)) return;
        int64_t* sums = r.texel_sums + (texture.texels - r.surfels.texels);
        if (texture.count() <= kSmall)
            give_small(texture, given, sums);
        else
            give_large(texture, given, sums);
    };
    bool active = true;
    const uint32_t end = r.tile_begin[tile + 1];
    for (uint32_t begin = r.tile_begin[tile]; begin < end && __syncthreads_or(active); begin += kThreads) {
        const int n = static_cast<int>(min(end - begin, uint32_t(kThreads)));
        chunk.stage(r, n, 0, FromList{r, begin});
        __syncthreads();
        for (int first = 0; first < n && active; first += kWarp) {
            for (uint32_t hits = chunk.reach(first, at.quadrant()); hits; hits &= hits - 1)
                visit(first + __ffs(static_cast<int>(hits)) - 1);
            active = __any_sync(kAllLanes, transmittance[0] >= limit || transmittance[1] >= limit);
        }
    }
}

__global__ __launch_bounds__(kBlock) void convert_kernel(const Raster r) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i < 3 * r.surfels.n_texels) r.out.texels[i] = FixedPoint(r).value(r.texel_sums[i]);
}

// Positive floats are ordered as their bits are, infinity and NaN above all. `finite_only`: of those that are finite.
__global__ __launch_bounds__(kBlock) void largest_kernel(const float* values, int64_t n, bool finite_only,
                                                         uint32_t* bits) {
    uint32_t most = 0;
    for (int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x; i < n; i += int64_t(gridDim.x) * kBlock)
        if (!finite_only || isfinite(values[i])) most = max(most, __float_as_uint(fabsf(values[i])));
#pragma unroll
    for (int step = kWarp / 2; step >= 1; step /= 2) most = max(most, __shfl_xor_sync(kAllLanes, most, step));
    if (lane_index() == 0 && most) atomicMax(bits, most);
}

}  // namespace

void largest_magnitude(const float* values, int64_t n, bool finite_only, uint32_t* bits, cudaStream_t stream) {
    const int64_t blocks = blocks_for(n, kBlock);
    launch(largest_kernel, blocks < 1024 ? blocks : 1024, kBlock, stream, values, n, finite_only, bits);
}

void texel_gradients(const Raster& r, cudaStream_t stream) {
    launch(texel_kernel, r.tiles, kThreads, stream, r);
    launch(convert_kernel, blocks_for(3 * r.surfels.n_texels, kBlock), kBlock, stream, r);
}

}  // namespace texgs::cuda
