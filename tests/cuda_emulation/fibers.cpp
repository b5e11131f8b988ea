// SPDX-License-Identifier: Apache-2.0
// Fibers of plain C: ucontext gives each a stack, setjmp and longjmp switch between them, without a system call.
#include <setjmp.h>
#include <sys/mman.h>
#include <ucontext.h>
#include <unistd.h>

#include <cstdint>
#include <new>

#include "emulation.h"

namespace emulation {
namespace {

constexpr size_t kStack = size_t(256) << 10;

struct Fiber {
    jmp_buf inside;
    bool started = false, ended = false;
};

Fiber fibers[kMostThreads];
jmp_buf outside;
unsigned current = 0;
const std::function<void()>* body = nullptr;

// One stack after another, below each a page that may not be touched.
char* const stacks = [] {
    void* all = mmap(nullptr, kStack * kMostThreads, PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (all == MAP_FAILED) throw std::bad_alloc();
    const auto page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
    for (unsigned i = 0; i < kMostThreads; ++i) mprotect(static_cast<char*>(all) + i * kStack, page, PROT_NONE);
    return static_cast<char*>(all);
}();

void run() {
    for (;;) {
        (*body)();
        fibers[current].ended = true;
        leave();
    }
}

}  // namespace

bool enter(unsigned i, const std::function<void()>& what) {
    Fiber& fiber = fibers[i];
    current = i, body = &what;
    fiber.ended = false;
    if (_setjmp(outside)) return fibers[current].ended;
    if (fiber.started) _longjmp(fiber.inside, 1);
    fiber.started = true;
    static ucontext_t start;
    getcontext(&start);
    start.uc_stack.ss_sp = stacks + i * kStack;
    start.uc_stack.ss_size = kStack;
    start.uc_link = nullptr;
    makecontext(&start, run, 0);
    setcontext(&start);
    __builtin_unreachable();
}

void leave() {
    if (!_setjmp(fibers[current].inside)) _longjmp(outside, 1);
}

void abandon_fibers() {
    for (Fiber& fiber : fibers) fiber.started = false;
}

bool on_a_stack(const void* address) {
    return static_cast<size_t>(static_cast<const char*>(address) - stacks) < kStack * kMostThreads;
}

}  // namespace emulation
