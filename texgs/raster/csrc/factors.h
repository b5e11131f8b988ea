// SPDX-License-Identifier: Apache-2.0
// Factors of a material from the numbers that learn. Include it after a header that declares sigmoid for F in namespace
// texgs::TEXGS_ISA.
#pragma once
#include "both.h"
#include "texgs_losses.h"

namespace texgs::TEXGS_ISA {
namespace {

template <class F>
TEXGS_MATHS F factor(const texgs_factors& form, int k, F number) {
    return form.raw >> k & 1 ? F(form.low[k]) + F(form.span[k]) * sigmoid(number) : number;
}

// The derivative of factor() where it has a value.
template <class F>
TEXGS_MATHS F factor_slope(const texgs_factors& form, int k, F value) {
    const F above = value - F(form.low[k]);
    return form.raw >> k & 1 ? above * (F(1.0f) - above * F(1.0f / form.span[k])) : F(1.0f);
}

}  // namespace
}  // namespace texgs::TEXGS_ISA
