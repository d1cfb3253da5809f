#include "server/rig/rig_link.h"

#include <gtest/gtest.h>

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
    ASSERT_TRUE(store.ok()) << store.status();
    calibrations_ = *std::move(store);
    hear("display-1", "127.0.0.1:" + std::to_string(port_));
  }

  void hear(const std::string& name, const std::string& address) {
    v1::RegisterRequest request;
    request.set_kind(v1::NODE_KIND_DISPLAY);
    request.set_name(name);
    request.set_address(address);
    ASSERT_TRUE(rig_.add(request, std::nullopt).ok());
  }

  OneMonitor service_;
  std::unique_ptr<grpc::Server> server_;
  int port_ = 0;
  NodeRegistry rig_;
  Problems problems_;
  std::unique_ptr<CalibrationStore> calibrations_;
};

TEST_F(DisplayLinks, ASilentDisplayIsLeftOutOnlyIfOthersHaveTheMonitors) {
  ASSERT_TRUE(connect_displays(rig_, *calibrations_, {}).ok());
  hear("gone", "127.0.0.1:1");
  const absl::StatusOr<RigLinks> links = connect_displays(rig_, *calibrations_, {"back"});
  ASSERT_TRUE(links.ok()) << links.status();
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

}  // namespace
}  // namespace glasswing
