// SPDX-License-Identifier: Apache-2.0
// The parts of the emulation: fibers, blocks of threads, watched memory, the queue of work.
#pragma once
#include <cuda_runtime.h>

#include <stdexcept>
#include <string>

namespace emulation {

// A kernel did what a GPU would get wrong.
struct Failure : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// -- fibers (fibers.cpp): a stack for each thread of a block
constexpr unsigned kMostThreads = 1024;
// Runs fiber `i` until it leaves or its body ends; true where it has ended. A fiber that has ended starts anew.
bool enter(unsigned i, const std::function<void()>& body);
void leave();                          // back to enter(), from inside the fiber
void abandon_fibers();                 // what they were doing is never resumed
bool on_a_stack(const void* address);  // of a fiber

// -- blocks (blocks.cpp)
void seed(uint64_t);
uint32_t chance(uint32_t n);  // a random number, 0 to n - 1
// Runs all blocks in a random order, one at a time, their threads in a random order between barriers.
void run_grid(const dim3& grid, const dim3& block, const std::function<void()>& kernel);
bool in_kernel();
[[noreturn]] void fail(const std::string& what);  // from inside a kernel: ends it
std::string place(const Site&);

// -- memory (memory.cpp): what threads read and write
void begin_launch();
void begin_block();
void begin_phase();  // after a barrier of all threads
void access(const void* address, size_t bytes, bool write, bool atomic, const void* code);
// Memory of the device: freed memory is never handed out again.
void* allocate(size_t bytes);
bool release(void*);
void require_allocated(const void*, size_t bytes, const char* what);  // throws Failure
void mark_written(const void*, size_t bytes);
void mark_unwritten(void*, size_t bytes);  // and fills it with NaN
bool is_written(const void*);

// -- work (runtime.cpp)
void enqueue(cudaStream_t, std::function<void()> work);
void advance();  // the device may or may not do some of its work now

}  // namespace emulation
