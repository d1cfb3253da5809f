// Repetitions of a call. A caller whose call is not answered in time makes it again with the same request id;
// it then gets the answer of the first, and nothing is done twice.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/server_context.h>
#include <prometheus/counter.h>

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

namespace glasswing {

// glasswing_calls_joined_total
prometheus::Counter& joined_calls();

// The calls of one method. Thread-safe.
template <typename Response>
class JoinedCalls {
 public:
  using Answer = absl::StatusOr<Response>;

  // `kept`: how many answers are kept for repetitions that come after the end; the oldest is dropped. Errors
  // are not kept: a caller that repeats a failed call wants it tried again.
  explicit JoinedCalls(size_t kept = 8) : kept_(kept) {}

  // Calls `work` for the first call with this id, and returns its answer to that call and to all others.
  // Without an id, or with one that is too long to be kept: calls `work`. CANCELLED: the caller of a
  // repetition has gone.
  Answer run(const grpc::ServerContextBase& context, const std::string& id,
             const std::function<Answer()>& work) {
    if (id.empty() || id.size() > kMaxId_bytes) return work();
    std::unique_lock lock(mutex_);
    if (const auto known = calls_.find(id); known != calls_.end()) {
      const std::shared_ptr<const Call> first = known->second;
      joined_calls().Increment();
      while (!first->answer) {
        answered_.wait_for(lock, kPoll);
        if (context.IsCancelled()) return absl::CancelledError("the caller no longer waits");
      }
      return *first->answer;
    }
    const auto call = std::make_shared<Call>();
    calls_.emplace(id, call);
    lock.unlock();
    Answer answer = work();
    lock.lock();
    call->answer = answer;
    if (answer.ok()) {
      ended_.push_back(id);
      drop_oldest();
    } else {
      calls_.erase(id);
    }
    answered_.notify_all();
    return answer;
  }

  // Drops the answer: the next call with this id is a first one.
  void forget(const std::string& id) {
    const std::lock_guard lock(mutex_);
    if (std::erase(ended_, id) > 0) calls_.erase(id);
  }

 private:
  static constexpr std::chrono::milliseconds kPoll{100};  // for a caller who has gone
  static constexpr size_t kMaxId_bytes = 128;
  struct Call {
    std::optional<Answer> answer;  // none while it is at work
  };

  void drop_oldest() {
    while (ended_.size() > kept_) {
      calls_.erase(ended_.front());
      ended_.pop_front();
    }
  }

  const size_t kept_;
  std::mutex mutex_;
  std::condition_variable answered_;
  std::map<std::string, std::shared_ptr<Call>> calls_;  // at work or kept, by id; guarded by mutex_
  std::deque<std::string> ended_;                       // ids of those kept, latest last; guarded by mutex_
};

}  // namespace glasswing
