// SPDX-License-Identifier: Apache-2.0
// Gradients of textures over one tile. The image is linear in the texels: each pixel gives weight * gradient to the four
// texels it was interpolated from. Base and gain need nothing more: the bilinear weights add up to one, so the sum over
// a surfel's texels is the gradient of its base, and the sum weighted by the texels that of its gain.
//
// Each (tile, surfel) pair collects its texels in memory of its own, which reduce_textures adds up in a fixed order.
#include "isa.h"
#include "replay.h"
#include "texture.h"

namespace texgs::TEXGS_ISA {
namespace {

struct alignas(64) TextureScratch {
    Chunk chunk;
    TextureTables textures;
    Group group;
    float gradient[3][kTilePixels];
    float transmittance[kTilePixels];
    float alpha[kVectors][kLanes], x[kVectors][kLanes], y[kVectors][kLanes];
    float weighted[kVectors][3][kLanes];  // weight * gradient
};

TEXGS_INLINE void evaluate_entries(TextureScratch& s, const TilePixels& pixels, const Limits& limits) {
    for (int e = 0; e < s.group.entries; ++e)
        for (int part = 0; part < kParts; ++part) {
            const int place = s.group.surfel[e], i = e * kParts + part;
            const Pixels pixel = pixels.of(s.group.block[e], part);
            const Fragments f = evaluate(s.chunk.records[place], s.chunk.flags[place], pixel, limits);
            const TexelCoordinates at = texel_coordinates(s.textures.of[place], f.u, f.v);
            store(s.alpha[i], f.alpha);
            store(s.x[i], at.x), store(s.y[i], at.y);
        }
}

// Floats, aligned to cache lines; NULL when memory is exhausted.
TEXGS_INLINE float* take(TexelArena& arena, int64_t floats) {
    floats = (floats + kSlotAlign - 1) / kSlotAlign * kSlotAlign;
    if (arena.end - arena.next < floats) arena.refill(&arena, floats);
    if (arena.end - arena.next < floats) return nullptr;
    float* part = arena.next;
    arena.next += floats;
    return part;
}

// Blends the surfel's entries; returns whether any pixel got a weight.
TEXGS_INLINE bool weigh_surfel(TextureScratch& s, const Limits& limits, int begin, int end) {
    vf most = 0.0f;
    for (int e = begin; e < end; ++e)
        for (int part = 0; part < kParts; ++part) {
            const int i = e * kParts + part, pixel = s.group.block[e] * kBlockPixels + part * kLanes;
            const vf w = blend(load(s.alpha[i]), s.transmittance + pixel, limits).weight;
            most = max(most, w);
            store(s.alpha[i], w);
            for (int c = 0; c < 3; ++c) store(s.weighted[i][c], w * load(s.gradient[c] + pixel));
        }
    return any(most > vf(0.0f));
}

// Calls visit(vector, lane) for every pixel with a weight.
template <class Visit>
TEXGS_INLINE void for_pixels(const TextureScratch& s, int begin, int end, Visit visit) {
    for (int i = begin * kParts; i < end * kParts; ++i)
        for (unsigned hit = bits(load(s.alpha[i]) > vf(0.0f)); hit; hit &= hit - 1)
            visit(i, __builtin_ctz(hit));
}

#if defined(TEXGS_AVX512)
// Small textures live in registers, a lane per texel: a pixel's bilinear weights are a product of two tents.
template <int Registers>
TEXGS_INLINE void add_to_registers(const TextureScratch& s, const TextureTable& table, int begin, int end, float* out) {
    vf column[Registers], row[Registers], sum[3][Registers];
    for (int k = 0; k < Registers; ++k) {
        const vf texel = to_float(iota()) + vf(16.0f * k);
        row[k] = floor((texel + vf(0.5f)) / vf(table.columns));
        column[k] = fnma(row[k], table.columns, texel);
        for (int c = 0; c < 3; ++c) sum[c][k] = 0.0f;
    }
    for_pixels(s, begin, end, [&](int i, int lane) {
        const vf x = s.x[i][lane], y = s.y[i][lane];
        const vf gx = s.weighted[i][0][lane], gy = s.weighted[i][1][lane], gz = s.weighted[i][2][lane];
        for (int k = 0; k < Registers; ++k) {
            const vf tent = max(vf(1.0f) - abs(x - column[k]), 0.0f) * max(vf(1.0f) - abs(y - row[k]), 0.0f);
            sum[0][k] = fma(tent, gx, sum[0][k]);
            sum[1][k] = fma(tent, gy, sum[1][k]);
            sum[2][k] = fma(tent, gz, sum[2][k]);
        }
    });
    for (int c = 0; c < 3; ++c)
        for (int k = 0; k < Registers; ++k) stream(out + 16 * (c * Registers + k), sum[c][k]);
}
#endif

// Bounds of the texels that the surfel's pixels in this tile touch.
TEXGS_INLINE TexelPart touched_part(const TextureScratch& s, const TextureTable& table, int begin, int end) {
    vf low_x = 1e9f, low_y = 1e9f, high_x = 0.0f, high_y = 0.0f;
    for (int i = begin * kParts; i < end * kParts; ++i) {
        const vm hit = load(s.alpha[i]) > vf(0.0f);
        const vf x = load(s.x[i]), y = load(s.y[i]);
        low_x = select(hit, min(low_x, x), low_x), high_x = select(hit, max(high_x, x), high_x);
        low_y = select(hit, min(low_y, y), low_y), high_y = select(hit, max(high_y, y), high_y);
    }
    TexelPart part{};
    part.column = static_cast<int32_t>(-largest(-low_x)), part.row = static_cast<int32_t>(-largest(-low_y));
    const int last_column = static_cast<int>(largest(high_x)) + 1, last_row = static_cast<int>(largest(high_y)) + 1;
    part.columns = (last_column < table.columns ? last_column + 1 : static_cast<int>(table.columns)) - part.column;
    part.rows = (last_row < table.rows ? last_row + 1 : static_cast<int>(table.rows)) - part.row;
    return part;
}

// Larger ones are scattered to memory: four floats a texel.
void add_to_memory(const TextureScratch& s, const TexelPart& part, int begin, int end) {
    std::memset(part.sums, 0, sizeof(float) * 4 * part.columns * part.rows);
    for_pixels(s, begin, end, [&](int i, int lane) {
        const float x = s.x[i][lane] - part.column, y = s.y[i][lane] - part.row;
        const int column = static_cast<int>(x), row = static_cast<int>(y);
        const float fx = x - column, fy = y - row;
        const float g[4] = {s.weighted[i][0][lane], s.weighted[i][1][lane], s.weighted[i][2][lane], 0.0f};
        const auto add = [&](int right, int down, float weight) {
            if (column + right >= part.columns || row + down >= part.rows) return;  // weight 0 at the border
            float* texel = part.sums + 4 * ((row + down) * part.columns + column + right);
            for (int c = 0; c < 4; ++c) texel[c] += weight * g[c];
        };
        add(0, 0, (1 - fx) * (1 - fy)), add(1, 0, fx * (1 - fy));
        add(0, 1, (1 - fx) * fy), add(1, 1, fx * fy);
    });
}

void add_surfel(const Raster& r, TextureScratch& s, const Limits& limits, TexelArena& arena, int k) {
    const int begin = s.group.first[k], end = s.group.first[k + 1], place = s.group.place[k];
    if (!weigh_surfel(s, limits, begin, end)) return;
    const TextureTable& table = s.textures.of[place];
    TexelPart part{};
#if defined(TEXGS_AVX512)
    if (table.registers) {
        part.sums = take(arena, 48 * table.registers);
        if (!part.sums) return;
        if (table.registers == 1) add_to_registers<1>(s, table, begin, end, part.sums);
        if (table.registers == 2) add_to_registers<2>(s, table, begin, end, part.sums);
        if (table.registers == 4) add_to_registers<4>(s, table, begin, end, part.sums);
    }
#endif
    if (!table.registers) {
        part = touched_part(s, table, begin, end);
        part.sums = take(arena, 4 * part.columns * part.rows);
        if (!part.sums) return;
        add_to_memory(s, part, begin, end);
    }
    r.texel_parts[s.chunk.slots[place]] = part;
}

// Adds one pair's texels to `out` [columns * rows, 3].
void add_part(const TexelPart& part, int registers, int columns, int count, float* out) {
    if (registers) {
        for (int c = 0; c < 3; ++c)
            for (int k = 0; k < count; ++k) out[3 * k + c] += part.sums[16 * registers * c + k];
        return;
    }
    for (int y = 0; y < part.rows; ++y)
        for (int x = 0; x < part.columns; ++x)
            for (int c = 0; c < 3; ++c)
                out[3 * (int64_t(part.row + y) * columns + part.column + x) + c] +=
                    part.sums[4 * (y * part.columns + x) + c];
}

}  // namespace

const int64_t kTextureScratch = sizeof(TextureScratch);

void texture_backward_tile(const Raster& r, int tile, void* scratch, TexelArena& arena) {
    TextureScratch& s = *static_cast<TextureScratch*>(scratch);
    const TilePixels pixels(r, tile);
    const Limits limits(r.options);
    for (int c = 0; c < 3; ++c) {
        std::memset(s.gradient[c], 0, sizeof s.gradient[c]);
        load_plane(r, tile, r.grad.color + int64_t(c) * r.camera.width * r.camera.height, s.gradient[c]);
    }
    uint32_t alive = start_tile(r, pixels, s.transmittance);
    const uint32_t end = r.tile_begin[tile + 1];
    for (uint32_t begin = r.tile_begin[tile]; begin < end && alive; begin += kChunk) {
        const int n = static_cast<int>(end - begin < kChunk ? end - begin : kChunk);
        s.chunk.stage(r, begin, n);
        s.textures.stage(r, s.chunk, n);
        for (int next = 0; next < n;) {
            next = s.group.fill(s.chunk, next, n, alive, [](int) {});
            evaluate_entries(s, pixels, limits);
            for (int k = 0; k < s.group.surfels; ++k) add_surfel(r, s, limits, arena, k);
            alive = still_alive(r, s.transmittance, alive);
        }
    }
    stream_fence();
}

void reduce_textures(const Raster& r, int64_t begin, int64_t end, float* sums) {
    for (int64_t i = begin; i < end; ++i) {
        const int columns = r.surfels.sizes[2 * i], count = columns * r.surfels.sizes[2 * i + 1];
        const int64_t offset = 3 * r.surfels.offsets[i];
        float* texels = r.out.texels ? r.out.texels + offset : sums;
        std::memset(texels, 0, sizeof(float) * 3 * count);
        for (uint32_t slot = r.slot_begin[i]; slot < r.slot_begin[i + 1]; ++slot)
            if (const TexelPart& part = r.texel_parts[slot]; part.sums)
                add_part(part, registers_for(count), columns, count, texels);
        float base[3] = {}, gain = 0.0f;
        for (int k = 0; k < 3 * count; ++k) {
            base[k % 3] += texels[k];
            gain += texels[k] * r.surfels.texels[offset + k];
            texels[k] *= r.surfels.gain[i];
        }
        if (r.out.base)
            for (int c = 0; c < 3; ++c) r.out.base[3 * i + c] = base[c];
        if (r.out.gain) r.out.gain[i] = gain;
    }
}

}  // namespace texgs::TEXGS_ISA
