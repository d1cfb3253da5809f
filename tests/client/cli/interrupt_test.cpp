// Ctrl-C, sent to the program as by a terminal.
#include "core/cli/interrupt.h"

#include <condition_variable>
#include <future>
#include <mutex>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/rig_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "tests/client/process.h"
#include "tests/client/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

// Reports that it was called, and blocks until the caller cancels.
class Call {
 public:
  grpc::Status stay(grpc::ServerContext* context) {
    {
      const std::lock_guard lock(mutex_);
      ++count_;
    }
    called_.notify_all();
    std::unique_lock lock(mutex_);
    while (!context->IsCancelled() && !over_) called_.wait_for(lock, std::chrono::milliseconds(20));
    return grpc::Status::CANCELLED;
  }
  void wait() {
    std::unique_lock lock(mutex_);
    called_.wait(lock, [&] { return count_ > 0; });
  }
  void end() {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }

 private:
  std::mutex mutex_;
  std::condition_variable called_;
  int count_ = 0;
  bool over_ = false;
};

// A rig on which every call blocks.
class SlowRig : public ScratchTest {
 protected:
  struct Sessions : v1::SessionService::Service {
    Call watch;
    std::string archive_address;
    grpc::Status WatchSession(grpc::ServerContext* context, const v1::WatchSessionRequest* request,
                              grpc::ServerWriter<v1::WatchSessionResponse>* writer) override {
      v1::WatchSessionResponse response;
      response.mutable_session()->set_name(request->name());
      response.mutable_session()->set_state(v1::SESSION_STATE_CAPTURING);
      writer->Write(response);
      return watch.stay(context);
    }
    grpc::Status BeginImport(grpc::ServerContext*, const v1::BeginImportRequest* request,
                             v1::BeginImportResponse* response) override {
      response->mutable_session()->set_name(request->name());
      response->mutable_session()->set_archive_address(archive_address);
      return grpc::Status::OK;
    }
  } sessions_;
  struct Rig : v1::RigService::Service {
    Call check, sync;
    grpc::Status CheckRig(grpc::ServerContext* context, const v1::CheckRigRequest*,
                          grpc::ServerWriter<v1::CheckRigResponse>*) override {
      return check.stay(context);
    }
    grpc::Status CalibrateSync(grpc::ServerContext* context, const v1::CalibrateSyncRequest*,
                               grpc::ServerWriter<v1::CalibrateSyncResponse>*) override {
      return sync.stay(context);
    }
  } rig_;
  struct Archive : v1::ArchiveService::Service {
    Call put;
    grpc::Status PutFrame(grpc::ServerContext* context, grpc::ServerReader<v1::PutFrameRequest>*,
                          v1::PutFrameResponse*) override {
      return put.stay(context);
    }
  } archive_;

  SlowRig() : host_(ServiceHost::start({}, {&sessions_, &rig_, &archive_}).value()) {
    sessions_.archive_address = host_->address();
  }
  ~SlowRig() override { archive_.put.end(); }

  std::vector<std::string> with_server(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--server", host_->address(), "--color", "never"});
    return arguments;
  }
  // Interrupts the program during the call; it must exit by itself with `words`.
  void expect_broken_off(const std::vector<std::string>& arguments, Call& call, const std::string& words) {
    Process process(with_server(arguments));
    call.wait();
    process.wait_until_handled();
    process.interrupt();
    const int status = process.wait();
    ASSERT_TRUE(WIFEXITED(status)) << process.errors;
    EXPECT_EQ(WEXITSTATUS(status), kInterrupted);
    EXPECT_EQ(process.errors, "glasswing: " + words + "\n");
  }

  std::unique_ptr<ServiceHost> host_;
};

TEST_F(SlowRig, TheSessionGoesOnAndTheClientSaysHowToWatchIt) {
  expect_broken_off({"watch", "vase"}, sessions_.watch,
                    "session vase continues; glasswing watch vase shows it, glasswing cancel vase ends it");
}

TEST_F(SlowRig, MeasurementsAreBrokenOff) {
  expect_broken_off({"doctor"}, rig_.check, "the check was interrupted; the rig is free again and unchanged");
  expect_broken_off(
      {"calibrate", "sync"}, rig_.sync,
      "the measurement was interrupted; the rig is free again, and 0 of its monitors were measured");
}

TEST_F(SlowRig, TheSecondCtrlCEndsAtOnce) {
  const std::string archive = (scratch_ / "vase").string();
  const nlohmann::json manifest = {
      {"monitor", {{"back", {{"width", 16}, {"height", 8}}}}},
      {"image", {{"width", 4}, {"height", 4}}},
      {"frames",
       {{{"file", "0.png"}, {"object", true}, {"stimulus", {{"kind", "solid"}, {"panel", "back"}}}}}}};
  std::filesystem::create_directories(archive);
  ASSERT_OK(write_file_durably(archive + "/0.png", encode_png16(Image16(4, 4)).value()));
  ASSERT_OK(write_file_durably(archive + "/manifest.json", manifest.dump()));
  Process process(with_server({"import", archive}));
  archive_.put.wait();
  process.wait_until_handled();
  process.interrupt();
  process.wait_until_asked();
  process.interrupt();
  const int status = process.wait();
  ASSERT_TRUE(WIFSIGNALED(status)) << process.errors;
  EXPECT_EQ(WTERMSIG(status), SIGINT);
}

TEST(Interruptible, AsksOnceAndLeavesTheRestAsItWas) {
  struct sigaction before {
  }, after{};
  ::sigaction(SIGINT, nullptr, &before);
  {
    const Interruptible outer;
    EXPECT_FALSE(interrupted());
    std::promise<void> cancelled;
    const Interruptible inner([&] { cancelled.set_value(); });
    ::raise(SIGINT);
    EXPECT_TRUE(interrupted());
    cancelled.get_future().wait();
  }
  ::sigaction(SIGINT, nullptr, &after);
  EXPECT_EQ(after.sa_handler, before.sa_handler);
  const Interruptible next;
  EXPECT_FALSE(interrupted());
}

}  // namespace
}  // namespace glasswing
