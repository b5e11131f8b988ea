// SPDX-License-Identifier: Apache-2.0
// Gradients of textures over one tile. The image is linear in the texels: each pixel gives weight * gradient to the
// four texels it was interpolated from. Base and gain need nothing more: the bilinear weights add up to one, so the sum
// over a surfel's texels is the gradient of its base, and the sum weighted by the texels that of its gain.
//
// Each (tile, surfel) pair collects its texels in memory of its own, which reduce_textures adds up in a fixed order.
#include "isa.h"
#include "replay.h"
#include "texture.h"

namespace texgs::TEXGS_ISA {
namespace {

// The pixels of one surfel that got a weight: where they fall in its texture, and weight * gradient.
struct Touches {
    int n;
    float x[kTilePixels + 16], y[kTilePixels + 16], g[3][kTilePixels + 16];
};

// Where pixels fall in a part, and their bilinear weights times the gradient's.
struct Places {
    int32_t texel[kTilePixels + 16];  // the first float of the upper left one of four
    float weight[4][kTilePixels + 16];
};

struct alignas(64) TextureScratch {
    Chunk chunk;
    TextureTables textures;
    Group group;
    Touches touches;
    Places places;
    float gradient[3][kTilePixels];
    float transmittance[kTilePixels];
    float alpha[kVectors][kLanes], x[kVectors][kLanes], y[kVectors][kLanes];
};

TEXGS_INLINE void evaluate_entries(TextureScratch& s, const TilePixels& pixels, const Limits& limits) {
    for (int e = 0; e < s.group.entries; ++e)
        for (int part = 0; part < kParts; ++part) {
            const int place = s.group.surfel[e], i = e * kParts + part;
            const Pixels pixel = pixels.of(s.group.block[e], part);
            const Fragments f = evaluate<Surfel<vf>>(s.chunk.records[place], s.chunk.flags[place], pixel, limits);
            const TexelCoordinates at = texel_coordinates(s.textures.of[place], f.u, f.v);
            store(s.alpha[i], f.log2_alpha);
            store(s.x[i], at.x), store(s.y[i], at.y);
        }
    take_alphas(s.alpha, s.group.entries * kParts, limits);
}

// Vectors of 16 in which the sums of a channel of so many texels are kept; 0: they are scattered to memory.
TEXGS_INLINE int sums_in_registers(int texels) { return kLanes == 16 ? planes_for(texels) : 0; }

// Floats, aligned to cache lines; NULL when memory is exhausted.
TEXGS_INLINE float* take(TexelArena& arena, int64_t floats) {
    floats = (floats + kSlotAlign - 1) / kSlotAlign * kSlotAlign;
    if (arena.end - arena.next < floats) arena.refill(&arena, floats);
    if (arena.end - arena.next < floats) return nullptr;
    float* part = arena.next;
    arena.next += floats;
    return part;
}

// Blends the surfel's entries and gathers the pixels that show it.
TEXGS_INLINE void blend_surfel(TextureScratch& s, const Limits& limits, int begin, int end) {
    Touches& t = s.touches;
    int n = 0;
    for (int e = begin; e < end; ++e)
        for (int part = 0; part < kParts; ++part) {
            const int i = e * kParts + part, pixel = s.group.block[e] * kBlockPixels + part * kLanes;
            const vf w = blend(load(s.alpha[i]), s.transmittance + pixel, limits).weight;
            const vm hit = w > vf(0.0f);
            store_chosen(t.x + n, load(s.x[i]), hit);
            store_chosen(t.y + n, load(s.y[i]), hit);
            for (int c = 0; c < 3; ++c) store_chosen(t.g[c] + n, w * load(s.gradient[c] + pixel), hit);
            n += count(hit);
        }
    t.n = n;
    store(t.x + n, t.x[0]), store(t.y + n, t.y[0]);  // pixels are taken in groups, of which the last may go on here
    for (int c = 0; c < 3; ++c) store(t.g[c] + n, 0.0f);
}

#if defined(TEXGS_AVX512)
// Small textures live in registers, a lane per texel: a pixel's bilinear weights are a product of two tents.
template <int Registers>
TEXGS_INLINE void add_to_registers(const Touches& t, const TextureTable& table, float* out) {
    constexpr int sets = Registers == 1 ? 2 : 1;  // of sums: one register alone would wait for its own additions
    vf column[Registers], row[Registers], sum[sets][3][Registers];
    for (int k = 0; k < Registers; ++k) {
        const vf texel = to_float(iota()) + vf(16.0f * k);
        row[k] = floor((texel + vf(0.5f)) / vf(table.columns));
        column[k] = fnma(row[k], table.columns, texel);
    }
    for (int set = 0; set < sets; ++set)
        for (int c = 0; c < 3; ++c)
            for (int k = 0; k < Registers; ++k) sum[set][c][k] = 0.0f;
    for (int i = 0; i < t.n; i += sets)
        for (int set = 0; set < sets; ++set) {
            const vf x = t.x[i + set], y = t.y[i + set];
            for (int k = 0; k < Registers; ++k) {
                const vf tent = max(vf(1.0f) - abs(x - column[k]), 0.0f) * max(vf(1.0f) - abs(y - row[k]), 0.0f);
                for (int c = 0; c < 3; ++c) sum[set][c][k] = fma(tent, t.g[c][i + set], sum[set][c][k]);
            }
        }
    for (int c = 0; c < 3; ++c)
        for (int k = 0; k < Registers; ++k)
            stream(out + 16 * (c * Registers + k), sets == 1 ? sum[0][c][k] : sum[0][c][k] + sum[sets - 1][c][k]);
}
#endif

// Bounds of the texels that the surfel's pixels in this tile touch.
TEXGS_INLINE TexelPart touched_part(const Touches& t, const TextureTable& table) {
    vf low_x = t.x[0], low_y = t.y[0], high_x = low_x, high_y = low_y;
    for (int i = 0; i < t.n; i += kLanes) {
        const vf x = load(t.x + i), y = load(t.y + i);
        low_x = min(low_x, x), high_x = max(high_x, x), low_y = min(low_y, y), high_y = max(high_y, y);
    }
    const int columns = static_cast<int>(table.columns), rows = static_cast<int>(table.rows);
    const int right = static_cast<int>(largest(high_x)) + 2, bottom = static_cast<int>(largest(high_y)) + 2;
    TexelPart part{};
    part.column = static_cast<int>(-largest(-low_x)), part.row = static_cast<int>(-largest(-low_y));
    part.columns = (right < columns ? right : columns) - part.column;
    part.rows = (bottom < rows ? bottom : rows) - part.row;
    return part;
}

TEXGS_INLINE void find_places(const Touches& t, const TexelPart& part, Places& places) {
    const vf column = float(part.column), row = float(part.row), columns = float(part.columns);
    const vf last_column = float(part.columns > 1 ? part.columns - 2 : 0),
             last_row = float(part.rows > 1 ? part.rows - 2 : 0);
    for (int i = 0; i < t.n + 3; i += kLanes) {
        const vf x = load(t.x + i) - column, y = load(t.y + i) - row;
        const vf cx = min(floor(x), last_column), cy = min(floor(y), last_row);
        const vf fx = x - cx, fy = y - cy, one = 1.0f;
        store(places.texel + i, truncate(vf(4.0f) * fma(cy, columns, cx)));
        store(places.weight[0] + i, (one - fx) * (one - fy));
        store(places.weight[1] + i, fx * (one - fy));
        store(places.weight[2] + i, (one - fx) * fy);
        store(places.weight[3] + i, fx * fy);
    }
}

// Larger ones are scattered to memory: four floats a texel. Neighbouring pixels share texels, and each would wait for
// the one before; so pixels are taken from four places in turn.
void add_to_memory(const Touches& t, const TexelPart& part, Places& places) {
    std::memset(part.sums, 0, sizeof(float) * 4 * part.columns * part.rows);
    find_places(t, part, places);
    const int right = part.columns > 1 ? 4 : 0, down = part.rows > 1 ? 4 * part.columns : 0;
    const int steps[4] = {0, right, down, right + down};
    const int quarter = (t.n + 3) / 4;
    for (int k = 0; k < quarter; ++k)
        for (int i = k; i < 4 * quarter; i += quarter) {
            const float g[4] = {t.g[0][i], t.g[1][i], t.g[2][i], 0.0f};
            for (int corner = 0; corner < 4; ++corner) {
                float* texel = part.sums + places.texel[i] + steps[corner];
                const float weight = places.weight[corner][i];
                for (int c = 0; c < 4; ++c) texel[c] += weight * g[c];
            }
        }
}

void add_surfel(const Raster& r, TextureScratch& s, const Limits& limits, TexelArena& arena, int k) {
    const int begin = s.group.first[k], end = s.group.first[k + 1], place = s.group.place[k];
    blend_surfel(s, limits, begin, end);
    if (!s.touches.n) return;
    const TextureTable& table = s.textures.of[place];
    const int registers = sums_in_registers(static_cast<int>(table.columns * table.rows));
    TexelPart part{};
    if (!registers) part = touched_part(s.touches, table);
    part.sums = take(arena, registers ? 48 * registers : 4 * part.columns * part.rows);
    if (!part.sums) return;
    if (!registers) add_to_memory(s.touches, part, s.places);
#if defined(TEXGS_AVX512)
    if (registers == 1) add_to_registers<1>(s.touches, table, part.sums);
    if (registers == 2) add_to_registers<2>(s.touches, table, part.sums);
    if (registers == 4) add_to_registers<4>(s.touches, table, part.sums);
#endif
    r.texel_parts[s.chunk.slots[place]] = part;
}

#if defined(TEXGS_AVX512)
// Sums the planes of pairs [begin, end), interleaved to `out` [count, 3]; `base` receives the sums over all texels.
template <int Registers>
TEXGS_INLINE void sum_registers(const TexelPart* parts, uint32_t begin, uint32_t end, int count, float* out,
                                float base[3]) {
    constexpr int n = 3 * Registers;
    vf sums[n];
    for (int k = 0; k < n; ++k) sums[k] = 0.0f;
    for (uint32_t slot = begin; slot < end; ++slot)
        if (const float* from = parts[slot].sums)
            for (int k = 0; k < n; ++k) sums[k] += load(from + 16 * k);
    float planes[16 * n];
    for (int c = 0; c < 3; ++c) {
        vf all = 0.0f;
        for (int k = 0; k < Registers; ++k) {
            store(planes + 16 * (c * Registers + k), sums[c * Registers + k]);
            all += sums[c * Registers + k];
        }
        base[c] = sum(all);
    }
    for (int k = 0; k < count; ++k)
        for (int c = 0; c < 3; ++c) out[3 * k + c] = planes[16 * Registers * c + k];
}
#endif

TEXGS_INLINE void sum_memory(const TexelPart* parts, uint32_t begin, uint32_t end, int columns, int count, float* out,
                             float base[3]) {
    std::memset(out, 0, sizeof(float) * 3 * count);
    for (uint32_t slot = begin; slot < end; ++slot) {
        const TexelPart& part = parts[slot];
        if (!part.sums) continue;
        for (int y = 0; y < part.rows; ++y) {
            float* to = out + 3 * (int64_t(part.row + y) * columns + part.column);
            const float* from = part.sums + 4 * int64_t(y) * part.columns;
            for (int x = 0; x < part.columns; ++x)
                for (int c = 0; c < 3; ++c) to[3 * x + c] += from[4 * x + c];
        }
    }
    base[0] = base[1] = base[2] = 0;
    for (int k = 0; k < count; ++k)
        for (int c = 0; c < 3; ++c) base[c] += out[3 * k + c];
}

TEXGS_INLINE void sum_parts(const TexelPart* parts, uint32_t begin, uint32_t end, int columns, int count, float* out,
                            float base[3]) {
    switch (sums_in_registers(count)) {
#if defined(TEXGS_AVX512)
        case 1:
            return sum_registers<1>(parts, begin, end, count, out, base);
        case 2:
            return sum_registers<2>(parts, begin, end, count, out, base);
        case 4:
            return sum_registers<4>(parts, begin, end, count, out, base);
#endif
        default:
            return sum_memory(parts, begin, end, columns, count, out, base);
    }
}

// Dot product of `texels` with `with`, and texels *= factor.
TEXGS_INLINE float dot_and_scale(float* texels, const float* with, float factor, int n) {
    vf sums = 0.0f;
    for (int k = 0; k < n; k += kLanes) {
        const int part = n - k < kLanes ? n - k : kLanes;
        const vf a = load_part(texels + k, part);
        sums = fma(a, load_part(with + k, part), sums);
        store_part(texels + k, a * vf(factor), part);
    }
    return sum(sums);
}

// Asks for the sums of the surfels to come: they lie in the order of the tiles.
TEXGS_INLINE void prefetch_part(const Raster& r, uint32_t slot, int lines) {
    if (slot >= r.slot_begin[r.surfels.n] || !r.texel_parts[slot].sums) return;
    for (int k = 0; k < lines; ++k) prefetch(r.texel_parts[slot].sums + 16 * k);
}

}  // namespace

const int64_t kTextureScratch = sizeof(TextureScratch);

void texture_backward_tile(const Raster& r, int tile, void* scratch, TexelArena& arena) {
    if (r.tile_begin[tile] == r.tile_begin[tile + 1]) return;
    TextureScratch& s = *static_cast<TextureScratch*>(scratch);
    const TilePixels pixels(r, tile);
    const Limits limits(r.options);
    for (int c = 0; c < 3; ++c) {
        std::memset(s.gradient[c], 0, sizeof s.gradient[c]);
        load_plane(r, tile, r.grad.color + int64_t(c) * r.camera.width * r.camera.height, s.gradient[c]);
    }
    prefetch_planes(r, tile + 1, r.grad.color, 3);
    uint32_t alive = start_tile(r, pixels, s.transmittance);
    const uint32_t end = r.tile_begin[tile + 1];
    for (uint32_t begin = r.tile_begin[tile]; begin < end && alive; begin += kChunk) {
        const int n = static_cast<int>(end - begin < kChunk ? end - begin : kChunk);
        s.chunk.stage(r, begin, n);
        s.textures.stage_layout(r, s.chunk, n);
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
    constexpr uint32_t ahead = 24;
    for (int64_t i = begin; i < end; ++i) {
        const int columns = r.surfels.sizes[2 * i], count = columns * r.surfels.sizes[2 * i + 1];
        const int64_t offset = 3 * r.surfels.offsets[i];
        float* texels = r.out.texels ? r.out.texels + offset : sums;
        for (uint32_t slot = r.slot_begin[i]; slot < r.slot_begin[i + 1]; ++slot)
            prefetch_part(r, slot + ahead, count > 16 ? 12 : 3);
        float base[3];
        sum_parts(r.texel_parts, r.slot_begin[i], r.slot_begin[i + 1], columns, count, texels, base);
        const float gain = dot_and_scale(texels, r.surfels.texels + offset, r.surfels.gain[i], 3 * count);
        if (r.out.base)
            for (int c = 0; c < 3; ++c) r.out.base[3 * i + c] = base[c];
        if (r.out.gain) r.out.gain[i] = gain;
    }
}

}  // namespace texgs::TEXGS_ISA
