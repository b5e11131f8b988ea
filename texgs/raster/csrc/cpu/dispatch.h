// SPDX-License-Identifier: Apache-2.0
// Which of the compiled instruction sets to run: the best this machine has, or the one named by TEXGS_ISA.
#pragma once

namespace texgs {

enum class Isa { portable, avx2, avx512 };

// Chosen at the first call. Throws std::runtime_error where TEXGS_ISA names one that is unknown or not to be had.
Isa active_isa();
const char* isa_name(Isa);

}  // namespace texgs
