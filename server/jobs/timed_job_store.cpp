#include "server/jobs/timed_job_store.h"

#include <fmt/format.h>

#include <array>

#include "core/telemetry/metrics.h"

namespace glasswing {
namespace {

using Clock = std::chrono::steady_clock;

enum Operation {
  kCreate,
  kRecut,
  kChange,
  kRemove,
  kClaim,
  kKeep,
  kComplete,
  kFail,
  kHandBack,
  kRead,
  kCount
};
constexpr std::array<const char*, kCount> kNames = {"create", "recut",    "change", "remove",    "claim",
                                                    "keep",   "complete", "fail",   "hand_back", "read"};

const absl::Status& status_of(const absl::Status& status) {
  return status;
}
template <typename T>
const absl::Status& status_of(const absl::StatusOr<T>& result) {
  return result.status();
}

class TimedJobStore final : public JobStore {
  // Defined first, because its return type is deduced.
  template <typename Call>
  auto timed(Operation operation, const Call& call) {
    const Clock::time_point begun = Clock::now();
    auto result = call();
    seconds_[operation]->Observe(std::chrono::duration<double>(Clock::now() - begun).count());
    const absl::Status& status = status_of(result);
    if (absl::IsUnavailable(status)) {
      failures_[operation]->Increment();
      problems_.set(kJobStore,
                    fmt::format("the job store does not answer: {}; solves continue by themselves once it "
                                "does",
                                std::string(status.message())));
    } else {
      problems_.clear(kJobStore);
    }
    return result;
  }

 public:
  TimedJobStore(std::unique_ptr<JobStore> store, Problems& problems)
      : store_(std::move(store)), problems_(problems) {
    for (size_t i = 0; i < kCount; ++i) {
      const prometheus::Labels labels{{"operation", kNames[i]}};
      seconds_[i] =
          &histogram("glasswing_job_store_seconds", "Time of the job store's calls.",
                     {0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 10}, labels);
      failures_[i] =
          &counter("glasswing_job_store_failures_total", "Calls that the job store did not answer.", labels);
    }
  }

  std::string title() const override { return store_->title(); }
  absl::StatusOr<std::int64_t> create(const JobSpec& spec, std::span<const TileRange> tiles) override {
    return timed(kCreate, [&] { return store_->create(spec, tiles); });
  }
  absl::Status recut(const TileAttempt& survey, const std::string& work,
                     std::span<const TileRange> tiles) override {
    return timed(kRecut, [&] { return store_->recut(survey, work, tiles); });
  }
  absl::Status add(std::int64_t job, std::span<const TileRange> tiles) override {
    return timed(kChange, [&] { return store_->add(job, tiles); });
  }
  absl::Status set_class(std::int64_t job, JobClass priority) override {
    return timed(kChange, [&] { return store_->set_class(job, priority); });
  }
  absl::Status set_deadline(std::int64_t job, absl::Time deadline) override {
    return timed(kChange, [&] { return store_->set_deadline(job, deadline); });
  }
  absl::Status retry(std::int64_t job) override {
    return timed(kChange, [&] { return store_->retry(job); });
  }
  absl::Status suspend(std::int64_t job) override {
    return timed(kChange, [&] { return store_->suspend(job); });
  }
  absl::Status resume(std::int64_t job) override {
    return timed(kChange, [&] { return store_->resume(job); });
  }
  absl::Status requeue(std::int64_t job, int tile) override {
    return timed(kChange, [&] { return store_->requeue(job, tile); });
  }
  absl::Status remove(std::int64_t job) override {
    return timed(kRemove, [&] { return store_->remove(job); });
  }
  absl::StatusOr<std::vector<std::int64_t>> own_jobs() override {
    return timed(kRead, [&] { return store_->own_jobs(); });
  }
  absl::StatusOr<std::string> lease_key() override {
    return timed(kRead, [&] { return store_->lease_key(); });
  }
  absl::StatusOr<std::optional<Lease>> claim(const std::string& solver, std::span<const std::string> computes,
                                             bool ahead) override {
    return timed(kClaim, [&] { return store_->claim(solver, computes, ahead); });
  }
  absl::Status renew(const TileAttempt& lease) override {
    return timed(kKeep, [&] { return store_->renew(lease); });
  }
  absl::Status complete(const TileAttempt& lease, const TileResult& result) override {
    return timed(kComplete, [&] { return store_->complete(lease, result); });
  }
  absl::StatusOr<bool> fail(const TileAttempt& lease, const std::string& error, bool permanent) override {
    return timed(kFail, [&] { return store_->fail(lease, error, permanent); });
  }
  absl::Status hand_back(const TileAttempt& lease) override {
    return timed(kHandBack, [&] { return store_->hand_back(lease); });
  }
  absl::StatusOr<std::vector<TileState>> tiles(std::int64_t job) override {
    return timed(kRead, [&] { return store_->tiles(job); });
  }
  absl::StatusOr<TileState> tile(const TileAttempt& id) override {
    return timed(kRead, [&] { return store_->tile(id); });
  }
  absl::StatusOr<JobCounts> counts(std::int64_t job) override {
    return timed(kRead, [&] { return store_->counts(job); });
  }
  absl::StatusOr<std::vector<JobState>> jobs() override {
    return timed(kRead, [&] { return store_->jobs(); });
  }
  absl::StatusOr<std::vector<LeaseState>> leases() override {
    return timed(kRead, [&] { return store_->leases(); });
  }
  void wait_for_tiles(std::chrono::milliseconds timeout) override { store_->wait_for_tiles(timeout); }

 private:
  const std::unique_ptr<JobStore> store_;
  Problems& problems_;
  std::array<prometheus::Histogram*, kCount> seconds_{};
  std::array<prometheus::Counter*, kCount> failures_{};
};

}  // namespace

std::unique_ptr<JobStore> timed(std::unique_ptr<JobStore> store, Problems& problems) {
  return std::make_unique<TimedJobStore>(std::move(store), problems);
}

}  // namespace glasswing
