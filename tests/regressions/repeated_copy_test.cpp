// A copy of an archive that was broken off and asked for again at once was refused, because the first had not
// ended yet.
#include <latch>

#include "core/archive/archive_store.h"
#include "tests/core/archive/made_archive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using RepeatedCopy = ArchiveTest;

TEST_F(RepeatedCopy, WaitsForTheEndOfTheFirst) {
  ArchiveStore store(root_ / "node");
  ASSERT_OK(store.begin_copy("s", [] { return true; }));  // its caller has gone
  std::latch asked(1);
  std::jthread first([&] {
    asked.wait();
    store.end_copy("s");
  });
  asked.count_down();
  EXPECT_OK(store.begin_copy("s", [] { return false; }));
  EXPECT_TRUE(absl::IsAborted(store.begin_copy("s", [] { return false; })));  // that one still runs
}

}  // namespace
}  // namespace glasswing
