#include "server/rig/node_registry.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "core/service/listener.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

class RigTest : public testing::Test {
 protected:
  static v1::RegisterRequest request(v1::NodeKind kind, const std::string& name,
                                     const std::string& address = "") {
    v1::RegisterRequest request;
    request.set_kind(kind);
    request.set_name(name);
    request.set_address(address);
    if (kind == v1::NODE_KIND_SOLVER) request.mutable_solver()->set_host("host of " + name);
    return request;
  }
  void hear(v1::NodeKind kind, const std::string& name) {
    EXPECT_OK(rig_.add(request(kind, name), std::nullopt));
  }
  static CertifiedPeer owner(const std::string& name, Roles roles) {
    return {.name = name, .roles = roles, .expires = std::chrono::sys_seconds::max()};
  }
  absl::Status camera(const std::string& name, const std::string& address, const std::string& certificate) {
    return rig_.add(
        request(v1::NODE_KIND_CAMERA, name, address),
        certificate.empty() ? std::optional<CertifiedPeer>() : owner(certificate, only(Role::kCamera)));
  }

  nanoseconds now_ = seconds(1000);
  std::set<std::string> alive_;  // addresses that take connections
  NodeRegistry rig_{
      {}, [this] { return now_; }, [this](const std::string& at) { return alive_.contains(at); }};
};

TEST_F(RigTest, ASilentNodeIsAway) {
  hear(v1::NODE_KIND_DISPLAY, "display-1");
  now_ += seconds(4);
  EXPECT_TRUE(rig_.nodes().front().up());
  now_ += seconds(1);
  EXPECT_FALSE(rig_.nodes().front().up());
}

// gRPC takes others too.
TEST_F(RigTest, AnAddressIsHostAndPort) {
  for (const char* address : {"unix:/run/other.sock", "127.0.0.1:80x", "127.0.0.1", "::1:80"}) {
    const absl::Status status = camera("camera-1", address, "");
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_NE(status.message().find(address), std::string::npos) << status;
  }
  EXPECT_TRUE(rig_.nodes().empty());
  EXPECT_OK(camera("camera-1", "[::1]:80", ""));
}

TEST_F(RigTest, WhatANodePreparesIsListedUntilItIsReadyOrAway) {
  v1::RegisterRequest camera = request(v1::NODE_KIND_CAMERA, "camera-1");
  camera.mutable_preparation()->set_what("simulating the scene");
  for (const double done : {0.0, 0.37, 1.0}) {
    camera.mutable_preparation()->set_done(done);
    EXPECT_OK(rig_.add(camera, std::nullopt));
    EXPECT_TRUE(rig_.nodes().front().up());
    EXPECT_EQ(rig_.nodes().front().preparation().what(), "simulating the scene");
    EXPECT_EQ(rig_.nodes().front().preparation().done(), done);
  }
  now_ += seconds(5);
  EXPECT_FALSE(rig_.nodes().front().has_preparation());
  EXPECT_OK(rig_.add(camera, std::nullopt));
  EXPECT_TRUE(rig_.nodes().front().has_preparation());
  for (const double done : {-0.01, 1.01, std::numeric_limits<double>::quiet_NaN()}) {
    camera.mutable_preparation()->set_done(done);
    EXPECT_TRUE(absl::IsInvalidArgument(rig_.add(camera, std::nullopt))) << done;
  }
  hear(v1::NODE_KIND_CAMERA, "camera-1");
  EXPECT_FALSE(rig_.nodes().front().has_preparation());
}

TEST_F(RigTest, AClockIsToldWithItsAgeUntilItsNodeIsAway) {
  hear(v1::NODE_KIND_CAMERA, "camera-1");
  EXPECT_FALSE(rig_.nodes().front().has_clock());
  rig_.note_clock("camera-1", std::chrono::milliseconds(-3), std::chrono::microseconds(40));
  rig_.note_clock("nobody", seconds(1), seconds(1));
  now_ += seconds(2);
  EXPECT_EQ(rig_.nodes().front().clock().offset_ns(), -3'000'000);
  EXPECT_EQ(rig_.nodes().front().clock().bound_ns(), 40'000);
  EXPECT_DOUBLE_EQ(rig_.nodes().front().clock().age_s(), 2.0);
  now_ += seconds(3);
  EXPECT_FALSE(rig_.nodes().front().has_clock());
}

TEST_F(RigTest, AClocksHistoryIsOneMeasurementEveryTenSecondsOfTheLastHour) {
  EXPECT_TRUE(absl::IsNotFound(rig_.clock_history("camera-1").status()));
  for (int second = 0; second < 4000; ++second, now_ += seconds(1)) {
    hear(v1::NODE_KIND_CAMERA, "camera-1");
    rig_.note_clock("camera-1", std::chrono::microseconds(second), nanoseconds(40));
  }
  const std::vector<v1::ClockOffset> history = rig_.clock_history("camera-1").value();
  ASSERT_EQ(history.size(), 360u);
  for (size_t i = 0; i < history.size(); ++i) {
    EXPECT_EQ(history[i].offset_ns(), 1000 * (3990 - 10 * static_cast<int>(359 - i)));
    EXPECT_DOUBLE_EQ(history[i].age_s(), 10.0 + 10.0 * static_cast<double>(359 - i));
  }
  now_ += std::chrono::minutes(30);
  EXPECT_EQ(rig_.clock_history("camera-1")->size(), 180u) << "what is older than an hour is not told";
}

TEST_F(RigTest, SolversAreKnownWithWhatTheySaidAndForgottenWhenTheyHaveLeft) {
  hear(v1::NODE_KIND_CAMERA, "camera-1");
  hear(v1::NODE_KIND_SOLVER, "b");
  hear(v1::NODE_KIND_SOLVER, "a");
  ASSERT_EQ(rig_.solvers().size(), 2u);
  EXPECT_EQ(rig_.solvers().front().node.name(), "a");
  EXPECT_EQ(rig_.solvers().front().info.host(), "host of a");
  now_ += kForgotten / 2;
  hear(v1::NODE_KIND_SOLVER, "b");
  now_ += kForgotten / 2;
  ASSERT_EQ(rig_.solvers().size(), 1u);
  EXPECT_EQ(rig_.solvers().front().node.name(), "b");
  EXPECT_FALSE(rig_.solvers().front().node.up());
  // Displays and cameras are never forgotten.
  ASSERT_EQ(rig_.nodes().size(), 2u);
  EXPECT_EQ(rig_.nodes().front().name(), "camera-1");
}

TEST_F(RigTest, AKindNeedsItsRole) {
  const std::pair<v1::NodeKind, Role> kKinds[] = {{v1::NODE_KIND_DISPLAY, Role::kDisplay},
                                                  {v1::NODE_KIND_CAMERA, Role::kCamera},
                                                  {v1::NODE_KIND_SOLVER, Role::kSolver}};
  for (const auto& [kind, role] : kKinds) {
    for (size_t other = 0; other < kRoleNames.size(); ++other) {
      const bool right = static_cast<Role>(other) == role;
      const std::string name = fmt::format("node-{}-{}", static_cast<int>(kind), other);
      const absl::Status added = rig_.add(request(kind, name), owner("sam", only(static_cast<Role>(other))));
      EXPECT_EQ(added.code(), right ? absl::StatusCode::kOk : absl::StatusCode::kPermissionDenied) << name;
    }
    EXPECT_OK(rig_.add(request(kind, fmt::format("all-{}", static_cast<int>(kind))), owner("rig", kNodes)));
    EXPECT_FALSE(rig_.add(request(kind, "none"), owner("nobody", 0)).ok());
  }
  EXPECT_EQ(rig_.nodes().size(), 6u);
}

TEST_F(RigTest, ANameBelongsToItsFirstCertificateForGood) {
  ASSERT_OK(camera("eye", "a:1", "rig"));
  EXPECT_EQ(rig_.nodes().front().certificate(), "rig");
  const absl::Status refused = camera("eye", "b:1", "eve");
  EXPECT_EQ(refused.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_NE(refused.message().find("\"rig\""), std::string::npos) << refused;
  EXPECT_NE(refused.message().find("glasswing nodes release eye"), std::string::npos) << refused;
  now_ += std::chrono::hours(24);
  EXPECT_FALSE(camera("eye", "b:1", "eve").ok()) << "silence is no gift";
  EXPECT_EQ(rig_.nodes().front().address(), "a:1");
  EXPECT_OK(camera("eye", "c:1", "rig")) << "its owner may move";
  EXPECT_EQ(rig_.release("eye").code(), absl::StatusCode::kFailedPrecondition) << "it is up";
  now_ += minutes(1);
  ASSERT_OK(rig_.release("eye"));
  EXPECT_TRUE(rig_.nodes().empty());
  EXPECT_OK(camera("eye", "b:1", "eve"));
  EXPECT_FALSE(camera("eye", "a:1", "rig").ok());
  EXPECT_EQ(rig_.release("nobody").code(), absl::StatusCode::kNotFound);
}

TEST_F(RigTest, ASolversNameIsItsOwnWhileItIsKnown) {
  const auto solver = [&](const std::string& certificate) {
    return rig_.add(request(v1::NODE_KIND_SOLVER, "s"), owner(certificate, only(Role::kSolver)));
  };
  ASSERT_OK(solver("a"));
  EXPECT_EQ(solver("b").code(), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(rig_.add(request(v1::NODE_KIND_CAMERA, "s"), owner("b", kNodes)).code(),
            absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(rig_.check_owner("s", owner("b", only(Role::kSolver))).code(),
            absl::StatusCode::kPermissionDenied);
  EXPECT_OK(rig_.check_owner("s", owner("a", only(Role::kSolver))));
  EXPECT_OK(rig_.check_owner("s", std::nullopt)) << "there are no certificates";
  now_ += kForgotten;
  EXPECT_OK(solver("b"));
}

TEST_F(RigTest, ANameIsNotTakenFromANodeThatIsAlive) {
  ASSERT_OK(camera("eye", "a:1", ""));
  EXPECT_EQ(camera("eye", "b:1", "").code(), absl::StatusCode::kAlreadyExists) << "just heard";
  now_ += seconds(60);
  alive_.insert("a:1");  // stopped, or cut off: silent, but not gone
  EXPECT_EQ(camera("eye", "b:1", "").code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(rig_.add(request(v1::NODE_KIND_DISPLAY, "eye", "b:1"), std::nullopt).code(),
            absl::StatusCode::kAlreadyExists);
  EXPECT_OK(camera("eye", "a:1", "")) << "it is back";
  now_ += seconds(60);
  alive_.clear();
  EXPECT_OK(camera("eye", "b:1", ""));
  EXPECT_EQ(rig_.nodes().front().address(), "b:1");
}

TEST_F(RigTest, TwoCamerasAreNotChosenFromByTheirNames) {
  EXPECT_EQ(rig_.camera("").status().code(), absl::StatusCode::kUnavailable);
  ASSERT_OK(camera("eye", "b:1", ""));
  EXPECT_EQ(rig_.camera("")->name(), "eye");
  ASSERT_OK(camera("aaa", "a:1", ""));
  const absl::Status both = rig_.camera("").status();
  EXPECT_EQ(both.code(), absl::StatusCode::kFailedPrecondition);
  for (const char* word : {"\"aaa\" at a:1", "\"eye\" at b:1"})
    EXPECT_NE(both.message().find(word), std::string::npos) << both;
  EXPECT_EQ(rig_.camera("eye")->address(), "b:1");
  EXPECT_EQ(rig_.camera("nose").status().code(), absl::StatusCode::kUnavailable);
  now_ += seconds(5);
  ASSERT_OK(camera("eye", "b:1", ""));
  EXPECT_EQ(rig_.camera("")->name(), "eye") << "the other is away";
}

TEST_F(RigTest, TheNumberOfNodesIsLimited) {
  for (size_t i = 0; i < NodeRegistry::kMaxNodes; ++i) hear(v1::NODE_KIND_SOLVER, fmt::format("s{}", i));
  EXPECT_EQ(rig_.add(request(v1::NODE_KIND_SOLVER, "more"), std::nullopt).code(),
            absl::StatusCode::kResourceExhausted);
  hear(v1::NODE_KIND_SOLVER, "s7");
  now_ += kForgotten;
  hear(v1::NODE_KIND_SOLVER, "more");
}

TEST(TakesConnections, WhereSomethingListens) {
  std::unique_ptr<Listener> listener = Listener::open("127.0.0.1:0").value();
  const std::string address = fmt::format("127.0.0.1:{}", listener->port());
  EXPECT_TRUE(takes_connections(address)) << "accepted or not";
  listener.reset();
  EXPECT_FALSE(takes_connections(address));
  for (const char* nowhere : {"", "127.0.0.1", "127.0.0.1:x", "nowhere.invalid:1"})
    EXPECT_FALSE(takes_connections(nowhere)) << nowhere;
}

}  // namespace
}  // namespace glasswing
