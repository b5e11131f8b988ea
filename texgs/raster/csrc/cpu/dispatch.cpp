// SPDX-License-Identifier: Apache-2.0
#include "dispatch.h"

#include <cstdlib>
#include <stdexcept>
#include <string>

#include "kernels.h"

#if defined(_MSC_VER) && !defined(__clang__)
#include <immintrin.h>
#include <intrin.h>
#endif

#if defined(__x86_64__) || defined(_M_X64)
#define TEXGS_X86 1
#endif

namespace texgs {

namespace portable {
extern const Kernels table;
}
#if defined(TEXGS_X86)
namespace avx2 {
extern const Kernels table;
}
namespace avx512 {
extern const Kernels table;
}
#endif

namespace {

bool machine_has(Isa isa) {
    if (isa == Isa::portable) return true;
#if defined(TEXGS_X86) && defined(__GNUC__)
    if (isa == Isa::avx2) return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
#elif defined(TEXGS_X86)
    int leaf1[4], leaf7[4];
    __cpuid(leaf1, 1);
    __cpuidex(leaf7, 7, 0);
    if (!(leaf1[2] >> 27 & 1)) return false;  // the system does not save vector registers
    const auto saved = _xgetbv(0);
    if (isa == Isa::avx2) return (saved & 6) == 6 && (leaf7[1] >> 5 & 1) && (leaf1[2] >> 12 & 1);
    const int wanted = 1 << 16 | 1 << 17 | 1 << 30 | 1 << 31;  // F, DQ, BW, VL
    return (saved & 0xe6) == 0xe6 && (leaf7[1] & wanted) == wanted;
#else
    return false;
#endif
}

Isa choose() {
    const char* forced = std::getenv("TEXGS_ISA");
    for (const Isa isa : {Isa::avx512, Isa::avx2, Isa::portable}) {
        const bool named = forced && *forced && std::string(forced) == isa_name(isa);
        if (named && !machine_has(isa))
            throw std::runtime_error(std::string("TEXGS_ISA=") + forced + ": this machine does not have it; unset it");
        if (named || ((!forced || !*forced) && machine_has(isa))) return isa;
    }
    throw std::runtime_error(std::string("TEXGS_ISA=") + forced + ": expected avx512, avx2 or portable");
}

}  // namespace

Isa active_isa() {
    static const Isa isa = choose();
    return isa;
}

const char* isa_name(Isa isa) { return isa == Isa::avx512 ? "avx512" : isa == Isa::avx2 ? "avx2" : "portable"; }

const Kernels& kernels() {
#if defined(TEXGS_X86)
    if (active_isa() == Isa::avx512) return avx512::table;
    if (active_isa() == Isa::avx2) return avx2::table;
#endif
    (void)active_isa();
    return portable::table;
}

}  // namespace texgs
