// SPDX-License-Identifier: Apache-2.0
// What the compiler calls at each access to memory (-fsanitize=thread) and each index past the end of an array
// (-fsanitize=bounds). The sanitizers' own runtimes know nothing of blocks and barriers, so this takes their place, as
// KCSAN does in the Linux kernel.
#include "emulation.h"

namespace {

void note(const void* address, size_t bytes, bool write, const void* code) {
    if (emulation::in_kernel() && !emulation::on_a_stack(address))
        emulation::access(address, bytes, write, false, code);
}

struct SourceLocation {
    const char* file;
    uint32_t line, column;
};

}  // namespace

extern "C" {

#define ACCESSES(size)                                                                               \
    void __tsan_read##size(void* p) { note(p, size, false, __builtin_return_address(0)); }           \
    void __tsan_write##size(void* p) { note(p, size, true, __builtin_return_address(0)); }           \
    void __tsan_unaligned_read##size(void* p) { note(p, size, false, __builtin_return_address(0)); } \
    void __tsan_unaligned_write##size(void* p) { note(p, size, true, __builtin_return_address(0)); }
ACCESSES(1)
ACCESSES(2)
ACCESSES(4)
ACCESSES(8)
ACCESSES(16)
void __tsan_read_range(void* p, size_t bytes) { note(p, bytes, false, __builtin_return_address(0)); }
void __tsan_write_range(void* p, size_t bytes) { note(p, bytes, true, __builtin_return_address(0)); }
void __tsan_vptr_update(void**, void*) {}
void __tsan_func_entry(void*) {}
void __tsan_func_exit() {}
void __tsan_init() {}

// Atomics of the host's code, which the compiler sends here too.
#define ATOMICS(bits, type)                                                                                       \
    type __tsan_atomic##bits##_load(const volatile type* p, int) { return __atomic_load_n(p, __ATOMIC_SEQ_CST); } \
    void __tsan_atomic##bits##_store(volatile type* p, type v, int) { __atomic_store_n(p, v, __ATOMIC_SEQ_CST); } \
    type __tsan_atomic##bits##_fetch_add(volatile type* p, type v, int) {                                         \
        return __atomic_fetch_add(p, v, __ATOMIC_SEQ_CST);                                                        \
    }                                                                                                             \
    type __tsan_atomic##bits##_fetch_sub(volatile type* p, type v, int) {                                         \
        return __atomic_fetch_sub(p, v, __ATOMIC_SEQ_CST);                                                        \
    }                                                                                                             \
    int __tsan_atomic##bits##_compare_exchange_strong(volatile type* p, type* expected, type v, int, int) {       \
        return __atomic_compare_exchange_n(p, expected, v, false, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);            \
    }                                                                                                             \
    int __tsan_atomic##bits##_compare_exchange_weak(volatile type* p, type* expected, type v, int, int) {         \
        return __atomic_compare_exchange_n(p, expected, v, true, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);             \
    }
ATOMICS(8, int8_t)
ATOMICS(64, int64_t)

void __ubsan_handle_out_of_bounds(const SourceLocation* array, const void* index) {
    const std::string file = array->file;
    if (!emulation::in_kernel()) return;
    emulation::fail("index " + std::to_string(reinterpret_cast<intptr_t>(index)) + " is past the end of an array at " +
                    file.substr(file.rfind('/') + 1) + ":" + std::to_string(array->line));
}
}
