#include "server/rig/rig_link.h"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <mutex>

#include "tests/support/status.h"

namespace glasswing {
namespace {

class OneMonitor final : public v1::DisplayService::Service {
  grpc::Status GetDisplay(grpc::ServerContext*, const v1::GetDisplayRequest*,
                          v1::GetDisplayResponse* response) override {
    response->add_monitors()->set_name("back");
    return grpc::Status::OK;
  }
};

class DisplayLinks : public ::testing::Test {
 protected:
  void SetUp() override {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(&service_);
    server_ = builder.BuildAndStart();
    ASSERT_NE(server_, nullptr);
    absl::StatusOr<std::unique_ptr<CalibrationStore>> store =
        CalibrationStore::open(testing::TempDir() + "no-calibrations", problems_);
    ASSERT_OK(store);
    calibrations_ = *std::move(store);
    hear("display-1", "127.0.0.1:" + std::to_string(port_));
  }

  void hear(const std::string& name, const std::string& address) {
    v1::RegisterRequest request;
    request.set_kind(v1::NODE_KIND_DISPLAY);
    request.set_name(name);
    request.set_address(address);
    ASSERT_OK(rig_.add(request, std::nullopt));
  }

  OneMonitor service_;
  std::unique_ptr<grpc::Server> server_;
  int port_ = 0;
  NodeRegistry rig_;
  Problems problems_;
  std::unique_ptr<CalibrationStore> calibrations_;
};

TEST_F(DisplayLinks, ASilentDisplayIsLeftOutOnlyIfOthersHaveTheMonitors) {
  ASSERT_OK(connect_displays(rig_, *calibrations_, {}));
  hear("gone", "127.0.0.1:1");
  const absl::StatusOr<RigLinks> links = connect_displays(rig_, *calibrations_, {"back"});
  ASSERT_OK(links);
  ASSERT_EQ(links->displays.size(), 1u);
  EXPECT_NE(links->displays.front()->monitor("back"), nullptr);
  ASSERT_EQ(links->silent_displays.size(), 1u);
  EXPECT_NE(links->silent_displays.front().find("\"gone\""), std::string::npos);
  // Its monitors are not known: they may be those that are wanted.
  for (const MonitorNames& wanted : {MonitorNames{}, MonitorNames{"left"}, MonitorNames{"back", "left"}}) {
    const absl::Status refused = connect_displays(rig_, *calibrations_, wanted).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
    EXPECT_NE(refused.message().find("\"gone\""), std::string::npos) << refused;
  }
}

// A camera node whose GetCamera is answered when the test says so, and whose clock answers or not.
class SlowCamera final : public v1::CameraService::Service {
 public:
  grpc::Status GetCamera(grpc::ServerContext*, const v1::GetCameraRequest*,
                         v1::GetCameraResponse* response) override {
    ++calls;
    std::unique_lock lock(mutex);
    changed.wait(lock, [this] { return released; });
    response->set_backend("slow");
    return grpc::Status::OK;
  }
  void release() {
    const std::lock_guard lock(mutex);
    released = true;
    changed.notify_all();
  }

  std::atomic<int> calls = 0;
  std::mutex mutex;
  std::condition_variable changed;
  bool released = false;  // guarded by mutex
};

class Clock final : public v1::ClockService::Service {
  grpc::Status Exchange(grpc::ServerContext*, const v1::ExchangeRequest*,
                        v1::ExchangeResponse* response) override {
    const std::int64_t now = monotonic_now().count();
    response->set_received_ns(now);
    response->set_sent_ns(now);
    return grpc::Status::OK;
  }
};

class SlowNode : public ::testing::Test {
 protected:
  void start(std::vector<grpc::Service*> services) {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    for (grpc::Service* service : services) builder.RegisterService(service);
    server_ = builder.BuildAndStart();
    ASSERT_NE(server_, nullptr);
    v1::Node node;
    node.set_kind(v1::NODE_KIND_CAMERA);
    node.set_name("camera-1");
    node.set_address("127.0.0.1:" + std::to_string(port));
    link_ = std::make_unique<NodeLink>(node, std::chrono::milliseconds(20));
    stub_ = v1::CameraService::NewStub(link_->channel());
  }
  void TearDown() override {
    camera_.release();
    server_->Shutdown();
  }
  absl::Status ask(std::stop_token stop = {}) {
    return link_->call("describe its camera", std::move(stop), [this](grpc::ClientContext& context) {
      return stub_->GetCamera(&context, {}, &answer_);
    });
  }

  SlowCamera camera_;
  Clock clock_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<NodeLink> link_;
  std::unique_ptr<v1::CameraService::Stub> stub_;
  v1::GetCameraResponse answer_;
};

TEST_F(SlowNode, IsAskedAgainAsLongAsItsClockAnswers) {
  start({&camera_, &clock_});
  std::vector<std::string> notes;
  link_->note_slow_calls([&](const std::string& who) {
    notes.push_back(who);
    camera_.release();
  });
  const absl::Status answered = ask();
  EXPECT_OK(answered);
  EXPECT_EQ(answer_.backend(), "slow");
  EXPECT_GE(camera_.calls, 2);
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_EQ(notes[0], "the " + link_->title() + " takes long to describe its camera");
  EXPECT_EQ(notes[1], "");
}

TEST_F(SlowNode, IsNotWaitedForWhenTheCaptureIsStopped) {
  start({&camera_, &clock_});
  std::stop_source stop;
  link_->note_slow_calls([&](const std::string&) { stop.request_stop(); });
  EXPECT_TRUE(absl::IsCancelled(ask(stop.get_token())));
}

TEST_F(SlowNode, IsAwayIfItsClockDoesNotAnswerEither) {
  start({&camera_});
  const absl::Status away = ask();
  EXPECT_EQ(away.code(), absl::StatusCode::kUnimplemented) << away;  // at once, rather than after a deadline
  EXPECT_EQ(camera_.calls, 1);
}

}  // namespace
}  // namespace glasswing
