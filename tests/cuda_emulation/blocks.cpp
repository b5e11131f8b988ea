// SPDX-License-Identifier: Apache-2.0
// The threads of a block: run in a random order until each waits for others, barriers and exchanges between them.
//
// Rules are those of the CUDA programming guide, not what a GPU lets pass: a barrier is for all threads of a block, at
// one place in the code; an exchange is for exactly the lanes of its mask, at one place in the code.
#include <algorithm>
#include <cstring>
#include <map>
#include <numeric>
#include <vector>

#include "emulation.h"

// Not where shared memory is (memory.cpp).
#define INITIALISED __attribute__((section(".data")))
INITIALISED uint3 threadIdx, blockIdx, blockDim, gridDim;
#undef INITIALISED

namespace emulation {
namespace {

constexpr unsigned kLanes = 32;

struct Warp {
    uint32_t arrived = 0, mask = 0;
    Exchange kind{};
    Site site;
    uint64_t brought[kLanes], exchanged[kLanes];
};

uint64_t state = 0;           // of the random numbers
std::vector<unsigned> ready;  // threads that can go on
std::vector<Warp> warps;
std::vector<const Site*> waiting;  // where each thread waits, or null
unsigned ended = 0;
struct {
    unsigned arrived = 0;
    Barrier kind{};
    Site site;
    bool any = false, result = false;
} barrier;
bool running = false;
std::string failure;

bool same(const Site& a, const Site& b) {
    return a.line() == b.line() && a.column() == b.column() &&
           (a.file_name() == b.file_name() || !std::strcmp(a.file_name(), b.file_name()));
}

// Until another thread calls resume(). The site is on the fiber's stack, and stays there as long.
void wait(const Site& site) {
    waiting[threadIdx.x] = &site;
    leave();
}

void resume(unsigned thread) {
    waiting[thread] = nullptr;
    ready.push_back(thread);
}

// Nobody can go on, but not all have ended.
std::string stuck() {
    std::map<std::string, unsigned> sites;
    for (const Site* site : waiting)
        if (site) ++sites[place(*site)];
    std::string what = "not all threads reach a barrier or an exchange:";
    for (const auto& [where, n] : sites) what += " " + std::to_string(n) + " wait at " + where + ",";
    return what + " " + std::to_string(ended) + " have ended";
}

void run_block(const std::function<void()>& kernel) {
    const unsigned n = blockDim.x;
    begin_block();
    ready.resize(n), std::iota(ready.begin(), ready.end(), 0u);
    waiting.assign(n, nullptr), warps.assign((n + kLanes - 1) / kLanes, {});
    ended = 0, barrier = {};
    while (!ready.empty()) {
        std::swap(ready[chance(static_cast<uint32_t>(ready.size()))], ready.back());
        threadIdx.x = ready.back();
        ready.pop_back();
        running = true;
        ended += enter(threadIdx.x, kernel);
        running = false;
        if (!failure.empty()) break;
    }
    if (failure.empty() && ended == n) return;
    abandon_fibers();
    const std::string what = failure.empty() ? stuck() : failure;
    failure.clear();
    throw Failure("block " + std::to_string(blockIdx.x) + ": " + what);
}

}  // namespace

void seed(uint64_t value) { state = value; }
// SplitMix64 (Steele et al. 2014).
uint32_t chance(uint32_t n) {
    uint64_t z = state += 0x9e3779b97f4a7c15;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
    z = (z ^ z >> 27) * 0x94d049bb133111eb;
    return static_cast<uint32_t>((z >> 32) * n >> 32);
}
bool in_kernel() { return running; }

std::string place(const Site& site) {
    const std::string file = site.file_name();
    return file.substr(file.rfind('/') + 1) + ":" + std::to_string(site.line());
}

void run_grid(const dim3& grid, const dim3& block, const std::function<void()>& kernel) {
    if (grid.y != 1 || grid.z != 1 || block.y != 1 || block.z != 1) throw Failure("grids of one dimension only");
    if (grid.x < 1 || block.x < 1 || block.x > kMostThreads) throw Failure("a launch of no size that a GPU takes");
    gridDim = {grid.x, 1, 1}, blockDim = {block.x, 1, 1}, threadIdx = {0, 0, 0};
    std::vector<unsigned> order(grid.x);
    std::iota(order.begin(), order.end(), 0u);
    for (unsigned left = grid.x; left > 1; --left) std::swap(order[chance(left)], order[left - 1]);
    begin_launch();
    for (const unsigned i : order) {
        blockIdx = {i, 0, 0};
        run_block(kernel);
    }
}

void fail(const std::string& what) {
    failure = "thread " + std::to_string(threadIdx.x) + ": " + what;
    leave();
    __builtin_unreachable();
}
void fail(const char* what, const Site& site) { fail(std::string(what) + " at " + place(site)); }

bool synchronize(Barrier kind, bool predicate, const Site& site) {
    if (!barrier.arrived)
        barrier.kind = kind, barrier.site = site, barrier.any = false;
    else if (barrier.kind != kind || !same(barrier.site, site))
        fail("threads meet at different barriers: at " + place(barrier.site) + " and at " + place(site));
    barrier.any |= predicate;
    if (++barrier.arrived < blockDim.x) {
        wait(site);
    } else {
        barrier.arrived = 0, barrier.result = barrier.any;
        begin_phase();
        for (unsigned i = 0; i < blockDim.x; ++i) resume(i);
        leave();
    }
    return barrier.result;
}

void exchange(Exchange kind, uint32_t mask, uint64_t value, const Site& site) {
    const unsigned first = threadIdx.x / kLanes * kLanes;
    Warp& warp = warps[threadIdx.x / kLanes];
    const uint32_t bit = 1u << lane();
    if (!(mask & bit)) fail("an exchange whose mask leaves out the lane that calls it", site);
    if (!warp.arrived)
        warp.kind = kind, warp.mask = mask, warp.site = site;
    else if (warp.mask != mask || warp.kind != kind || !same(warp.site, site))
        fail("lanes meet in different exchanges: at " + place(warp.site) + " and at " + place(site));
    warp.arrived |= bit, warp.brought[lane()] = value;
    if (warp.arrived != mask) return wait(site);
    std::copy(std::begin(warp.brought), std::end(warp.brought), warp.exchanged);
    warp.arrived = 0;
    for (unsigned k = 0; k < kLanes; ++k)
        if (mask >> k & 1) resume(first + k);
    leave();
}

uint64_t exchanged(int lane) { return warps[threadIdx.x / kLanes].exchanged[lane]; }

}  // namespace emulation
