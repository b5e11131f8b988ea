// SPDX-License-Identifier: Apache-2.0
// What is drawn. Kernels are templates over P, a Surfel or a Gaussian of what they work on at a time.
#pragma once
#include "gaussian.h"
#include "surfel.h"

namespace texgs::TEXGS_ISA {
namespace {

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
