// SPDX-License-Identifier: Apache-2.0
// What the threads of a kernel read and write, word by word: races, numbers that nothing wrote, places that are not
// there.
//
// Time in a kernel is counted in phases: each begins with a block, or with a barrier in it. Two accesses to a word, one
// of them a write and not both atomic, are a race if they are in the same phase by different threads, or in the same
// kernel by different blocks: what a GPU makes of them is up to chance, whatever came out here.
#include <dlfcn.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <unordered_map>

#include "emulation.h"

// Shared memory is static and starts as nothing: what kernels use of the library's zero-initialised data. The names are
// the linker's.
extern "C" __attribute__((visibility("hidden"))) char __bss_start[], _end[];

namespace emulation {
namespace {

constexpr uintptr_t kWord = 4;
constexpr size_t kPageWords = 1024, kCached = 4096, kMostPages = 1 << 12;
constexpr size_t kArena = size_t(1) << 37;  // addresses, not memory

struct Access {
    uint32_t phase = 0;
    uint16_t thread = 0;
    bool atomic = false, by_many = false;  // by_many: other threads did the same in that phase
    const void* code = nullptr;
};
struct Word {
    Access write, read;
    uint32_t earlier_read = 0;  // the phase of a read by a block before that of `read`
};
struct Page {
    uintptr_t number = 0;
    Word words[kPageWords];
};
enum State : uint8_t { outside, unwritten, written };

std::unordered_map<uintptr_t, std::unique_ptr<Page>> pages;
Page* cache[kCached];
uint32_t phase = 1, block_begin = 1, launch_begin = 1;

// -- device memory
void* reserve(size_t bytes) {
    void* found = mmap(nullptr, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    return found == MAP_FAILED ? nullptr : found;
}
char* const arena = static_cast<char*>(reserve(kArena));
State* const states = [] {  // of the arena's words
    void* found = reserve(kArena / kWord);
    if (found) mprotect(found, kArena / kWord, PROT_READ | PROT_WRITE);
    return static_cast<State*>(found);
}();
size_t arena_used = 0;
std::map<const char*, size_t> allocations;

bool in_arena(const void* p) { return static_cast<size_t>(static_cast<const char*>(p) - arena) < kArena; }
State* state_of(const void* p) { return states + (static_cast<const char*>(p) - arena) / kWord; }
bool in_shared(const void* p) { return p >= __bss_start && p < _end; }

// -- reports
// File and line of an instruction, as far as addr2line knows.
std::string source(const void* code) {
    Dl_info info;
    if (!code || !dladdr(code, &info)) return "?";
    char command[4200];
    const auto offset = static_cast<const char*>(code) - static_cast<const char*>(info.dli_fbase) - 1;
    std::snprintf(command, sizeof command, "addr2line -e '%s' 0x%zx", info.dli_fname, static_cast<size_t>(offset));
    std::string line;
    if (FILE* out = popen(command, "r")) {
        char buffer[4200];
        if (std::fgets(buffer, sizeof buffer, out)) line = buffer;
        pclose(out);
    }
    line = line.substr(0, line.find_first_of(" \n"));
    return line.substr(line.rfind('/') + 1);
}

std::string kind_of(const void* address) { return in_shared(address) ? "shared memory" : "global memory"; }

[[noreturn]] void race(const void* address, const Access& before, const char* did, const Access& now,
                       const char* does) {
    const bool same_block = before.phase >= block_begin;
    fail("race in " + kind_of(address) + ": it " + does + " at " + source(now.code) + " what thread " +
         std::to_string(before.thread) + " of " + (same_block ? "the same block " : "another block ") + did + " at " +
         source(before.code) + (same_block ? ", without a barrier between" : ""));
}

void require_readable(const void* address, const Word& word, const void* code) {
    if (in_shared(address)) {
        if (word.write.phase < block_begin) fail("shared memory that nothing wrote is read at " + source(code));
    } else if (in_arena(address) && *state_of(address) == unwritten) {
        fail("device memory that nothing wrote is read at " + source(code));
    }
}

// -- races
inline Word& word_at(uintptr_t index) {
    const uintptr_t number = index / kPageWords;
    Page*& cached = cache[number % kCached];
    if (!cached || cached->number != number) {
        auto& page = pages[number];
        if (!page) page = std::make_unique<Page>(), page->number = number;
        cached = page.get();
    }
    return cached->words[index % kPageWords];
}

bool by_other_block(uint32_t when) { return when >= launch_begin && when < block_begin; }
inline bool conflicts(const void* address, const Access& before, const Access& now) {
    if (before.atomic && now.atomic) return false;
    if (before.phase == phase) return before.thread != now.thread || before.by_many;
    return !in_shared(address) && by_other_block(before.phase);  // each block has shared memory of its own
}

void note_read(Word& word, const Access& now) {
    if (by_other_block(word.read.phase)) word.earlier_read = word.read.phase;
    const bool by_many = word.read.phase == phase && (word.read.by_many || word.read.thread != now.thread);
    word.read = now;
    word.read.by_many = by_many;
}

}  // namespace

void begin_launch() {
    if (pages.size() > kMostPages) {
        pages.clear();
        std::fill(std::begin(cache), std::end(cache), nullptr);
    }
    launch_begin = block_begin = ++phase;
}
void begin_block() { block_begin = ++phase; }
void begin_phase() { ++phase; }

void access(const void* address, size_t bytes, bool write, bool atomic, const void* code) {
    const auto begin = reinterpret_cast<uintptr_t>(address) / kWord;
    const auto end = (reinterpret_cast<uintptr_t>(address) + bytes + kWord - 1) / kWord;
    const Access now{phase, static_cast<uint16_t>(threadIdx.x), atomic, false, code};
    for (uintptr_t index = begin; index < end; ++index) {
        const auto* at = reinterpret_cast<const void*>(index * kWord);
        Word& word = word_at(index);
        if (in_arena(at) && *state_of(at) == outside) fail("memory of no allocation is used at " + source(code));
        if (!write || atomic) require_readable(at, word, code);
        if (conflicts(at, word.write, now)) race(at, word.write, "wrote", now, write ? "writes" : "reads");
        if (!write) {
            note_read(word, now);
            continue;
        }
        if (conflicts(at, word.read, now) || (!in_shared(at) && by_other_block(word.earlier_read)))
            race(at, word.read, "read", now, "writes");
        word.write = now;
        if (in_arena(at)) *state_of(at) = written;
    }
}

void note_atomic(const void* address, size_t bytes) { access(address, bytes, true, true, __builtin_return_address(0)); }

// -- device memory
void* allocate(size_t bytes) {
    const auto page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
    const size_t whole = (bytes + page - 1) / page * page;
    if (!arena || !states || arena_used + whole + page > kArena) return nullptr;
    char* found = arena + arena_used;
    if (mprotect(found, whole, PROT_READ | PROT_WRITE)) return nullptr;
    arena_used += whole + page;
    allocations[found] = bytes;
    mark_unwritten(found, bytes);
    return found;
}

bool release(void* p) {
    const auto found = allocations.find(static_cast<const char*>(p));
    if (found == allocations.end()) return false;
    std::fill(state_of(p), state_of(p) + (found->second + kWord - 1) / kWord, outside);
    madvise(p, found->second, MADV_DONTNEED);
    mprotect(p, found->second, PROT_NONE);
    allocations.erase(found);
    return true;
}

void require_allocated(const void* p, size_t bytes, const char* what) {
    if (!in_arena(p)) return;
    auto after = allocations.upper_bound(static_cast<const char*>(p));
    const bool inside =
        after != allocations.begin() && (--after, static_cast<const char*>(p) + bytes <= after->first + after->second);
    if (!inside) throw Failure(std::string(what) + " memory of no allocation");
}

void mark_written(const void* p, size_t bytes) {
    if (in_arena(p)) std::fill(state_of(p), state_of(static_cast<const char*>(p) + bytes + kWord - 1), written);
}
void mark_unwritten(void* p, size_t bytes) {
    std::fill_n(static_cast<unsigned char*>(p), bytes, 0xff);
    if (in_arena(p)) std::fill(state_of(p), state_of(static_cast<char*>(p) + bytes + kWord - 1), unwritten);
}
bool is_written(const void* p) { return !in_arena(p) || *state_of(p) == written; }

}  // namespace emulation
