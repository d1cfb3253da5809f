#include "display-node/services/display_service.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <latch>
#include <limits>
#include <semaphore>
#include <thread>

#include "core/file/fault_point.h"
#include "core/image/image_file.h"
#include "core/service/joined_calls.h"
#include "core/service/service.h"
#include "display-node/backends/light_tap.h"
#include "display-node/backends/sim_display.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

// Every call of these tests is short; the deadline turns a hang into a failure.
constexpr milliseconds kPatience(20'000);

// Of which the test decides whether it works, or moves until it is stopped.
class TestRail final : public Rail {
 public:
  enum Way { kWorks, kFails, kNeverArrives };
  TestRail(const std::atomic<Way>& way, std::binary_semaphore& begun) : way_(way), begun_(begun) {}
  absl::Status move(double, std::stop_token stop) override {
    if (way_ == kWorks) return absl::OkStatus();
    if (way_ == kFails) return absl::FailedPreconditionError("the belt has slipped");
    begun_.release();
    while (!stop.stop_requested()) std::this_thread::yield();
    return absl::FailedPreconditionError("stopped");
  }

 private:
  const std::atomic<Way>& way_;
  std::binary_semaphore& begun_;  // released by a move that never arrives
};

class DisplayServiceTest : public testing::Test {
 protected:
  DisplayServiceTest() : service_("display-1", display_, 0, rails()) {
    grpc::ServerBuilder builder;
    builder.RegisterService(&service_);
    server_ = builder.BuildAndStart();
    stub_ = v1::DisplayService::NewStub(server_->InProcessChannel({}));
  }
  ~DisplayServiceTest() override {
    service_.stop();
    server_->Shutdown();
  }

  std::vector<MonitorRail> rails() {
    std::vector<MonitorRail> rails;
    rails.push_back({.monitor = "back",
                     .min_mm = 100.0,
                     .max_mm = 300.0,
                     .position_mm = 200.0,
                     .rail = std::make_unique<TestRail>(rail_, rail_begun_)});
    return rails;
  }
  absl::StatusOr<double> move(const std::string& monitor, double position_mm, const std::string& id = "") {
    grpc::ClientContext context;
    set_deadline(context, kPatience);
    v1::MoveMonitorRequest request;
    request.set_request_id(id);
    request.set_monitor(monitor);
    request.set_position_mm(position_mm);
    v1::MoveMonitorResponse response;
    const grpc::Status status = stub_->MoveMonitor(&context, request, &response);
    if (!status.ok()) return from_grpc(status);
    return response.position_mm();
  }
  absl::Status stop_move(const std::string& id) {
    grpc::ClientContext context;
    set_deadline(context, kPatience);
    v1::StopMoveRequest request;
    request.set_request_id(id);
    v1::StopMoveResponse response;
    return from_grpc(stub_->StopMove(&context, request, &response));
  }
  v1::GetDisplayResponse described() {
    grpc::ClientContext context;
    set_deadline(context, kPatience);
    v1::GetDisplayResponse response;
    EXPECT_OK(stub_->GetDisplay(&context, {}, &response));
    return response;
  }

  v1::LoadProgramRequest program(const std::string& name, int steps, int hold_refreshes) {
    v1::LoadProgramRequest request;
    request.set_program(name);
    request.set_hold_refreshes(hold_refreshes);
    for (int i = 0; i < steps; ++i) {
      v1::ProgramStep& step = *request.add_steps();
      step.set_step(i);
      v1::Stimulus& stimulus = *step.add_stimuli();
      stimulus.set_kind("solid");
      stimulus.set_panel("back");
    }
    return request;
  }

  absl::Status load(const v1::LoadProgramRequest& request) {
    grpc::ClientContext context;
    set_deadline(context, kPatience);
    v1::LoadProgramResponse response;
    return from_grpc(stub_->LoadProgram(&context, request, &response));
  }

  absl::StatusOr<std::string> put_image(const std::vector<std::string>& chunks) {
    grpc::ClientContext context;
    set_deadline(context, kPatience);
    v1::PutImageResponse response;
    const auto writer = stub_->PutImage(&context, &response);
    for (const std::string& chunk : chunks) {
      v1::PutImageRequest request;
      request.set_chunk(chunk);
      if (!writer->Write(request)) break;
    }
    writer->WritesDone();
    if (const grpc::Status status = writer->Finish(); !status.ok()) return from_grpc(status);
    return response.image();
  }

  struct Play {
    Play(v1::DisplayService::Stub& stub, const std::string& name, nanoseconds start) {
      set_deadline(context, kPatience);
      v1::PlayProgramRequest request;
      request.set_program(name);
      request.set_start_at_ns(start.count());
      reader = stub.PlayProgram(&context, request);
    }
    bool next() {
      v1::PlayProgramResponse response;
      if (!reader->Read(&response)) return false;
      reports.push_back(response.presentation());
      return true;
    }
    absl::Status finish() {
      while (next()) {
      }
      return from_grpc(reader->Finish());
    }
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::PlayProgramResponse>> reader;
    std::vector<v1::Presentation> reports;
  };
  Play start(const std::string& name) { return Play(*stub_, name, monotonic_now() + milliseconds(200)); }

  SimDisplay sim_{{{.name = "back",
                    .width_px = 8,
                    .height_px = 6,
                    .bits = 8,
                    .refresh_hz = 200.0,
                    .scanout = milliseconds(5),
                    .lag = milliseconds(3),
                    .settle = milliseconds(1)}},
                  {}};
  LightTap display_{sim_};
  std::atomic<TestRail::Way> rail_ = TestRail::kWorks;
  std::binary_semaphore rail_begun_{0};
  DisplayServiceImpl service_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<v1::DisplayService::Stub> stub_;
};

TEST_F(DisplayServiceTest, DescribesItsMonitors) {
  grpc::ClientContext context;
  v1::GetDisplayResponse response;
  ASSERT_OK(stub_->GetDisplay(&context, {}, &response));
  EXPECT_EQ(response.name(), "display-1");
  EXPECT_EQ(response.backend(), "sim");
  ASSERT_EQ(response.monitors_size(), 1);
  EXPECT_EQ(response.monitors(0).name(), "back");
  EXPECT_EQ(response.monitors(0).width_px(), 8);
  EXPECT_EQ(response.monitors(0).height_px(), 6);
  EXPECT_EQ(response.monitors(0).refresh_hz(), 200.0);
  EXPECT_EQ(response.monitors(0).optical_lag_ns(), 3'000'000);
  EXPECT_EQ(response.monitors(0).settle_ns(), 1'000'000);
  EXPECT_EQ(response.monitors(0).response(), "linear");
  EXPECT_EQ(response.monitors(0).bits(), 8);
}

TEST_F(DisplayServiceTest, PlaysAProgramAndReportsEveryStep) {
  ASSERT_OK(load(program("p", 20, 2)));
  Play play = start("p");
  ASSERT_OK(play.finish());
  ASSERT_EQ(play.reports.size(), 20u);
  for (size_t i = 0; i < play.reports.size(); ++i) {
    const v1::Presentation& report = play.reports[i];
    EXPECT_EQ(report.step(), static_cast<int>(i));
    EXPECT_GE(report.refreshes(), 2);
    if (i > 0) {
      EXPECT_EQ(report.scanout_start_ns(), play.reports[i - 1].replaced_ns());
    }
  }
  Play again = start("p");
  EXPECT_OK(again.finish()) << "a program stays loaded";
}

TEST_F(DisplayServiceTest, RefusesToPlayLateOrWhatIsNotLoaded) {
  Play nothing = start("p");
  EXPECT_TRUE(absl::IsFailedPrecondition(nothing.finish()));
  ASSERT_OK(load(program("p", 2, 2)));
  Play other = start("q");
  EXPECT_TRUE(absl::IsFailedPrecondition(other.finish()));
  Play late(*stub_, "p", monotonic_now() - milliseconds(1));
  EXPECT_TRUE(absl::IsDeadlineExceeded(late.finish()));
  EXPECT_TRUE(late.reports.empty());
}

TEST_F(DisplayServiceTest, LoadingAnotherProgramAbortsTheOneThatPlays) {
  ASSERT_OK(load(program("long", 20000, 2)));
  Play play = start("long");
  ASSERT_TRUE(play.next());
  EXPECT_TRUE(absl::IsInvalidArgument(load(program("bad", 1, 1)))) << "a bad one disturbs nothing";
  ASSERT_TRUE(play.next());
  ASSERT_OK(load(program("next", 2, 2)));
  EXPECT_TRUE(absl::IsAborted(play.finish()));
  Play next = start("next");
  EXPECT_OK(next.finish());
}

TEST_F(DisplayServiceTest, PlayingAgainAbortsTheEarlierCall) {
  ASSERT_OK(load(program("long", 20000, 600)));
  Play first(*stub_, "long", monotonic_now() + hours(1));
  // The second call ends the first one, whichever comes first, and the new program ends the second.
  Play second(*stub_, "long", monotonic_now() + hours(1));
  ASSERT_OK(load(program("next", 2, 2)));
  EXPECT_FALSE(first.finish().ok());
  EXPECT_FALSE(second.finish().ok());
  Play next = start("next");
  EXPECT_OK(next.finish());
}

TEST_F(DisplayServiceTest, CancellingFreesTheScreensWithinTheStep) {
  ASSERT_OK(load(program("slow", 2, 600)));  // 3 s a step
  Play play = start("slow");
  play.context.TryCancel();
  EXPECT_TRUE(absl::IsCancelled(play.finish()));
  Play held = start("slow");
  std::uint64_t cursor = 0;
  std::vector<Emission> emissions;
  nanoseconds horizon{};
  bool lit = false;
  while (!lit) {
    ASSERT_TRUE(display_.read(cursor, emissions, horizon, milliseconds(100)));
    for (const Emission& emission : emissions) lit = lit || emission.picture != nullptr;
  }
  held.context.TryCancel();
  EXPECT_TRUE(absl::IsCancelled(held.finish()));
  while (lit) {
    ASSERT_TRUE(display_.read(cursor, emissions, horizon, milliseconds(100)));
    for (const Emission& emission : emissions) lit = emission.picture != nullptr;
  }
}

TEST_F(DisplayServiceTest, ALineThatIsNotThereIsNotRaised) {
  EXPECT_EQ(described().line(), "");
  v1::LoadProgramRequest request = program("p", 1, 2);
  request.mutable_line()->set_after_ns(18'000'000);
  const absl::Status status = load(request);
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(std::string(status.message()).find("glasswing-display --line names one"), std::string::npos);
}

// Each program uses the calibration that came with it.
TEST_F(DisplayServiceTest, EveryProgramBringsItsCalibrations) {
  v1::LoadProgramRequest request = program("p", 1, 2);
  for (int c = 0; c < 3; ++c) request.mutable_steps(0)->mutable_stimuli(0)->add_colour(0.5);
  v1::DisplayCalibration calibration;
  calibration.set_format_version(1);
  calibration.set_monitor("back");
  calibration.set_width_px(8);
  calibration.set_height_px(6);
  calibration.set_bits(8);
  // Codes up to 99 span the first half of the light, codes from 100 on the second: only code 100 has half of
  // it.
  for (int c = 0; c < 3; ++c) {
    v1::ToneCurve& curve = *calibration.add_primaries();
    for (int code = 0; code < 256; ++code)
      curve.add_radiance(code <= 100 ? static_cast<float>(code) / 200.0f
                                     : static_cast<float>(code + 55) / 310.0f);
  }
  const auto shown = [&] {
    EXPECT_OK(load(request));
    std::uint64_t cursor = 0;
    std::vector<Emission> emissions;
    nanoseconds horizon{};
    EXPECT_TRUE(display_.read(cursor, emissions, horizon, milliseconds(0)));
    Play play = start("p");
    EXPECT_OK(play.finish());
    EXPECT_TRUE(display_.read(cursor, emissions, horizon, milliseconds(0)));
    return emissions.at(0).picture->samples;
  };
  EXPECT_EQ(shown(), std::vector<std::uint16_t>(8 * 6 * 3, 128));  // 127.5, rounded
  *request.add_calibrations() = calibration;
  EXPECT_EQ(shown(), std::vector<std::uint16_t>(8 * 6 * 3, 100));
  request.clear_calibrations();
  EXPECT_EQ(shown(), std::vector<std::uint16_t>(8 * 6 * 3, 128));
  calibration.set_bits(10);
  *request.add_calibrations() = calibration;
  const absl::Status status = load(request);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_NE(std::string(status.message()).find("10 bits; the monitor has 8 x 6 px and 8 bits"),
            std::string::npos)
      << status;
}

TEST_F(DisplayServiceTest, TakesPicturesInChunks) {
  Image16 image(8, 6);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = static_cast<std::uint16_t>(i * 400);
  const std::string png = encode_png16(image).value();
  const std::string name = put_image({png.substr(0, 10), png.substr(10)}).value();
  EXPECT_FALSE(name.empty());
  v1::LoadProgramRequest request = program("photo", 1, 2);
  request.mutable_steps(0)->mutable_stimuli(0)->set_kind("photo");
  request.mutable_steps(0)->mutable_stimuli(0)->set_image(name);
  EXPECT_OK(load(request));
  request.mutable_steps(0)->mutable_stimuli(0)->set_image("xxh30");
  EXPECT_TRUE(absl::IsFailedPrecondition(load(request)));
}

TEST_F(DisplayServiceTest, RefusesPicturesOfAnotherSizeBeforeTheyAreDecoded) {
  for (const auto& [width, height] : {std::pair(6, 8), std::pair(9, 6), std::pair(16384, 16384)}) {
    std::string png = encode_png16(Image16(8, 6)).value();
    for (size_t i = 0; i < 4; ++i) {
      png[16 + i] = static_cast<char>(width >> (24 - 8 * i));
      png[20 + i] = static_cast<char>(height >> (24 - 8 * i));
    }
    const absl::Status status = put_image({png}).status();  // decoded, it would be damaged
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_NE(status.message().find(std::to_string(width)), std::string::npos) << status;
  }
}

TEST_F(DisplayServiceTest, RefusesPicturesThatAreNone) {
  EXPECT_TRUE(absl::IsInvalidArgument(put_image({}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(put_image({"\x89PNG", "garbage"}).status()));
}

TEST_F(DisplayServiceTest, MovesAMonitorAlongItsRail) {
  EXPECT_EQ(described().monitors(0).rail().position_mm(), 200.0);
  EXPECT_EQ(described().monitors(0).rail().min_mm(), 100.0);
  EXPECT_EQ(described().monitors(0).rail().max_mm(), 300.0);
  EXPECT_EQ(move("back", 251.2).value(), 251.2);
  EXPECT_EQ(described().monitors(0).rail().position_mm(), 251.2);
}

TEST_F(DisplayServiceTest, AMonitorThatCannotBeMovedStaysWhereItIs) {
  const auto refused = [&](const std::string& monitor, double position_mm, absl::StatusCode code,
                           const std::string& words) {
    const absl::Status status = move(monitor, position_mm).status();
    EXPECT_EQ(status.code(), code) << status;
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  refused("side", 200.0, absl::StatusCode::kInvalidArgument, "there is no monitor \"side\"; there are: back");
  for (const double position_mm : {99.9, 300.1, std::numeric_limits<double>::quiet_NaN()})
    refused("back", position_mm, absl::StatusCode::kInvalidArgument,
            "the rail of monitor \"back\" goes from 100 to 300");
  ASSERT_OK(load(program("long", 20000, 2)));
  Play play = start("long");
  ASSERT_TRUE(play.next());
  refused("back", 250.0, absl::StatusCode::kFailedPrecondition, "is playing a program");
  play.context.TryCancel();
  EXPECT_TRUE(absl::IsCancelled(play.finish()));
  EXPECT_EQ(described().monitors(0).rail().position_mm(), 200.0);
}

TEST_F(DisplayServiceTest, NobodyKnowsWhereAFailedRailStands) {
  rail_ = TestRail::kFails;
  const absl::Status status = move("back", 250.0).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(std::string(status.message()).find("the belt has slipped"), std::string::npos) << status;
  EXPECT_TRUE(described().monitors(0).has_rail());
  EXPECT_FALSE(described().monitors(0).rail().has_position_mm());
  rail_ = TestRail::kWorks;
  EXPECT_EQ(move("back", 100.0).value(), 100.0);
  EXPECT_EQ(described().monitors(0).rail().position_mm(), 100.0);
}

TEST_F(DisplayServiceTest, AStoppedMoveLeavesARailThatCanBeMoved) {
  rail_ = TestRail::kNeverArrives;
  auto first = std::async(std::launch::async, [&] { return move("back", 250.0, "first").status(); });
  rail_begun_.acquire();
  EXPECT_EQ(stop_move("another"), absl::OkStatus());
  const absl::Status busy = move("back", 260.0, "second").status();
  EXPECT_NE(std::string(busy.message()).find("moving a monitor"), std::string::npos) << busy;
  EXPECT_EQ(stop_move("first"), absl::OkStatus());
  const absl::Status stopped = first.get();
  EXPECT_TRUE(absl::IsFailedPrecondition(stopped)) << stopped;
  EXPECT_FALSE(described().monitors(0).rail().has_position_mm());
  EXPECT_EQ(stop_move("second"), absl::OkStatus());
  const absl::Status late = move("back", 260.0, "second").status();
  EXPECT_NE(std::string(late.message()).find("before it began"), std::string::npos) << late;
  rail_ = TestRail::kWorks;
  EXPECT_EQ(move("back", 260.0, "third").value(), 260.0);
  EXPECT_EQ(described().monitors(0).rail().position_mm(), 260.0);
}

TEST_F(DisplayServiceTest, AMonitorWithoutARailIsNotMoved) {
  DisplayServiceImpl fixed("display-2", display_);
  v1::GetDisplayResponse description;
  ASSERT_OK(fixed.GetDisplay(nullptr, nullptr, &description));
  EXPECT_FALSE(description.monitors(0).has_rail());
  v1::MoveMonitorRequest request;
  request.set_monitor("back");
  v1::MoveMonitorResponse response;
  const absl::Status status = from_grpc(fixed.MoveMonitor(nullptr, &request, &response));
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_NE(std::string(status.message()).find("monitor \"back\" has no rail"), std::string::npos) << status;
}

TEST_F(DisplayServiceTest, ARepeatedLoadIsJoinedToTheFirst) {
  std::latch begun(1), released(1);
  std::atomic<int> drawn = 0;
  at_fault_points([&](std::string_view point) {
    if (point != "program drawn" || ++drawn > 1) return;
    begun.count_down();
    released.wait();
  });
  v1::LoadProgramRequest request = program("p", 3, 2);
  request.set_request_id("one");
  const auto ask = [&] {
    v1::LoadProgramResponse response;
    grpc::ClientContext context;
    set_deadline(context, kPatience);
    return stub_->LoadProgram(&context, request, &response).error_code();
  };
  const double joined = joined_calls().Value();
  auto first = std::async(std::launch::async, ask);
  begun.wait();
  auto second = std::async(std::launch::async, ask);
  while (joined_calls().Value() == joined) std::this_thread::yield();
  released.count_down();
  EXPECT_EQ(first.get(), grpc::StatusCode::OK);
  EXPECT_EQ(second.get(), grpc::StatusCode::OK);
  // One that comes while the program plays does not stop it.
  v1::PlayProgramRequest play;
  play.set_program("p");
  play.set_start_at_ns((monotonic_now() + milliseconds(100)).count());
  grpc::ClientContext context;
  set_deadline(context, kPatience);
  const auto reader = stub_->PlayProgram(&context, play);
  v1::PlayProgramResponse response;
  ASSERT_TRUE(reader->Read(&response));
  EXPECT_EQ(ask(), grpc::StatusCode::OK);
  while (reader->Read(&response)) {
  }
  const grpc::Status end = reader->Finish();
  EXPECT_OK(end);
  EXPECT_EQ(drawn, 1);
  at_fault_points(nullptr);
}

}  // namespace
}  // namespace glasswing
