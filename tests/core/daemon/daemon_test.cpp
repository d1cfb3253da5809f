#include "core/daemon/daemon.h"

#include <gtest/gtest.h>

#include "core/daemon/daemon_options.h"

namespace glasswing {
namespace {

// A daemon with one required option, a simulated fault, and a subcommand that ends with status 3.
class RunDaemon : public testing::Test {
 protected:
  int run(std::vector<const char*> arguments) {
    arguments.insert(arguments.begin(), "glasswing-test");
    testing::internal::CaptureStderr();
    const int status = run_daemon(
        static_cast<int>(arguments.size()), arguments.data(),
        {.name = "glasswing-test",
         .description = "A test.",
         .footer = "",
         .build = "",
         .add_options =
             [&](CLI::App& app, DaemonOptions& options) {
               app.add_option("--data", data_, "a directory")->required();
               app.add_option("--backend", backend_, "a backend");
               backends_.add(app, "sim",
                             [&](CLI::App& own) { own.add_option("--fault-drop", drop_, "a fault"); });
               add_tls_options(app, options.tls);
               add_listen_options(app, options.listen);
               add_command(app, options, "check", "Checks.", []() -> absl::StatusOr<int> { return 3; });
               add_command(app, options, "break", "Fails.",
                           []() -> absl::StatusOr<int> { return absl::NotFoundError("nothing there"); });
             },
         .run =
             [&](const CLI::App& app, const DaemonOptions& options) {
               listen_ = options.listen;
               return backends_.check(app, backend_);
             }});
    printed_ = testing::internal::GetCapturedStderr();
    return status;
  }

  std::string data_, backend_ = "sim", printed_;
  double drop_ = 0.0;
  ListenOptions listen_;
  BackendOptions backends_;
};

TEST_F(RunDaemon, ACommandNeedsNoOptionOfTheDaemonAndSetsTheExitStatus) {
  EXPECT_EQ(run({"check"}), 3);
  EXPECT_EQ(run({"break"}), 1);
  EXPECT_EQ(printed_, "glasswing-test: nothing there\n");
}

TEST_F(RunDaemon, AWrongCommandLineIsNoSuccess) {
  EXPECT_NE(run({}), 0);
  EXPECT_NE(printed_.find("--data"), std::string::npos) << printed_;
  EXPECT_NE(run({"--data", "d", "--nonsense"}), 0);
}

// A process runs one daemon.
TEST_F(RunDaemon, ListensWhereItIsToldAndOnlySimulatedDevicesHaveFaults) {
  EXPECT_EQ(run({"--data", "d", "--listen", "0.0.0.0:7", "--advertise", "lab1:7", "--reflection", "--backend",
                 "x11", "--fault-drop", "0.5"}),
            1);
  EXPECT_EQ(listen_.address, "0.0.0.0:7");
  EXPECT_EQ(listen_.advertised, "lab1:7");
  EXPECT_TRUE(listen_.reflection);
  EXPECT_NE(printed_.find("--fault-drop is given with --backend x11"), std::string::npos) << printed_;
}

}  // namespace
}  // namespace glasswing
