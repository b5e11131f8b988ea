// SPDX-License-Identifier: Apache-2.0
#include "parallel.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

#include "../status.h"

namespace texgs {
namespace {

// One loop, shared by the threads that work on it: each takes the next range until none is left.
struct Loop {
    int64_t n, grain;
    Job job;
    void* context;
    const int32_t* stop;  // of the caller, which another of its threads may set; or null
    std::atomic<int64_t> next{0};
    std::atomic<int> workers{0};

    void work() {
        const int worker = workers.fetch_add(1, std::memory_order_relaxed);
        for (;;) {
            const int64_t begin = next.fetch_add(grain, std::memory_order_relaxed);
            if (begin >= n || is_stopped()) return;
            job(context, begin, std::min(begin + grain, n), worker);
        }
    }
    bool is_stopped() const { return stop && *static_cast<const volatile int32_t*>(stop) != 0; }
};

void work_on(void* loop) { static_cast<Loop*>(loop)->work(); }

// Threads for callers without OpenMP. They sleep between loops.
class Pool {
public:
    ~Pool() { resize(0); }

    void run(Loop& loop, int threads) {
        resize(threads - 1);
        {
            std::lock_guard lock(mutex_);
            loop_ = &loop;
            running_ = static_cast<int>(workers_.size());
            ++generation_;
        }
        wake_.notify_all();
        loop.work();
        std::unique_lock lock(mutex_);
        done_.wait(lock, [&] { return running_ == 0; });
    }

private:
    void resize(int n) {
        if (n == static_cast<int>(workers_.size())) return;
        {
            std::lock_guard lock(mutex_);
            stop_ = true;
        }
        wake_.notify_all();
        for (auto& worker : workers_) worker.join();
        workers_.clear();
        stop_ = false;
        for (int i = 0; i < n; ++i) workers_.emplace_back([this, seen = generation_] { serve(seen); });
    }

    void serve(int64_t seen) {
        for (;;) {
            Loop* loop;
            {
                std::unique_lock lock(mutex_);
                wake_.wait(lock, [&] { return stop_ || generation_ != seen; });
                if (stop_) return;
                seen = generation_;
                loop = loop_;
            }
            loop->work();
            std::lock_guard lock(mutex_);
            if (--running_ == 0) done_.notify_one();
        }
    }

    std::mutex mutex_;
    std::condition_variable wake_, done_;
    std::vector<std::thread> workers_;
    Loop* loop_ = nullptr;
    int running_ = 0;
    int64_t generation_ = 0;
    bool stop_ = false;
};

using GompParallel = void (*)(void (*)(void*), void*, unsigned threads, unsigned flags);
std::atomic<GompParallel> gomp_parallel{nullptr};
thread_local int thread_count = 0;  // of the caller: two callers may want different numbers
thread_local const int32_t* stop_flag = nullptr;
thread_local bool inside_loop = false;

void run(Loop& loop) {
    const int wanted = threads();
    if (wanted <= 1 || loop.n <= loop.grain || inside_loop) return loop.work();
    // Always the whole team, even for fewer ranges: OpenMP ends the threads that a smaller team leaves over.
    struct Inside {
        Inside() { inside_loop = true; }
        ~Inside() { inside_loop = false; }
    } inside;
    if (const auto parallel = gomp_parallel.load()) {
        parallel(work_on, &loop, static_cast<unsigned>(wanted), 0);
    } else {
        static std::mutex one_loop;  // callers from several threads take turns
        static Pool pool;
        std::lock_guard lock(one_loop);
        pool.run(loop, wanted);
    }
}

}  // namespace

int threads() {
    return thread_count > 0 ? thread_count : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void run_parallel(int64_t n, int64_t grain, Job job, void* context) {
    if (n <= 0) return;
    // Nothing may be thrown through OpenMP: a loop inside of another one goes on, and the outer one stops.
    Loop loop{n, grain, job, context, inside_loop ? nullptr : stop_flag};
    run(loop);
    if (loop.is_stopped()) throw Stopped{};
}

}  // namespace texgs

void texgs_use_openmp(void* parallel) { texgs::gomp_parallel = reinterpret_cast<texgs::GompParallel>(parallel); }
void texgs_set_loops(int32_t n, const int32_t* stop) { texgs::thread_count = n, texgs::stop_flag = stop; }
