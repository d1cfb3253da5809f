#include "core/archive/archive_store.h"

#include <fmt/format.h>

#include "tests/core/archive/made_archive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using ArchiveStoreTest = ArchiveTest;

TEST_F(ArchiveStoreTest, ClosesWhatNobodyAskedForOfLateAndOpensItAgain) {
  ArchiveStore store(root_ / "node");
  const auto make = [&](const std::string& session) {
    v1::CaptureManifest header = MadeArchive::header();
    header.set_session(session);
    return store.create(header).value();
  };
  std::shared_ptr<Archive> in_use = make("in-use");
  const std::weak_ptr<Archive> first = make("first"), used = in_use;
  for (int i = 0; i < 20; ++i) make(fmt::format("s{}", i));
  EXPECT_TRUE(first.expired());
  EXPECT_EQ(store.find("in-use").value(), in_use);  // never two objects for one archive
  for (int i = 0; i < 20; ++i) EXPECT_OK(store.find(fmt::format("s{}", i)));
  in_use = nullptr;
  EXPECT_OK(store.find("first"));
  EXPECT_TRUE(used.expired());
}

}  // namespace
}  // namespace glasswing
