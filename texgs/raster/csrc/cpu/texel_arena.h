// SPDX-License-Identifier: Apache-2.0
// Memory for the texel gradients of one worker's pairs, in blocks that are kept for the next pass.
#pragma once
#include <deque>

#include "../status.h"
#include "kernels.h"
#include "memory.h"

namespace texgs {

class BlockArena : public TexelArena {
public:
    BlockArena() : TexelArena{nullptr, nullptr, &BlockArena::next_block} {}

    void restart() {
        next = end = nullptr;
        used_ = 0;
        missing = 0;
    }
    int64_t missing = 0;  // bytes that could not be had

private:
    static constexpr int64_t kBlockFloats = int64_t(1) << 18;

    static void next_block(TexelArena* self, int64_t floats) {
        auto& arena = static_cast<BlockArena&>(*self);
        if (arena.missing) return;
        const int64_t size = floats > kBlockFloats ? floats : kBlockFloats;
        try {
            if (arena.used_ == arena.blocks_.size()) arena.blocks_.emplace_back();
            arena.next = arena.blocks_[arena.used_++].ensure<float>(size);
            arena.end = arena.next + size;
        } catch (const OutOfMemory& e) {
            arena.missing = e.bytes;
        } catch (const std::bad_alloc&) {
            arena.missing = 4 * size;
        }
    }

    std::deque<Buffer> blocks_;
    size_t used_ = 0;
};

}  // namespace texgs
