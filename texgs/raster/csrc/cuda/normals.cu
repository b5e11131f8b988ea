// SPDX-License-Identifier: Apache-2.0
// Normals of the surface behind a depth map, and how far they agree with blended normals.
//
// A pixel's ray is r = ((x - cx) / fx, (y - cy) / fy, 1), its point z r. The cross product of the central differences
// of the points (Huang et al. 2024) is, up to a positive factor, the camera-space vector
//     (gx, gy, -(1 + r.x gx + r.y gy)),  gx = fx (z_right - z_left) / (z_right + z_left),  gy likewise,
// which always faces the camera and needs no points.
//
// The gradient of a depth is gathered from the four normals that it takes part in: no atomics.
#include "../checks.h"
#include "../texgs_losses.h"
#include "maths.cuh"
#include "workspace.cuh"

namespace texgs::cuda {
namespace {

constexpr int kBlock = 256;

struct Map {
    const float *depth, *viewmat, *K;
    int height, width;

    __device__ int64_t pixels() const { return int64_t(height) * width; }
    __device__ bool inner(int x, int y) const { return x > 0 && y > 0 && x < width - 1 && y < height - 1; }
    __device__ Vec3<float> load(const float* image, int64_t i) const {
        return {image[i], image[i + pixels()], image[i + 2 * pixels()]};
    }
    __device__ void store(float* image, int64_t i, Vec3<float> a) const {
        image[i] = a.x, image[i + pixels()] = a.y, image[i + 2 * pixels()] = a.z;
    }
};

struct Surface {
    float rx, ry, left, right, up, down;  // ray, depths of the neighbours
    float inverse_x, inverse_y;           // 1 / (left + right), 1 / (up + down), or 0 where a neighbour has no depth
    float inverse_length;
    Vec3<float> normal;  // camera space, unit, or 0

    // At a pixel that is not at the border of the image.
    __device__ Surface(const Map& map, const View& view, int x, int y) {
        const float* depth = map.depth + (int64_t(y) * map.width + x);
        left = depth[-1], right = depth[1], up = depth[-map.width], down = depth[map.width];
        const bool seen = left > 0.0f && right > 0.0f && up > 0.0f && down > 0.0f;
        inverse_x = seen ? 1.0f / (left + right) : 0.0f, inverse_y = seen ? 1.0f / (up + down) : 0.0f;
        rx = (x + 0.5f - view.cx) / view.fx, ry = (y + 0.5f - view.cy) / view.fy;
        const float gx = view.fx * (right - left) * inverse_x, gy = view.fy * (down - up) * inverse_y;
        const Vec3<float> v{gx, gy, -fma(rx, gx, fma(ry, gy, 1.0f))};
        inverse_length = seen ? 1.0f / sqrt(dot(v, v)) : 0.0f;
        normal = inverse_length * v;
    }
};

// Gradient of a normal by the differences of depths, along x and along y.
struct DepthGradient {
    float x, y;
    __device__ DepthGradient(const View& view, const Surface& s, Vec3<float> by_normal) {
        const Vec3<float> g = rotate(view, by_normal);
        const Vec3<float> by_v = s.inverse_length * (g - dot(g, s.normal) * s.normal);
        x = 2.0f * view.fx * (by_v.x - s.rx * by_v.z) * s.inverse_x * s.inverse_x;
        y = 2.0f * view.fy * (by_v.y - s.ry * by_v.z) * s.inverse_y * s.inverse_y;
    }
};

// Gradient of the depth at (x, y); by_normal(i) is that of the world normal at pixel i.
template <class ByNormal>
__device__ float gather_depth_gradient(const Map& map, const View& view, int x, int y, ByNormal by_normal) {
    const auto at = [&](int nx, int ny, auto part) {
        if (!map.inner(nx, ny)) return 0.0f;
        const Surface s(map, view, nx, ny);
        return part(s, DepthGradient(view, s, by_normal(int64_t(ny) * map.width + nx)));
    };
    float total = at(x - 1, y, [](const Surface& s, const DepthGradient& g) { return g.x * s.left; });
    total += at(x + 1, y, [](const Surface& s, const DepthGradient& g) { return -g.x * s.right; });
    total += at(x, y - 1, [](const Surface& s, const DepthGradient& g) { return g.y * s.up; });
    total += at(x, y + 1, [](const Surface& s, const DepthGradient& g) { return -g.y * s.down; });
    return total;
}

__device__ Vec3<float> world_normal(const Map& map, const View& view, int x, int y) {
    if (!map.inner(x, y)) return {0.0f, 0.0f, 0.0f};
    return rotate_back(view, Surface(map, view, x, y).normal);
}

__global__ __launch_bounds__(kBlock) void normal_kernel(const Map map, float* normal) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= map.pixels()) return;
    const View view = make_view(map.viewmat, map.K);
    map.store(normal, i, world_normal(map, view, static_cast<int>(i % map.width), static_cast<int>(i / map.width)));
}

__global__ __launch_bounds__(kBlock) void normal_backward_kernel(const Map map, const float* grad_normal,
                                                                 float* grad_depth) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    if (i >= map.pixels()) return;
    grad_depth[i] =
        gather_depth_gradient(map, make_view(map.viewmat, map.K), static_cast<int>(i % map.width),
                              static_cast<int>(i / map.width), [&](int64_t k) { return map.load(grad_normal, k); });
}

struct Consistency {
    const float *normal, *alpha;
    float scale;  // derivative of the value by one pixel's agreement
    double* sums;
    float *grad_normal, *grad_depth;
};

__global__ __launch_bounds__(kBlock) void consistency_kernel(const Map map, const Consistency c) {
    const int64_t i = int64_t(blockIdx.x) * kBlock + threadIdx.x;
    float agreement = 0.0f;
    if (i < map.pixels()) {
        const View view = make_view(map.viewmat, map.K);
        const int x = static_cast<int>(i % map.width), y = static_cast<int>(i / map.width);
        const Vec3<float> from_depth = world_normal(map, view, x, y);
        agreement = c.alpha[i] * dot(map.load(c.normal, i), from_depth);
        if (c.grad_normal) map.store(c.grad_normal, i, (c.scale * c.alpha[i]) * from_depth);
        if (c.grad_depth)
            c.grad_depth[i] = gather_depth_gradient(
                map, view, x, y, [&](int64_t k) { return (c.scale * c.alpha[k]) * map.load(c.normal, k); });
    }
    const double sum = block_sum<kBlock>(agreement);
    if (threadIdx.x == 0) c.sums[blockIdx.x] = sum;
}

}  // namespace
}  // namespace texgs::cuda

using namespace texgs;
using namespace texgs::cuda;

int32_t texgs_depth_to_normal(const float* depth, const float* viewmat, const float* K, int32_t height, int32_t width,
                              float* normal, void* on) {
    return on_device_of(viewmat, on, [&](cudaStream_t stream) {
        check_image(1, height, width);
        launch(normal_kernel, blocks_for(int64_t(height) * width, kBlock), kBlock, stream,
               Map{depth, viewmat, K, height, width}, normal);
    });
}

int32_t texgs_depth_to_normal_backward(const float* depth, const float* viewmat, const float* K, int32_t height,
                                       int32_t width, const float* grad_normal, float* grad_depth, void* on) {
    return on_device_of(viewmat, on, [&](cudaStream_t stream) {
        check_image(1, height, width);
        launch(normal_backward_kernel, blocks_for(int64_t(height) * width, kBlock), kBlock, stream,
               Map{depth, viewmat, K, height, width}, grad_normal, grad_depth);
    });
}

int32_t texgs_normal_consistency(const float* normal, const float* depth, const float* alpha, const float* viewmat,
                                 const float* K, int32_t height, int32_t width, float weight, float* value,
                                 float* grad_normal, float* grad_depth, void* on) {
    return with_workspace(viewmat, on, [&](Workspace& workspace, cudaStream_t stream) {
        check_image(1, height, width);
        const int64_t n = int64_t(height) * width, blocks = blocks_for(n, kBlock);
        double* sums = workspace.sums.ensure<double>(blocks);
        const Consistency c{normal, alpha, static_cast<float>(-weight / double(n)), sums, grad_normal, grad_depth};
        launch(consistency_kernel, blocks, kBlock, stream, Map{depth, viewmat, K, height, width}, c);
        finish_sum(sums, blocks, 1, weight, -weight / double(n), value, stream);
    });
}
