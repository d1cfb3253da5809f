#include "server/services/pages.h"

#include <gtest/gtest.h>

#include "glasswing/v1/fleet_service.pb.h"

namespace glasswing {
namespace {

v1::GetFleetResponse fleet(int solvers, int solves, size_t bytes = 0) {
  v1::GetFleetResponse fleet;
  for (int i = 0; i < solvers; ++i) fleet.add_solvers()->set_name(std::to_string(i));
  for (int i = 0; i < solves; ++i) {
    fleet.add_solves()->set_session(std::to_string(i));
    fleet.mutable_solves(i)->set_method(std::string(bytes, 'x'));
  }
  return fleet;
}

v1::GetFleetResponse page_of(v1::GetFleetResponse all, int size, const std::string& token) {
  v1::GetFleetRequest request;
  request.set_page_size(size);
  request.set_page_token(token);
  Page page = Page::of(request).value();
  page.cut(*all.mutable_solvers());
  page.cut(*all.mutable_solves());
  all.set_next_page_token(page.next_token());
  return all;
}

TEST(Page, TogetherHaveEverythingOnce) {
  const v1::GetFleetResponse all = fleet(7, 5);
  for (int size = 0; size < 15; ++size) {
    v1::GetFleetResponse read;
    int pages = 0;
    do {
      const v1::GetFleetResponse page = page_of(all, size, read.next_page_token());
      EXPECT_LE(page.solvers_size() + page.solves_size(), size == 0 ? Page::kMaxItems : size);
      EXPECT_GT(page.solvers_size() + page.solves_size(), 0);
      read.clear_next_page_token();
      read.MergeFrom(page);
      ++pages;
    } while (!read.next_page_token().empty());
    EXPECT_EQ(read.SerializeAsString(), all.SerializeAsString()) << size;
    EXPECT_EQ(pages, size == 0 ? 1 : (12 + size - 1) / size);
  }
}

TEST(Page, HasAtMostItsBytesButAtLeastOneItem) {
  const v1::GetFleetResponse large = fleet(0, 3, Page::kMaxBytes);
  EXPECT_EQ(page_of(large, 0, "").solves_size(), 1);
  EXPECT_EQ(page_of(large, 0, "1").solves(0).session(), "1");
  EXPECT_EQ(page_of(large, 0, "2").next_page_token(), "");
  const v1::GetFleetResponse many = page_of(fleet(0, 4000, 1000), 4000, "");
  EXPECT_EQ(many.solves_size(), Page::kMaxItems);
  EXPECT_LT(page_of(fleet(0, 4000, 5000), 4000, "").ByteSizeLong(), Page::kMaxBytes + 6000);
}

TEST(Page, BeyondTheEndIsEmpty) {
  const v1::GetFleetResponse end = page_of(fleet(2, 2), 0, "100");
  EXPECT_EQ(end.ByteSizeLong(), 0u);
  EXPECT_EQ(page_of({}, 5, "").ByteSizeLong(), 0u);
}

TEST(Page, RefusesWhatIsNoPage) {
  v1::GetFleetRequest request;
  request.set_page_size(-1);
  EXPECT_EQ(Page::of(request).status().code(), absl::StatusCode::kInvalidArgument);
  request.clear_page_size();
  for (const char* token : {"x", "-1", "0", "99999999999999999999", "1 2"}) {
    request.set_page_token(token);
    EXPECT_EQ(Page::of(request).status().code(), absl::StatusCode::kInvalidArgument) << token;
  }
}

}  // namespace
}  // namespace glasswing
