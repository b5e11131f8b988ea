// SPDX-License-Identifier: Apache-2.0
// A 3x3 convolution with a quarter of the multiplications: Winograd's F(4x4, 3x3) (Lavin and Gray 2016, section 4.3).
//
// Tiles of 6x6 pixels, four apart, are transformed to 36 points. At each point, the channels of a batch of tiles are a
// matrix that is multiplied by that of the kernel. The products are transformed back to 4x4 pixels. Points lie as
// [point][block of 16 channels][tile][16].
#include "convolution_kernels.h"
#include "simd.h"

namespace texgs::TEXGS_ISA {
namespace {

constexpr int kSide = 6, kStep = 4;
// Tiles times vectors of channels that are summed up in registers.
constexpr int kRows = kLanes == 16 ? 12 : 6;
constexpr int kColumns = 2;
static_assert(kTileRows % kRows == 0 && kChannelBlock % kLanes == 0);

// Tiles [begin, end). What lies beyond the last of them is multiplied too, and not read.
struct Batch {
    const ConvolutionJob& job;
    int begin, end;
    float *before, *after;  // points before and after the product
};

// B^T d of six vectors.
TEXGS_INLINE void transform_input(const vf d[kSide], vf t[kSide]) {
    const vf even = fnma(4.0f, d[2], d[4]), odd = fnma(4.0f, d[1], d[3]);
    const vf far = d[4] - d[2], near = vf(2.0f) * (d[3] - d[1]);
    t[0] = fma(4.0f, d[0], fnma(5.0f, d[2], d[4]));
    t[1] = even + odd;
    t[2] = even - odd;
    t[3] = far + near;
    t[4] = far - near;
    t[5] = fma(4.0f, d[1], fnma(5.0f, d[3], d[5]));
}

// A^T m of six vectors.
TEXGS_INLINE void transform_output(const vf m[kSide], vf y[kStep]) {
    const vf sum = m[1] + m[2], difference = m[1] - m[2], far_sum = m[3] + m[4], far_difference = m[3] - m[4];
    y[0] = m[0] + sum + far_sum;
    y[1] = fma(2.0f, far_difference, difference);
    y[2] = fma(4.0f, far_sum, sum);
    y[3] = fma(8.0f, far_difference, difference) + m[5];
}

// Values where a gate is above 0, or not a number; elsewhere 0.
template <bool kGated>
TEXGS_INLINE vf load_gated(const float* values, const float* gates, int64_t at) {
    if constexpr (!kGated) return load(values + at);
    return zero_unless(~(load(gates + at) <= 0.0f), load(values + at));
}

// One vector of channels of a tile's pixels, transformed to points `stride` floats apart.
template <bool kGated>
TEXGS_INLINE void transform_tile(const float* pixels, const float* gates, int64_t row, int64_t column, float* points,
                                 int64_t stride) {
    vf rows[kSide][kSide];
    for (int x = 0; x < kSide; ++x) {
        vf d[kSide], t[kSide];
        for (int y = 0; y < kSide; ++y) {
            const int64_t at = y * row + x * column, next = at + kStep * column;
            d[y] = load_gated<kGated>(pixels, gates, at);
            if (x < kSide - kStep) continue;  // the last tile had these
            prefetch(pixels + next);
            if constexpr (kGated) prefetch(gates + next);
        }
        transform_input(d, t);
        for (int y = 0; y < kSide; ++y) rows[y][x] = t[y];
    }
    for (int y = 0; y < kSide; ++y) {
        vf t[kSide];
        transform_input(rows[y], t);
        for (int x = 0; x < kSide; ++x) store(points + (kSide * y + x) * stride, t[x]);
    }
}

// The same where a part of the tile is outside of the image.
template <bool kGated>
void transform_edge(const ConvolutionJob& job, int left, int top, int channel, float* points, int64_t stride) {
    alignas(64) float pixels[kPoints * kLanes];
    for (int i = 0; i < kPoints; ++i) {
        const int x = left + i % kSide, y = top + i / kSide;
        const bool is_inside = x >= 0 && y >= 0 && x < job.shape.width && y < job.shape.height;
        const int64_t at = (int64_t(y) * job.shape.width + x) * job.shape.inputs + channel;
        store(pixels + i * kLanes, is_inside ? load_gated<kGated>(job.image, job.gate, at) : vf(0.0f));
    }
    transform_tile<false>(pixels, nullptr, kSide * kLanes, kLanes, points, stride);
}

template <bool kGated>
void transform_inputs(const Batch& batch) {
    const ConvolutionJob& job = batch.job;
    const int64_t stride = job.input_stride(), channels = job.shape.inputs, row = job.shape.width * channels;
    for (int c = 0; c < channels; c += kLanes) {
        float* points = batch.before + job.place(0, c);
        for (int tile = batch.begin; tile < batch.end; ++tile, points += kChannelBlock) {
            const int left = tile % job.tiles_across() * kStep - 1, top = tile / job.tiles_across() * kStep - 1;
            const bool is_inside =
                left >= 0 && top >= 0 && left + kSide <= job.shape.width && top + kSide <= job.shape.height;
            if (is_inside) {
                const int64_t at = top * row + left * channels + c;
                transform_tile<kGated>(job.image + at, kGated ? job.gate + at : nullptr, row, channels, points, stride);
            } else {
                transform_edge<kGated>(job, left, top, c, points, stride);
            }
        }
    }
}

// kCount vectors of channels, from `channel` on, of kRows tiles at one point: sums over the input channels.
template <int kCount>
TEXGS_INLINE void multiply_rows(const ConvolutionJob& job, const float* before, const float* kernel, int channel,
                                float* after) {
    vf sums[kRows][kCount];
    for (int r = 0; r < kRows; ++r)
        for (int j = 0; j < kCount; ++j) sums[r][j] = 0.0f;
    const int channels = job.shape.inputs, ahead = kCount * kLanes * channels;
    const float* weights[kCount];
    for (int j = 0; j < kCount; ++j) {
        const int at = channel + j * kLanes;
        weights[j] = kernel + int64_t(at / kChannelBlock) * channels * kChannelBlock + at % kChannelBlock;
    }
    for (int block = 0; block < channels; block += kChannelBlock) {
        const float* values = before + job.place(0, block);
        for (int c = 0; c < kChannelBlock; ++c) {
            vf w[kCount];
            for (int j = 0; j < kCount; ++j) {
                w[j] = load(weights[j]);
                prefetch(weights[j] + ahead);
                weights[j] += kChannelBlock;
            }
            for (int r = 0; r < kRows; ++r) {
                const vf value = values[r * kChannelBlock + c];
                for (int j = 0; j < kCount; ++j) sums[r][j] = fma(value, w[j], sums[r][j]);
            }
        }
    }
    for (int j = 0; j < kCount; ++j)
        for (int r = 0; r < kRows; ++r) store(after + job.place(r, channel + j * kLanes), sums[r][j]);
}

template <int kCount>
void multiply_columns(const Batch& batch, int point, const float* kernel, int channel) {
    const ConvolutionJob& job = batch.job;
    const float* before = batch.before + point * job.input_stride();
    float* after = batch.after + point * job.output_stride();
    for (int tile = 0; tile < batch.end - batch.begin; tile += kRows)
        multiply_rows<kCount>(job, before + job.place(tile, 0), kernel, channel, after + job.place(tile, 0));
}

void multiply(const Batch& batch) {
    const texgs_convolution& shape = batch.job.shape;
    constexpr int kWidth = kColumns * kLanes;
    for (int point = 0; point < kPoints; ++point) {
        const float* kernel = shape.kernel + int64_t(point) * shape.inputs * shape.outputs;
        int channel = 0;
        for (; channel + kWidth <= shape.outputs; channel += kWidth)
            multiply_columns<kColumns>(batch, point, kernel, channel);
        for (; channel < shape.outputs; channel += kLanes) multiply_columns<1>(batch, point, kernel, channel);
    }
}

// Points of a tile, transformed to its pixels.
TEXGS_INLINE void invert_tile(const float* points, int64_t stride, vf pixels[kStep][kStep]) {
    vf columns[kStep][kSide];
    for (int x = 0; x < kSide; ++x) {
        vf m[kSide], y[kStep];
        for (int i = 0; i < kSide; ++i) m[i] = load(points + (kSide * i + x) * stride);
        transform_output(m, y);
        for (int i = 0; i < kStep; ++i) columns[i][x] = y[i];
    }
    for (int y = 0; y < kStep; ++y) transform_output(columns[y], pixels[y]);
}

void transform_outputs(const Batch& batch) {
    const ConvolutionJob& job = batch.job;
    const texgs_convolution& shape = job.shape;
    for (int c = 0; c < shape.outputs; c += kLanes) {
        const vf bias = shape.bias ? load(shape.bias + c) : vf(0.0f);
        const float* points = batch.after + job.place(0, c);
        for (int tile = batch.begin; tile < batch.end; ++tile, points += kChannelBlock) {
            const int left = tile % job.tiles_across() * kStep, top = tile / job.tiles_across() * kStep;
            const int width = shape.width - left, height = shape.height - top;
            vf pixels[kStep][kStep];
            invert_tile(points, job.output_stride(), pixels);
            for (int y = 0; y < kStep && y < height; ++y)
                for (int x = 0; x < kStep && x < width; ++x) {
                    const vf value = pixels[y][x] + bias;
                    float* to = job.result + (int64_t(top + y) * shape.width + left + x) * shape.outputs + c;
                    stream(to, shape.is_rectified ? max(0.0f, value) : value);
                }
        }
    }
}

}  // namespace

void convolve_tiles(const ConvolutionJob& job, int begin, int end, float* scratch) {
    const Batch batch{job, begin, end, scratch, scratch + kPoints * job.input_stride()};
    job.gate ? transform_inputs<true>(batch) : transform_inputs<false>(batch);
    multiply(batch);
    transform_outputs(batch);
    stream_fence();
}

}  // namespace texgs::TEXGS_ISA
