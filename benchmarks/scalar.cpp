// SPDX-License-Identifier: Apache-2.0
//
// The loop that one writes first: boxes around surfels, lists per 16 x 16 tile, and for each pixel one surfel of its
// tile after the other. One thread, plain C++; the semantics are those of texgs.raster with its default options.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

namespace {
constexpr int TILE = 16;
constexpr float LOW_PASS = 2, ALPHA_MIN = 1 / 255.f, LIGHT_MIN = 1e-4f, NEAR = 0.2f;

struct Vec {
    float x, y, z;
};
Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
float dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec plane(float at, Vec w, Vec t) { return {at * w.x - t.x, at * w.y - t.y, at * w.z - t.z}; }

struct Surfel {
    Vec tu, tv, tw;  // rows of the map from (u, v, 1) to homogeneous pixels
    float x, y, opacity;
    float box[4];
};

struct Scene {
    int32_t n;
    const float *means, *quats, *scales, *opacities, *features, *viewmat, *K;
    int32_t width, height;
};

Surfel project(const Scene& s, int i) {
    const float *q = s.quats + 4 * i, *m = s.means + 3 * i, *V = s.viewmat, *K = s.K;
    float l = 1 / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    float w = l * q[0], x = l * q[1], y = l * q[2], z = l * q[3], su = s.scales[2 * i], sv = s.scales[2 * i + 1];
    Vec a{su * (1 - 2 * (y * y + z * z)), su * 2 * (x * y + w * z), su * 2 * (x * z - w * y)};
    Vec b{sv * 2 * (x * y - w * z), sv * (1 - 2 * (x * x + z * z)), sv * 2 * (y * z + w * x)};
    Vec c{m[0], m[1], m[2]}, row[3];
    for (int k = 0; k < 3; k++) {
        Vec r{V[4 * k], V[4 * k + 1], V[4 * k + 2]};
        row[k] = {dot(r, a), dot(r, b), dot(r, c) + V[4 * k + 3]};
    }
    Vec X = row[0], Y = row[1], Z = row[2];
    Surfel o{{K[0] * X.x + K[2] * Z.x, K[0] * X.y + K[2] * Z.y, K[0] * X.z + K[2] * Z.z},
             {K[4] * Y.x + K[5] * Z.x, K[4] * Y.y + K[5] * Z.y, K[4] * Y.z + K[5] * Z.z},
             Z,
             0,
             0,
             s.opacities[i],
             {0, 0, float(s.width), float(s.height)}};
    o.x = o.tu.z / Z.z, o.y = o.tv.z / Z.z;
    float rho = 2 * std::log(std::max(o.opacity / ALPHA_MIN, 1.f)), disc = std::sqrt(rho / LOW_PASS);
    auto form = [&](Vec p, Vec t) { return rho * (p.x * t.x + p.y * t.y) - p.z * t.z; };
    float d = form(Z, Z);
    if (d >= 0) return o;  // reaches behind the camera: the whole image
    float mu = form(o.tu, Z) / d, mv = form(o.tv, Z) / d;
    float eu = std::sqrt(std::max(mu * mu - form(o.tu, o.tu) / d, 0.f));
    float ev = std::sqrt(std::max(mv * mv - form(o.tv, o.tv) / d, 0.f));
    o.box[0] = std::min(mu - eu, o.x - disc), o.box[1] = std::min(mv - ev, o.y - disc);
    o.box[2] = std::max(mu + eu, o.x + disc), o.box[3] = std::max(mv + ev, o.y + disc);
    return o;
}

// Calls blend(pixel, surfel, weight) for every fragment, front to back.
template <class Blend>
void each_fragment(const Scene& s, Blend blend) {
    std::vector<Surfel> surfels(s.n);
    std::vector<int> order(s.n);
    for (int i = 0; i < s.n; i++) surfels[i] = project(s, i);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return surfels[a].tw.z < surfels[b].tw.z; });
    int columns = (s.width + TILE - 1) / TILE, rows = (s.height + TILE - 1) / TILE;
    std::vector<std::vector<int>> tiles(columns * rows);
    for (int i : order) {
        const Surfel& o = surfels[i];
        if (o.tw.z <= NEAR || o.opacity < ALPHA_MIN || o.box[2] < 0 || o.box[3] < 0) continue;
        if (o.box[0] > s.width || o.box[1] > s.height) continue;
        int x0 = std::max(0.f, o.box[0]) / TILE, x1 = std::min(o.box[2] / TILE, columns - 1.f);
        int y0 = std::max(0.f, o.box[1]) / TILE, y1 = std::min(o.box[3] / TILE, rows - 1.f);
        for (int y = y0; y <= y1; y++)
            for (int x = x0; x <= x1; x++) tiles[y * columns + x].push_back(i);
    }
    for (int py = 0; py < s.height; py++)
        for (int px = 0; px < s.width; px++) {
            float light = 1, x = px + 0.5f, y = py + 0.5f;
            for (int i : tiles[py / TILE * columns + px / TILE]) {
                const Surfel& o = surfels[i];
                Vec hit = cross(plane(x, o.tw, o.tu), plane(y, o.tw, o.tv));
                float u = hit.x / hit.z, v = hit.y / hit.z, dx = x - o.x, dy = y - o.y;
                float depth = o.tw.z + u * o.tw.x + v * o.tw.y, rho = LOW_PASS * (dx * dx + dy * dy);
                if (depth > NEAR) rho = std::min(rho, u * u + v * v);
                float alpha = std::min(0.99f, o.opacity * std::exp(-0.5f * rho));
                if (alpha < ALPHA_MIN) continue;
                if (light * (1 - alpha) < LIGHT_MIN) break;
                blend(py * s.width + px, i, light * alpha);
                light *= 1 - alpha;
            }
        }
}
}  // namespace

extern "C" void scalar_forward(const Scene* s, float* color) {  // [H, W, 3]
    std::fill(color, color + 3 * int64_t(s->width) * s->height, 0.f);
    each_fragment(*s, [&](int64_t p, int64_t i, float w) {
        for (int c = 0; c < 3; c++) color[3 * p + c] += w * s->features[3 * i + c];
    });
}

extern "C" void scalar_backward(const Scene* s, const float* grad, float* features) {  // [H, W, 3], [N, 3]
    std::fill(features, features + 3 * int64_t(s->n), 0.f);
    each_fragment(*s, [&](int64_t p, int64_t i, float w) {
        for (int c = 0; c < 3; c++) features[3 * i + c] += w * grad[3 * p + c];
    });
}
