// SPDX-License-Identifier: Apache-2.0
// The loss of a view with its gradients: rendering, losses and the way back, one after the other. The same on CPUs and
// GPUs; each library has it once.
#pragma once
#include "texgs_fit.h"
#include "texgs_losses.h"

int32_t texgs_rendered_loss(const texgs_surfels* surfels, const texgs_camera* camera, const texgs_options* options,
                            const texgs_image* image, const texgs_image* grad, const texgs_target* target,
                            const texgs_gradients* out, float* values, void* stream) {
    const texgs_target& t = *target;
    const int32_t h = camera->height, w = camera->width, attributes = surfels->channels - TEXGS_COLORS;
    const int64_t colors = int64_t(TEXGS_COLORS) * h * w;
    texgs_frame* frame = nullptr;
    int32_t status = texgs_forward(surfels, camera, options, image, &frame, stream);
    const auto then = [&](bool wanted, const auto& step) {
        if (!status && wanted) status = step();
    };
    then(true, [&] {
        return texgs_l1_dssim(image->color, t.color, TEXGS_COLORS, h, w, t.l1, t.dssim, values, grad->color, stream);
    });
    then(grad->alpha, [&] {
        return texgs_l1_dssim(image->alpha, t.alpha, 1, h, w, t.alpha_l1, t.alpha_dssim, values + 1, grad->alpha,
                              stream);
    });
    then(grad->normal, [&] {
        return texgs_normal_consistency(image->normal, image->depth, image->alpha, camera->viewmat, camera->K, h, w,
                                        t.normal, values + 2, grad->normal, grad->depth, stream);
    });
    then(attributes > 0, [&] {
        return texgs_bilateral_smoothness(image->color + colors, t.color, t.alpha, attributes, h, w, t.smoothness,
                                          values + 3, grad->color + colors, stream);
    });
    then(out, [&] { return texgs_backward(frame, surfels, camera, options, image, grad, out, stream); });
    texgs_release(frame);
    return status;
}
