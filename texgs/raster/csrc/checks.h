// SPDX-License-Identifier: Apache-2.0
// What the C interface refuses before any work, the same in every library.
#pragma once
#include "status.h"

namespace texgs {

inline void check_surfels(const texgs_surfels& s) {
    require(s.n >= 0 && s.n < (int64_t(1) << 31), "surfels: expected fewer than 2^31");
    const bool some = s.n > 0;  // memory of no elements may have no address
    require(!some || (s.means && s.quats && s.scales && s.opacities),
            "surfels: means, quats, scales and opacities are needed");
    require(!some || s.features || s.base, "surfels: features or a texture are needed");
    require(s.axes == 2 || s.axes == 3, "surfels: expected 2 scales of surfels or 3 of 3D Gaussians");
    require(s.axes == 2 || !s.base, "texture: 3D Gaussians have none");
    require(s.channels >= 1 && s.channels <= TEXGS_MAX_CHANNELS, "channels: expected 1 to 32");
    require(!s.base || (s.channels >= 3 && s.gain && s.texels && s.sizes && s.offsets),
            "texture: base, gain, texels, sizes and offsets are needed, with 3 channels at least");
    require(!s.base || !some || (s.channels > 3) == (s.features != nullptr),
            "features: expected C - 3 beside a texture");
}

inline void check_camera(const texgs_camera& c) {
    require(c.viewmat && c.K, "camera: viewmat and K are needed");
    require(c.width >= 1 && c.height >= 1 && c.width <= TEXGS_MAX_SIDE && c.height <= TEXGS_MAX_SIDE,
            "image: width and height must be 1 to 2^20 - 16");
}

inline void check_options(const texgs_options& o) {
    require(o.low_pass > 0, "low_pass: expected above 0");
    require(o.filter_sigma >= 0, "filter_sigma: expected 0 or more");
    require(o.dilation > 0, "dilation: expected above 0");
    require(o.alpha_min >= 1e-30f && o.alpha_min < 1, "alpha_min: expected 1e-30 to 1, without 1");
    require(o.transmittance_min >= 0 && o.transmittance_min < 1, "transmittance_min: expected 0 to 1, without 1");
    require(o.near_plane > 0 && o.far_plane > o.near_plane, "near, far: expected 0 < near < far");
}

inline void check_scene(const texgs_surfels& s, const texgs_camera& c, const texgs_options& o, const texgs_image& i) {
    check_surfels(s);
    check_camera(c);
    check_options(o);
    require(s.axes == 2 || !i.normal, "normal: 3D Gaussians have none");
}

// What follows a forward call is of its surfels and its image: `made` is what the frame was made of.
template <class Raster>
void check_frame(const Raster& made, const texgs_surfels& s, const texgs_camera& c) {
    require(s.n == made.surfels.n && s.axes == made.surfels.axes && s.channels == made.surfels.channels,
            "frame: expected as many surfels, scales and channels as in the forward call");
    require(c.width == made.camera.width && c.height == made.camera.height,
            "frame: expected an image as large as in the forward call");
}

// `with_normal`: whether the forward call rendered normals.
inline void check_gradients(const texgs_image& image, const texgs_image& grad, bool with_normal) {
    require(image.color && image.alpha, "backward: the forward colour and alpha are needed");
    require(!grad.normal || with_normal, "backward: a normal gradient without a forward normal");
    require((!grad.depth || image.depth) && (!grad.median || image.median) && (!grad.distortion || image.distortion),
            "backward: a gradient of depth, median or distortion without the forward one");
}

inline void check_contributions(const texgs_contributions& c) {
    require(!c.image || (c.channels >= 1 && c.channels <= TEXGS_MAX_CHANNELS), "channels: expected 1 to 32");
}

// The image of a loss.
inline void check_image(int64_t channels, int64_t height, int64_t width) {
    require(channels >= 1 && height >= 1 && width >= 1, "image: expected at least one pixel, got none");
}

inline void check_degree(int32_t degree) {
    require(degree >= 0 && degree <= 3, "spherical harmonics: expected degree 0 to 3");
}

}  // namespace texgs
