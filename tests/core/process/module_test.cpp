#include "core/process/module.h"

#include <gtest/gtest.h>

#include <filesystem>

namespace glasswing {
namespace {

TEST(Module, MissingOneIsNamedWithWhereItWasSought) {
  const absl::Status status = load_module("glasswing-none.so", "none").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnimplemented);
  const std::string program = std::filesystem::canonical("/proc/self/exe").string();
  EXPECT_EQ(status.message(),
            "glasswing-none.so cannot be used: there is no lib/glasswing/glasswing-none.so above " + program);
}

}  // namespace
}  // namespace glasswing
