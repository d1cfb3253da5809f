#include "camera-node/services/axis_service.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <condition_variable>
#include <future>
#include <map>
#include <mutex>

#include "core/process/pause.h"
#include "core/service/service.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// What its axes were told. While `held`, a move lasts until it is stopped.
struct Motors {
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::string> told;
  bool held = false, homes = true;
  absl::Status next;

  void wait_for(size_t count) {
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return told.size() >= count; });
  }
};

class FakeDrive final : public StageDrive {
 public:
  explicit FakeDrive(Motors& motors) : motors_(motors) {}
  absl::Status move(const StageAxis& axis, double position, std::stop_token stop) override {
    return act(fmt::format("{} {}", axis.name, position), stop);
  }
  bool homes() const override { return motors_.homes; }
  absl::Status home(const StageAxis& axis, std::stop_token stop) override {
    return act("home " + axis.name, stop);
  }

 private:
  absl::Status act(const std::string& what, const std::stop_token& stop) {
    bool held = false;
    absl::Status status;
    {
      const std::lock_guard lock(motors_.mutex);
      motors_.told.push_back(what);
      motors_.changed.notify_all();
      held = motors_.held;
      status = std::exchange(motors_.next, absl::OkStatus());
    }
    if (held) pause(stop, std::chrono::minutes(5));
    return stop.stop_requested() ? absl::CancelledError("stopped") : status;
  }
  Motors& motors_;
};

class AxisServiceTest : public testing::Test {
 protected:
  void start(double takeup = 0.0) {
    StageDevice device;
    for (const bool turns : {true, false}) {
      StageAxis& axis = device.axes.emplace_back();
      axis.name = turns ? "turn" : "lift";
      axis.turns = turns;
      axis.max = turns ? 360.0 : 50.0;
    }
    device.drive = std::make_unique<FakeDrive>(motors_);
    device.takeup = takeup;
    service_ = std::make_unique<AxisServiceImpl>(std::move(device));
    host_ = ServiceHost::start({}, {service_.get()}).value();
    stub_ = v1::AxisService::NewStub(dial(host_->address()));
  }
  absl::Status move(const std::map<std::string, double>& positions, const std::vector<std::string>& home = {},
                    const std::string& id = "") {
    grpc::ClientContext context;
    v1::MoveAxesRequest request;
    for (const auto& [axis, position] : positions) (*request.mutable_positions())[axis] = position;
    for (const std::string& axis : home) request.add_home(axis);
    request.set_request_id(id);
    v1::MoveAxesResponse response;
    return from_grpc(stub_->MoveAxes(&context, request, &response));
  }
  std::optional<double> position(int axis) {
    grpc::ClientContext context;
    v1::GetAxesResponse response;
    EXPECT_OK(from_grpc(stub_->GetAxes(&context, {}, &response)));
    return response.axes(axis).has_position() ? std::optional(response.axes(axis).position()) : std::nullopt;
  }
  void stop() {
    grpc::ClientContext context;
    v1::StopAxesResponse response;
    EXPECT_OK(from_grpc(stub_->StopAxes(&context, {}, &response)));
  }

  Motors motors_;
  std::unique_ptr<AxisServiceImpl> service_;
  std::unique_ptr<ServiceHost> host_;
  std::unique_ptr<v1::AxisService::Stub> stub_;
};

TEST_F(AxisServiceTest, HomesAnAxisBeforeItsFirstMoveAndAfterAnError) {
  start();
  EXPECT_EQ(position(0), std::nullopt);
  ASSERT_OK(move({{"turn", 30.0}}));
  ASSERT_OK(move({{"turn", 40.0}}));
  ASSERT_OK(move({{"turn", 40.0}}));
  EXPECT_EQ(position(0), 40.0);
  motors_.next = absl::FailedPreconditionError("axis 1: end switch");
  EXPECT_THAT(std::string(move({{"turn", 50.0}}).message()), HasSubstr("end switch"));
  EXPECT_EQ(position(0), std::nullopt);
  ASSERT_OK(move({{"turn", 60.0}}));
  EXPECT_THAT(motors_.told,
              ElementsAre("home turn", "turn 30", "turn 40", "turn 50", "home turn", "turn 60"));
}

TEST_F(AxisServiceTest, MovesNothingThatItCannotMoveAsAsked) {
  start();
  EXPECT_THAT(std::string(move({{"turn", 361.0}, {"lift", 5.0}}).message()),
              HasSubstr("axis \"turn\" shall move to 361 deg; it takes 0 to 360"));
  EXPECT_THAT(std::string(move({{"lift", 5.0}}, {"tilt"}).message()), HasSubstr("it has: turn, lift"));
  EXPECT_TRUE(absl::IsInvalidArgument(move({{"turn", std::nan("")}})));
  motors_.homes = false;
  EXPECT_TRUE(absl::IsFailedPrecondition(move({}, {"turn"})));
  EXPECT_TRUE(motors_.told.empty());
}

TEST_F(AxisServiceTest, ComesFromBelowToTakeUpBacklash) {
  start(0.5);
  ASSERT_OK(move({{"turn", 30.0}}));
  ASSERT_OK(move({{"turn", 20.0}}));
  EXPECT_THAT(motors_.told,
              ElementsAre("home turn", "turn -0.5", "turn 0", "turn 30", "turn 19.5", "turn 20"));
}

TEST_F(AxisServiceTest, StopEndsTheMoveAndThoseThatWait) {
  start();
  ASSERT_OK(move({{"turn", 10.0}, {"lift", 1.0}}));
  motors_.held = true;
  const size_t before = motors_.told.size();
  auto running = std::async(std::launch::async, [&] { return move({{"turn", 90.0}}); });
  motors_.wait_for(before + 1);
  auto waiting = std::async(std::launch::async, [&] { return move({{"lift", 9.0}}); });
  // Whether the second call has arrived before the stop or not, it must not end as a move that was made.
  stop();
  EXPECT_THAT(std::string(running.get().message()),
              HasSubstr("axis \"turn\" was stopped on its way to 90 deg"));
  while (waiting.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready) stop();
  EXPECT_TRUE(absl::IsFailedPrecondition(waiting.get()));
  EXPECT_EQ(position(0), std::nullopt);
  motors_.held = false;
  EXPECT_OK(move({{"turn", 20.0}}));
  EXPECT_EQ(position(0), 20.0);
}

// A caller that did not hear of the stop makes its call again.
TEST_F(AxisServiceTest, AStoppedMoveIsNotTakenUpByARepetition) {
  start();
  motors_.held = true;
  auto running = std::async(std::launch::async, [&] { return move({{"turn", 90.0}}, {}, "one"); });
  motors_.wait_for(1);
  stop();
  EXPECT_TRUE(absl::IsFailedPrecondition(running.get()));
  motors_.held = false;
  const size_t told = motors_.told.size();
  EXPECT_TRUE(absl::IsFailedPrecondition(move({{"turn", 90.0}}, {}, "one")));
  EXPECT_EQ(motors_.told.size(), told);
  EXPECT_OK(move({{"turn", 90.0}}, {}, "two"));
}

TEST_F(AxisServiceTest, ARepeatedCallMovesOnce) {
  start();
  ASSERT_OK(move({{"turn", 10.0}}, {}, "one"));
  ASSERT_OK(move({{"turn", 20.0}}, {}, "two"));
  ASSERT_OK(move({{"turn", 10.0}}, {}, "one"));
  EXPECT_EQ(position(0), 20.0);
}

}  // namespace
}  // namespace glasswing
