// SPDX-License-Identifier: Apache-2.0
// What is drawn. Kernels are templates over P, a Surfel or a Gaussian of what they work on at a time.
#pragma once
#include "gaussian.h"
#include "surfel.h"

namespace texgs::TEXGS_ISA {
namespace {

// Standard deviations and opacity from logarithms and a logit, and the gradients of these.
template <class P>
TEXGS_MATHS void activate(P& p) {
    for (auto& scale : p.scale) scale = exp(scale);
    p.opacity = sigmoid(p.opacity);
}
template <class P, class F, int N>
TEXGS_MATHS void activate_backward(const P& p, Gradient<F, N>& g) {
    for (int k = 0; k < N; ++k) g.scale[k] = g.scale[k] * p.scale[k];
    g.opacity = g.opacity * (p.opacity * (F(1.0f) - p.opacity));
}

template <class P>
struct Type {
    using type = P;
};

// Calls body with the Type of the primitive that has so many scales.
template <class F, class Body>
void with_primitive(int axes, Body body) {
    if (axes == Gaussian<F>::kScales) return body(Type<Gaussian<F>>{});
    body(Type<Surfel<F>>{});
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
